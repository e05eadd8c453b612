"""Correlation finds a pattern when no feature of it is whole."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from urquhart import SE2, Config, Recognition, Recognizer, describe
from urquhart.evaluation.simulation import Sensor, SimulatedObservation, bridson, observe, paper_forest, plantation
from urquhart.propose.correlation import Rotations, correlate, covers_ends, find_peaks
from urquhart.propose.quad_consensus import TURN, QuadConsensus
from urquhart.verify.landmark_grid import LandmarkGrid, landmark_grid
from urquhart.verify.refinement import refine_rough

CONFIG = Config()
NEAR = CONFIG.reach


@pytest.fixture(scope="module")
def forest() -> NDArray[np.float64]:
    return paper_forest(np.random.default_rng(1), 400.0)


def laid(seen: SimulatedObservation) -> tuple[LandmarkGrid, SE2]:
    features = describe(seen.xy, CONFIG)
    return landmark_grid(features, NEAR), SE2.shift(features.origin)


def two(
    forest: NDArray[np.float64], seed: int, **noise: float
) -> tuple[SimulatedObservation, SimulatedObservation, SE2]:
    rng = np.random.default_rng(seed)
    first = SE2(200.0, 200.0, float(rng.uniform(-3.0, 3.0)))
    second = SE2(220.0, 185.0, float(rng.uniform(-3.0, 3.0)))
    here, there = (observe(forest, pose, Sensor(50.0, **noise), rng) for pose in (first, second))
    return here, there, first.inverse() @ second


@pytest.mark.parametrize(
    "noise",
    [
        {},
        {"sigma": 0.2, "detection": 0.6},
        {"sigma": 0.4, "detection": 0.8},
        {"sigma": 0.1, "detection": 0.9, "clutter": 1.0},
    ],
)
def test_the_true_pose_is_the_highest_peak(forest: NDArray[np.float64], noise: dict[str, float]) -> None:
    right = 0
    for seed in range(6):
        here, there, truth = two(forest, seed, **noise)
        (submap, to_submap), (query, to_query) = laid(here), laid(there)
        peaks = correlate(query, submap, 8)
        # A peak is good to a cell and a step of the rotation; refined it is the pose.
        best = refine_rough(query, submap, peaks[:1, :3].copy(), NEAR, 1)
        shift, turn = SE2(*best[:3].tolist()).distance(to_submap.inverse() @ truth @ to_query)
        right += shift < 0.5 and turn < 0.02
    assert right >= 5


def test_correlation_about_the_true_rotation_finds_what_that_of_all_finds_and_one_elsewhere_does_not(
    forest: NDArray[np.float64],
) -> None:
    for seed in range(6):
        here, there, truth = two(forest, seed, sigma=0.2, detection=0.8)
        (submap, to_submap), (query, to_query) = laid(here), laid(there)
        wanted = to_submap.inverse() @ truth @ to_query
        # Votes of quads are as coarse as this.
        near = correlate(query, submap, 6, Rotations(wanted.yaw + 0.7 * TURN, TURN))
        shift, turn = SE2(*near[0, :3].tolist()).distance(wanted)
        assert shift < 1.0
        assert turn < 0.05
        assert (near[:, 3] == np.sort(near[:, 3])[::-1]).all()
        np.testing.assert_array_equal(near[0], correlate(query, submap, 6)[0])
        for away in (1.0, 2.0, np.pi):
            elsewhere = correlate(query, submap, 6, Rotations(wanted.yaw + away, TURN))
            assert elsewhere[:, 3].max(initial=0.0) < 0.7 * near[0, 3]
            off = (elsewhere[:, 2] - wanted.yaw - away + np.pi) % (2.0 * np.pi) - np.pi
            assert (np.abs(off) <= TURN).all()


@pytest.mark.parametrize("yaw", [-9.0, -3.2, 0.05, 3.1, 6.3, 20.0])
def test_a_rotation_may_be_given_in_any_turn(forest: NDArray[np.float64], yaw: float) -> None:
    here, there, _ = two(forest, 1, sigma=0.1)
    (submap, _), (query, _) = laid(here), laid(there)
    plain = correlate(query, submap, 4, Rotations(yaw, TURN))
    for turns in (-2, 1):
        np.testing.assert_array_equal(correlate(query, submap, 4, Rotations(yaw + turns * 2.0 * np.pi, TURN)), plain)


def test_settled_peaks_are_nearer_to_the_truth(forest: NDArray[np.float64]) -> None:
    before, after = [], []
    for seed in range(8):
        here, there, truth = two(forest, seed, sigma=0.2, detection=0.7)
        (submap, to_submap), (query, to_query) = laid(here), laid(there)
        wanted = to_submap.inverse() @ truth @ to_query
        peaks = correlate(query, submap, 6)
        rough = SE2(*peaks[0, :3].tolist()).distance(wanted)
        fine = SE2(*refine_rough(query, submap, peaks[:1, :3].copy(), NEAR, 1)[:3].tolist()).distance(wanted)
        if rough[0] < 1.5:
            before.append(rough)
            after.append(fine)
    assert len(after) >= 6
    assert (np.median(after, axis=0) < 0.6 * np.median(before, axis=0)).all()


@pytest.mark.parametrize(("far", "long"), [(1e3, 1), (1e3, 40), (1e5, 3)])
def test_landmarks_outside_the_rim_of_the_grid_are_left_out(far: float, long: int) -> None:
    """One stray landmark makes a footprint so large that the grid of shifts has to leave most of it out."""
    rng = np.random.default_rng(2)
    trees = rng.uniform(-30.0, 30.0, (60, 2))
    strays = np.column_stack([np.linspace(0.5 * far, far, long), rng.uniform(-1.0, 1.0, long)])
    for query, submap in (
        (trees, np.concatenate([trees, strays])),
        (np.concatenate([trees, strays]), trees),
        (np.concatenate([trees, -strays]), np.concatenate([trees, strays])),
    ):
        for half in (np.pi, TURN, 0.0):
            peaks = find_peaks(query - query.mean(axis=0), submap - submap.mean(axis=0), 1.0, 6, Rotations(0.0, half))
            assert len(peaks) <= 6
            assert np.isfinite(peaks).all()


def test_peaks_are_distinct_places_and_the_order_of_landmarks_is_no_matter(forest: NDArray[np.float64]) -> None:
    here, there, _ = two(forest, 3, sigma=0.2, detection=0.8)
    peaks = find_peaks(there.xy, here.xy, 1.0, 16)
    assert 1 < len(peaks) <= 16
    for i, peak in enumerate(peaks):
        for other in peaks[:i]:
            shift, turn = SE2(*peak[:3].tolist()).distance(SE2(*other[:3].tolist()))
            assert shift > 1.0 or turn > 0.02
    mixed = find_peaks(there.xy, here.xy[np.random.default_rng(0).permutation(len(here.xy))], 1.0, 16)
    np.testing.assert_allclose(mixed[0], peaks[0])


@pytest.mark.parametrize("count", [3, 5, 20])
@pytest.mark.parametrize("scale", [0.01, 1.0, 1e4])
def test_odd_inputs_give_few_or_no_peaks_and_no_crash(count: int, scale: float) -> None:
    rng = np.random.default_rng(count)
    first, second = scale * rng.uniform(-1.0, 1.0, (count, 2)), scale * rng.uniform(-1.0, 1.0, (count, 2))
    for query, submap in ((first, second), (first, first), (first * [1.0, 1e-4], second)):
        peaks = find_peaks(query - query.mean(axis=0), submap - submap.mean(axis=0), 1.0, 4)
        assert peaks.shape[1] == 4
        assert len(peaks) <= 4
        assert np.isfinite(peaks).all()


def test_a_stand_half_seen_on_both_sides_is_recognised_by_it(forest: NDArray[np.float64]) -> None:
    levels = []
    for seed in range(8):
        here, there, truth = two(forest, seed, sigma=0.2, detection=0.6)
        recognizer = Recognizer(CONFIG)
        recognizer.add([(0, describe(here.xy, CONFIG))])
        found = recognizer.locate(there.xy)
        if recognizer.verify_pose(describe(there.xy, CONFIG), 0, truth).verdict == "matched":
            assert found.verdict == "matched"
            assert found.candidates[0].transform.distance(truth)[0] < 1.0
            levels.append(found.candidates[0].level)
    assert "exhaustive" in levels


def test_in_a_dense_forest_hardly_a_polygon_is_whole_but_quads_and_surveys_find_the_place(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Trees 3 m apart, seen with an error of 0.3 m and a fifth of them not at all, in a large collection."""
    rng = np.random.default_rng(1)
    trees = bridson(140.0, 140.0, 2.2, rng)
    trees += rng.normal(0.0, 0.6, trees.shape)
    trees = np.delete(trees, cKDTree(trees).query_pairs(0.5, output_type="ndarray")[:, 1], axis=0)
    centres = [
        SE2(x, y, float(rng.uniform(-np.pi, np.pi)))
        for x, y in itertools.product(np.arange(15.0, 126.0, 12.0).tolist(), repeat=2)
    ]
    recognizer = Recognizer(CONFIG)
    recognizer.add(
        (key, describe(observe(trees, pose, Sensor(15.0, sigma=0.1, detection=0.95), rng).xy, CONFIG))
        for key, pose in enumerate(centres)
    )
    poses = [SE2(*rng.uniform((20.0, 20.0, -np.pi), (120.0, 120.0, np.pi)).tolist()) for _ in range(20)]
    seen = [observe(trees, pose, Sensor(15.0, sigma=0.3, detection=0.8, clutter=0.1), rng).xy for pose in poses]

    def levels() -> list[str]:
        right: list[str] = []
        for pose, xy in zip(poses, seen, strict=True):
            found = recognizer.locate(xy)
            if found.verdict == "matched":
                best = found.candidates[0]
                shift, turn = (centres[best.key] @ best.transform).distance(pose)
                assert shift < 1.0
                assert turn < 0.05
                right.append(best.level)
        return right

    assert levels().count("quads") >= 16

    def search_only(_query: object, _index: object, search: QuadConsensus, *_: object) -> list[object]:
        search.advance()
        return []

    # As if no pose of theirs were any good, only the rotations that they agree on.
    monkeypatch.setattr("urquhart.propose.levels.propose_by_quads", search_only)
    without = levels()
    assert without.count("exhaustive") >= 4
    monkeypatch.setattr(recognizer, "config", Config(survey=0))
    held = (replace(recognizer.index, config=Config(survey=0)), recognizer._held[1])
    monkeypatch.setattr(recognizer, "_held", held)
    assert levels() == [level for level in without if level != "exhaustive"]


