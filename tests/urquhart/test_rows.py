"""Plantations: trees in rows look alike everywhere, and a pose that is one row off explains nearly as much."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart import forests
from urquhart import SE2, Config, Recognition, Recognizer, describe
from urquhart.evaluation.simulation import observe, plantation

Plant = Callable[[float, float, np.random.Generator, float, float, float], NDArray[np.float64]]

SIDE = 90.0
CENTRES = [SE2(x, y, 0.4 * k) for k, (x, y) in enumerate((x, y) for x in range(20, 90, 12) for y in range(20, 90, 12))]


def stored(trees: NDArray[np.float64], poses: Sequence[SE2], radius: float, rng: np.random.Generator) -> Recognizer:
    recognizer = Recognizer(Config())
    recognizer.add(
        (key, describe(observe(trees, pose, radius, rng, sigma=0.03, detection=0.98).xy, Config()))
        for key, pose in enumerate(poses)
    )
    return recognizer


def is_right(found: Recognition, poses: Sequence[SE2], truth: SE2) -> bool:
    best = found.candidates[0]
    shift, turn = (poses[best.key] @ best.transform).distance(truth)
    return shift < 1.0 and turn < 0.05


@pytest.mark.parametrize(
    ("spacing", "jitter", "survival", "least", "most"),
    [
        # Planted by machine: nothing tells one row from the next, and it is said so.
        ((3.0, 3.0), 0.0, 1.0, 0, 0),
        ((2.5, 3.5), 0.0, 0.97, 0, 2),
        ((3.0, 3.0), 0.03, 0.97, 0, 10),
        # Planted by hand: ten centimetres of each tree are enough.
        ((3.0, 3.0), 0.1, 0.97, 15, 20),
        ((2.5, 3.5), 0.15, 0.95, 18, 20),
        ((2.0, 4.0), 0.2, 0.9, 18, 20),
    ],
)
def test_in_rows_what_is_matched_is_right(
    spacing: tuple[float, float], jitter: float, survival: float, least: int, most: int
) -> None:
    rng = np.random.default_rng(5)
    trees = plantation(SIDE, SIDE, rng, spacing=spacing, jitter=jitter, survival=survival)
    recognizer = stored(trees, CENTRES, 20.0, rng)
    right = 0
    for _ in range(20):
        pose = forests.pose(rng, 20.0, 70.0)
        found = recognizer.recognize(observe(trees, pose, 20.0, rng, sigma=0.05, detection=0.95).xy)
        if found.verdict == "matched":
            assert is_right(found, CENTRES, pose)
            assert found.rivals == ()
            right += 1
        else:
            assert found.reason in ("runner_up_too_close", "below_gate")
    assert least <= right <= most


def test_what_is_ambiguous_names_rivals_that_are_elsewhere() -> None:
    rng = np.random.default_rng(6)
    trees = plantation(SIDE, SIDE, rng, jitter=0.03, survival=0.97)
    recognizer, ambiguous = stored(trees, CENTRES, 20.0, rng), 0
    for _ in range(10):
        found = recognizer.recognize(observe(trees, forests.pose(rng, 25.0, 65.0), 20.0, rng, sigma=0.05).xy)
        if found.verdict != "ambiguous":
            continue
        ambiguous += 1
        best, evidence = found.candidates[0], [rival.evidence for rival in found.rivals]
        assert evidence
        assert evidence == sorted(evidence, reverse=True)
        assert found.margin == pytest.approx(best.evidence - evidence[0])
        for rival in found.rivals:
            shift, turn = (CENTRES[rival.key] @ rival.transform).distance(CENTRES[best.key] @ best.transform)
            assert shift > 1.0 or turn > 0.05
    assert ambiguous >= 5


def ask(
    trees: NDArray[np.float64], poses: Sequence[SE2], pose: SE2, radius: float, rng: np.random.Generator
) -> tuple[Recognition, bool]:
    """The answer to what is seen from `pose` where `poses` are stored, and whether it is right."""
    found = stored(trees, poses, radius, rng).recognize(
        observe(trees, pose, radius, rng, sigma=0.03, detection=0.98).xy
    )
    return found, is_right(found, poses, pose)


def at_corners(jitter: float, survival: float, *, here: bool) -> tuple[int, int]:
    """Right and wrong matches of 24 at a corner; `here`: whether it is stored, or only the opposite one."""
    right = wrong = 0
    for seed in range(24):
        rng = np.random.default_rng([seed, 3])
        trees = plantation(150.0, 150.0, rng, spacing=(5.0, 5.0), jitter=jitter, survival=survival)
        turns = rng.uniform(-3.0, 3.0, 3).tolist()
        poses = [SE2(0.0, 0.0, turns[0]), SE2(145.0, 145.0, turns[1])]
        found, is_it = ask(trees, poses if here else poses[1:], SE2(0.0, 0.0, turns[2]), 40.0, rng)
        right += found.verdict == "matched" and is_it
        wrong += found.verdict == "matched" and not is_it
    return right, wrong


@pytest.mark.parametrize("survival", [1.0, 0.95])
@pytest.mark.parametrize(("jitter", "least"), [(0.0, 0), (0.03, 0), (0.06, 18), (0.1, 20), (0.2, 22), (0.3, 22)])
def test_the_corner_of_an_orchard_is_not_taken_for_the_opposite_one(jitter: float, least: int, survival: float) -> None:
    right, wrong = at_corners(jitter, survival, here=True)
    assert wrong == 0
    assert right >= least


@pytest.mark.parametrize("survival", [1.0, 0.95])
@pytest.mark.parametrize("jitter", [0.0, 0.03, 0.06, 0.2, 0.3])
def test_a_corner_that_is_not_stored_is_not_taken_for_one_that_is(jitter: float, survival: float) -> None:
    assert at_corners(jitter, survival, here=False) == (0, 0)


def hexagonal(
    width: float, height: float, rng: np.random.Generator, spacing: float, jitter: float, survival: float
) -> NDArray[np.float64]:
    """Trees (N, 2), metres, each as far from its six neighbours."""
    rise = spacing * np.sqrt(3.0) / 2.0
    i, j = np.meshgrid(np.arange(int(width / spacing) + 1), np.arange(int(height / rise) + 1))
    points = np.column_stack([((i + 0.5 * (j % 2)) * spacing).ravel(), (j * rise).ravel()])
    points = points[rng.random(len(points)) < survival]
    trees: NDArray[np.float64] = points + rng.normal(0.0, jitter, points.shape)
    return trees


def thinned(
    width: float, height: float, rng: np.random.Generator, spacing: float, jitter: float, survival: float
) -> NDArray[np.float64]:
    """Rows of which every third was cut."""
    points = plantation(width, height, rng, spacing=(spacing, spacing), jitter=0.0, survival=survival)
    points = points[np.round(points[:, 1] / spacing) % 3 != 2]
    trees: NDArray[np.float64] = points + rng.normal(0.0, jitter, points.shape)
    return trees


@pytest.mark.parametrize("plant", [hexagonal, thinned])
@pytest.mark.parametrize(("jitter", "least"), [(0.0, 0), (0.03, 0), (0.06, 10)])
def test_the_edge_of_a_stand_is_not_taken_for_another_edge(plant: Plant, jitter: float, least: int) -> None:
    right = 0
    for seed in range(15):
        rng = np.random.default_rng([seed, 4])
        trees = plant(70.0, 70.0, rng, 4.0, jitter, 0.97)
        far_x, far_y = trees.max(axis=0).tolist()
        turns = rng.uniform(-3.0, 3.0, 5).tolist()
        poses = [SE2(0.5 * far_x, 0.0, turns[0]), SE2(0.5 * far_x, far_y, turns[1]), SE2(far_x, 0.5 * far_y, turns[2])]
        for pose, known in ((SE2(0.0, 0.5 * far_y, turns[3]), False), (SE2(0.5 * far_x, 0.0, turns[4]), True)):
            found, is_it = ask(trees, poses, pose, 24.0, rng)
            assert found.verdict != "matched" or (known and is_it)
            right += found.verdict == "matched"
    assert right >= least


@pytest.mark.parametrize(("jitter", "least"), [(0.0, 0), (0.03, 0), (0.06, 3), (0.1, 9)])
def test_of_two_stands_planted_alike_side_by_side_the_right_one_is_told_or_none(jitter: float, least: int) -> None:
    """Also where only the other one is stored, and the rows of both are one another's continuation."""
    right = 0
    for seed in range(15):
        rng = np.random.default_rng([seed, 5])
        one, two = (
            plantation(38.0, 38.0, rng, spacing=(3.0, 3.0), jitter=jitter, survival=0.97) + [x, 0.0]
            for x in (0.0, 45.0)
        )
        trees = np.concatenate([one, two])
        poses = [SE2(x, y, float(rng.uniform(-3.0, 3.0))) for x in (12.0, 26.0, 57.0, 71.0) for y in (12.0, 26.0)]
        pose = SE2(float(rng.uniform(60.0, 68.0)), float(rng.uniform(15.0, 23.0)), 1.0)
        found, is_it = ask(trees, poses, pose, 16.0, rng)
        assert found.verdict != "matched" or is_it
        right += found.verdict == "matched"
        features = [describe(observe(one, at, 16.0, rng, sigma=0.03).xy, Config()) for at in poses[:4]]
        recognizer = Recognizer(Config())
        recognizer.add(enumerate(features))
        assert recognizer.recognize(observe(two, pose, 16.0, rng, sigma=0.03).xy).verdict != "matched"
    assert right >= least


@pytest.mark.parametrize("jitter", [0.03, 0.06, 0.1])
def test_a_lane_between_two_stands_is_not_taken_for_their_outer_edges(jitter: float) -> None:
    """Either stand's edge fits the stored one: those two poses claim different trees of the query, and rule each
    other out."""
    for seed in range(30):
        rng = np.random.default_rng([seed, 6])
        trees = np.concatenate([hexagonal(47.0, 47.0, rng, 4.0, jitter, 0.95) + [x, 0.0] for x in (0.0, 55.0)])
        poses = [SE2(0.0, 23.5, 1.0), SE2(102.0, 23.5, 2.0)]
        found, _ = ask(trees, poses, SE2(51.0, 23.5, float(rng.uniform(-3.0, 3.0))), 21.4, rng)
        assert found.verdict != "matched"


def test_a_rival_among_the_candidates_has_no_confidence_of_its_own() -> None:
    rng = np.random.default_rng(9)
    trees = plantation(SIDE, SIDE, rng, jitter=0.02, survival=0.98)
    recognizer, checked = stored(trees, CENTRES, 20.0, rng), 0
    for _ in range(6):
        found = recognizer.recognize(observe(trees, forests.pose(rng, 25.0, 65.0), 20.0, rng, sigma=0.05).xy)
        if found.verdict == "ambiguous":
            checked += 1
            # They cannot all be right: what is said of each adds up to hardly more than one.
            places = [CENTRES[candidate.key] @ candidate.transform for candidate in found.candidates]
            apart = [place.distance(places[0])[0] > 1.0 for place in places]
            others = [c.confidence for c, is_apart in zip(found.candidates, apart, strict=True) if is_apart]
            assert all(confidence < 0.5 for confidence in others)
    assert checked >= 4