def test_what_is_not_stored_is_not_found_by_a_survey_either() -> None:
    forest, other = (bridson(140.0, 140.0, 2.4, np.random.default_rng(seed)) for seed in (1, 2))
    rng, recognizer = np.random.default_rng(3), Recognizer(CONFIG)
    centres = itertools.product(np.arange(15.0, 126.0, 20.0).tolist(), repeat=2)
    recognizer.add(
        (key, describe(observe(forest, SE2(x, y, 0.0), Sensor(15.0, sigma=0.1), rng).xy, CONFIG))
        for key, (x, y) in enumerate(centres)
    )
    for _ in range(8):
        pose = SE2(*rng.uniform((20.0, 20.0, -np.pi), (120.0, 120.0, np.pi)).tolist())
        found = recognizer.locate(observe(other, pose, Sensor(15.0, sigma=0.3, detection=0.8, clutter=0.1), rng).xy)
        assert found.verdict != "matched"
        stages = {stage.name: stage.counts for stage in found.stages}
        assert "exhaustive" in stages
        # Too many submaps for every rotation of each: the quads chose, or there was nothing to choose.
        assert stages["survey"]["places"] <= CONFIG.survey


@pytest.mark.parametrize("length", [60.0, 120.0, 240.0])
def test_the_end_of_a_single_long_submap_is_found(length: float) -> None:
    """Correlation leaves out the ends of a footprint that is much longer than the query's; its features do not."""
    rng = np.random.default_rng(4)
    forest = paper_forest(rng, 600.0)
    strip = forest[(np.abs(forest[:, 0] - 300.0) < length) & (np.abs(forest[:, 1] - 300.0) < 25.0)]
    recognizer = Recognizer(CONFIG)
    recognizer.add([(0, describe(strip, CONFIG))])
    for yaw in (0.0, 1.0, 2.5, -2.0):
        for x in (300.0 - 0.9 * length, 300.0, 300.0 + 0.9 * length):
            pose = SE2(x, 300.0, yaw)
            found = recognizer.locate(observe(forest, pose, Sensor(25.0, sigma=0.05, detection=0.95), rng).xy)
            assert found.verdict == "matched"
            assert found.candidates[0].transform.distance(pose)[0] < 0.5


def test_only_of_submaps_not_much_larger_than_the_query_correlation_sees_the_ends(forest: NDArray[np.float64]) -> None:
    one, _, _ = two(forest, 1)
    (small, _), (large, _) = (
        laid(one),
        laid(observe(forest, SE2(200.0, 200.0, 0.0), Sensor(150.0), np.random.default_rng(0))),
    )
    assert covers_ends(small, small)
    assert covers_ends(large, small)
    assert not covers_ends(small, large)


def alone(xy: NDArray[np.float64], pose: SE2) -> tuple[Recognition, float]:
    """What a collection of nothing but `xy` answers to the same trees seen from `pose`, and metres from the truth."""
    recognizer = Recognizer(CONFIG)
    recognizer.add([(0, describe(xy, CONFIG))])
    found = recognizer.locate(pose.apply(xy))
    apart = (found.candidates[0].transform @ pose).distance(SE2.identity())[0] if found.candidates else np.inf
    return found, apart


@pytest.mark.parametrize("yaw", [0.0, 1.3])
@pytest.mark.parametrize("kind", ["dense", "sparse", "few", "rows"])
def test_a_submap_alone_finds_itself(kind: str, yaw: float) -> None:
    """An exact copy puts every pair of one shift into one cell, hundreds of them; of a few trees it has a few."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        trees, radius = {
            "dense": (bridson(100.0, 100.0, 2.5, rng), 26.0),
            "sparse": (paper_forest(rng, 100.0), 40.0),
            "few": (paper_forest(rng, 100.0), 14.0),
            "rows": (plantation(100.0, 100.0, rng), 30.0),
        }[kind]
        xy = observe(trees, SE2(50.0, 50.0, 0.0), Sensor(radius), rng).xy
        pose = SE2(float(rng.uniform(-9.0, 9.0)), 4.0, yaw)
        found, apart = alone(xy, pose)
        assert (found.verdict, found.reason) == ("matched", "verified"), (seed, len(xy))
        assert apart < 0.05


def test_a_cell_holds_as_many_pairs_as_there_are() -> None:
    """An exact copy of 900 landmarks brings 900 pairs into the four cells about the right shift."""
    trees = np.random.default_rng(0).uniform(-100.0, 100.0, (900, 2))
    peaks = find_peaks(trees, trees, 1.0, 4, Rotations(0.0, 0.0))
    assert np.abs(peaks[0, :2]).max() <= 1.0
    assert peaks[0, 3] > 1_000.0 > 20.0 * peaks[1, 3]
