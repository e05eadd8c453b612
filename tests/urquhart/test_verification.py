from dataclasses import replace

import numpy as np
import pytest

from tests.urquhart import forests
from urquhart import SE2, Config, describe
from urquhart.decide.confidence import CONFIDENCE, log_odds
from urquhart.decide.rivals import distinct, hill_climb, pose_row, same_place
from urquhart.decide.shifts import shift_peaks
from urquhart.evaluation.simulation import Sensor, observe, paper_forest, plantation
from urquhart.pose_covariance import least_squares
from urquhart.propose.query import log_volume
from urquhart.verify.evidence import evidence_of_pose, evidence_of_row
from urquhart.verify.landmark_grid import GRID, LandmarkGrid, build_landmark_grid, landmark_grid, nearest
from urquhart.verify.pairing import pair_up
from urquhart.verify.refinement import best_hypotheses, refine_rough, verify

REACH = 0.75
FOREST = paper_forest(np.random.default_rng(0), side=500.0)


def seen(pose: SE2, seed: int, radius: float = 40.0, **noise: float) -> tuple[LandmarkGrid, SE2]:
    """A pattern seen from `pose`, and `map_T_pattern` of its centred frame."""
    features = describe(observe(FOREST, pose, Sensor(radius, **noise), np.random.default_rng(seed)).xy, Config())
    return landmark_grid(features, REACH), pose @ SE2.shift(features.origin)


def test_the_grid_finds_what_brute_force_finds() -> None:
    rng = np.random.default_rng(0)
    for _, points in forests.all_kinds(seed=1, each=8):
        laid = landmark_grid(describe(points, Config()), REACH)
        points = laid.landmarks
        for x, y in rng.uniform(points.min() - 3.0, points.max() + 3.0, (60, 2)):
            distance = np.linalg.norm(points - [x, y], axis=1)
            k, squared = nearest(laid, x, y, REACH)
            if distance.min() <= REACH:
                assert squared == pytest.approx(distance.min() ** 2)
                assert distance[k] == pytest.approx(distance.min())
            else:
                assert k == -1


def test_partners_are_one_to_one_and_mutual() -> None:
    submap = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]])
    query = np.array([[0.1, 0.0], [0.4, 0.0], [10.0, 0.2], [5.0, 5.0]])
    laid = build_landmark_grid(
        submap, np.ones(3, np.float32), np.arange(3, dtype=np.int32), np.empty(0, np.float32), REACH
    )
    assert laid.area == pytest.approx(50.0)
    first, second, squared = pair_up(query, laid, 0.0, 0.0, 0.0, REACH)
    assert first.tolist() == [0, 2]
    assert second.tolist() == [0, 1]
    np.testing.assert_allclose(np.sqrt(squared), [0.1, 0.2])


@pytest.mark.parametrize("seed", range(10))
def test_a_rough_start_is_refined_to_the_truth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    submap, map_T_submap = seen(SE2(250.0, 250.0, 0.0), seed, sigma=0.1, detection=0.9)
    query, map_T_query = seen(SE2(262.0, 244.0, rng.uniform(-3.0, 3.0)), seed + 100, sigma=0.1, detection=0.9)
    truth = map_T_submap.inverse() @ map_T_query
    start = SE2(truth.x + rng.normal(0.0, 0.2), truth.y + rng.normal(0.0, 0.2), truth.yaw + rng.normal(0.0, 0.005))
    found = verify(query, submap, start, REACH)
    shift, turn = found.transform.distance(truth)
    assert shift < 0.15
    assert turn < 0.005
    assert found.evidence > 60.0
    assert len(found.query) > 25
    assert len(found.query) <= min(found.query_overlap, found.submap_overlap)
    assert found.residuals.max() <= GRID.loose * REACH


@pytest.mark.parametrize("seed", range(6))
def test_of_rough_poses_the_right_one_is_settled_even_from_more_than_a_metre_away(seed: int) -> None:
    rng = np.random.default_rng(seed)
    submap, map_T_submap = seen(SE2(250.0, 250.0, 0.0), seed, sigma=0.1, detection=0.9)
    query, map_T_query = seen(SE2(258.0, 246.0, rng.uniform(-3.0, 3.0)), seed + 100, sigma=0.1, detection=0.9)
    truth = map_T_submap.inverse() @ map_T_query
    bearing = rng.uniform(-3.0, 3.0)
    rough = [truth.x + 1.2 * np.cos(bearing), truth.y + 1.2 * np.sin(bearing), truth.yaw + rng.uniform(-0.02, 0.02)]
    wrong = rng.uniform((-30.0, -30.0, -3.0), (30.0, 30.0, 3.0), (7, 3))
    starts = np.insert(wrong, int(rng.integers(8)), rough, axis=0)
    before = starts.copy()
    for count in (1, 4, 99):
        best = refine_rough(query, submap, starts, REACH, count)
        assert best.shape == (6,)
        shift, turn = SE2(*best[:3].tolist()).distance(truth)
        assert shift < 0.15
        assert turn < 0.005
        assert evidence_of_row(query, submap, best).evidence == pytest.approx(best[3])
    np.testing.assert_array_equal(starts, before)
    alone = refine_rough(query, submap, wrong[:1], REACH, 4)
    assert alone[3] < best[3]


def test_evidence_separates_the_right_pose_from_the_best_of_many_wrong_ones() -> None:
    rng = np.random.default_rng(1)
    submap, map_T_submap = seen(SE2(250.0, 250.0, 0.0), 1, sigma=0.2, detection=0.8)
    query, map_T_query = seen(SE2(255.0, 255.0, 1.0), 2, sigma=0.2, detection=0.8)
    right = verify(query, submap, map_T_submap.inverse() @ map_T_query, REACH)
    wrong = [verify(query, submap, forests.pose(rng, -30.0, 30.0), REACH).evidence for _ in range(3000)]
    assert right.evidence > 40.0 > max(wrong)
    assert np.median(wrong) < 0.0


def test_missing_trees_speak_against() -> None:
    """The same partners, fewer and fewer of the trees that should be there."""
    submap, _ = seen(SE2(250.0, 250.0, 0.0), 3)
    evidence = []
    for detection in (1.0, 0.8, 0.6, 0.4):
        query, map_T_query = seen(SE2(250.0, 250.0, 0.0), 4, detection=detection)
        _, map_T_submap = seen(SE2(250.0, 250.0, 0.0), 3)
        found = evidence_of_pose(query, submap, map_T_submap.inverse() @ map_T_query, REACH)
        evidence.append(found.evidence / len(found.query))
    assert evidence == sorted(evidence, reverse=True)


def test_the_noise_is_found_from_the_residuals() -> None:
    found = []
    for sigma in (0.03, 0.15, 0.3):
        submap, map_T_submap = seen(SE2(250.0, 250.0, 0.0), 5)
        query, map_T_query = seen(SE2(250.0, 250.0, 0.0), 6, sigma=sigma)
        found.append(evidence_of_pose(query, submap, map_T_submap.inverse() @ map_T_query, REACH).noise)
    assert found == sorted(found)
    assert found[0] <= 0.1 < found[2]


def test_the_best_hypothesis_is_the_one_that_brings_most_together() -> None:
    submap, map_T_submap = seen(SE2(250.0, 250.0, 0.0), 7)
    query, map_T_query = seen(SE2(250.0, 250.0, 2.0), 8, sigma=0.1)
    truth = map_T_submap.inverse() @ map_T_query
    hypotheses = np.array([[0.0, 0.0, 0.0], [truth.x, truth.y, truth.yaw], [5.0, 5.0, 1.0]])
    best = best_hypotheses(query, submap, hypotheses, REACH, 1)
    np.testing.assert_array_equal(best, hypotheses[1:2])
    ranked = best_hypotheses(query, submap, hypotheses, REACH, 3)
    np.testing.assert_array_equal(ranked[0], hypotheses[1])
    np.testing.assert_array_equal(np.sort(ranked, axis=0), np.sort(hypotheses, axis=0))


def test_two_submaps_of_one_place_are_no_rivals() -> None:
    _, map_T_query = seen(SE2(250.0, 250.0, 0.3), 9, sigma=0.1)
    one, map_T_one = seen(SE2(240.0, 250.0, 0.0), 10, sigma=0.1)
    two, map_T_two = seen(SE2(260.0, 255.0, 0.0), 11, sigma=0.1)
    other, _ = seen(SE2(150.0, 120.0, 0.0), 12, sigma=0.1)
    first, second = map_T_one.inverse() @ map_T_query, map_T_two.inverse() @ map_T_query
    assert same_place(one, first, two, second, Config())
    assert not same_place(one, first, other, second, Config())


def test_rows_of_trees_have_strong_rivals_and_natural_forests_weak_ones() -> None:
    rows = plantation(80.0, 80.0, np.random.default_rng(0), jitter=0.15, survival=0.95)
    planted = landmark_grid(
        describe(observe(rows, SE2(40.0, 40.0, 0.0), Sensor(20.0), np.random.default_rng(1)).xy, Config()), REACH
    )
    natural, _ = seen(SE2(250.0, 250.0, 0.0), 13)
    for stand, strong in ((planted, True), (natural, False)):
        start = verify(stand, stand, SE2.identity(), REACH)
        # Odds that no lead reaches: every rival is named.
        best, rivals = hill_climb(stand, stand, start, 1e3, Config())
        strongest = max((rival.evidence for rival, _ in rivals), default=0.0)
        assert (strongest > 0.2 * best.evidence) == strong
        place = pose_row(best.transform)
        assert all(distinct(pose_row(rival.transform), place, stand.spacing, REACH) for rival, _ in rivals)


def test_hill_climbing_finds_the_pose_one_planting_distance_away() -> None:
    rows = plantation(80.0, 80.0, np.random.default_rng(2), jitter=0.25, survival=0.9)
    stand = landmark_grid(
        describe(observe(rows, SE2(40.0, 40.0, 0.0), Sensor(20.0), np.random.default_rng(3)).xy, Config()), REACH
    )
    start = verify(stand, stand, SE2(3.0, 0.0, 0.0), REACH)
    best, _ = hill_climb(stand, stand, start, Config().gate, Config())
    assert best.transform.distance(SE2.identity())[0] < 0.1


def test_shift_peaks_are_where_most_trees_fall_on_trees() -> None:
    points = forests.uniform(np.random.default_rng(4)) - 40.0
    peaks = shift_peaks(SE2(7.0, -4.0, 0.0).inverse().apply(points), points, REACH, 3, np.full(2, 40.0), np.zeros(2))
    assert np.abs(peaks[0] - [7.0, -4.0]).max() <= REACH


def test_more_submaps_offer_more_poses_and_fewer_trees_leave_more_of_them() -> None:
    submap, map_T_submap = seen(SE2(250.0, 250.0, 0.0), 14)
    query, map_T_query = seen(SE2(250.0, 250.0, 1.0), 15, sigma=0.1)
    found = verify(query, submap, map_T_submap.inverse() @ map_T_query, REACH)
    one, hundred = (log_odds(found, query, log_volume(count, query)) for count in (1, 100))
    assert one == pytest.approx(hundred + np.log(100.0))
    assert one < found.evidence - 20.0
    few = replace(found, query=found.query[:5], submap=found.submap[:5])
    assert log_odds(few, query, 10.0) > one - found.evidence
    alone = replace(found, query=found.query[:1], submap=found.submap[:1])
    assert log_odds(alone, query, 10.0) == -np.inf


def test_the_pose_left_possible_is_the_one_that_repeated_measurement_shows() -> None:
    """The Occam factor's volume is that of the covariance: (2 pi)^1.5 times the root of its determinant."""
    submap, map_T_submap = seen(SE2(250.0, 250.0, 0.0), 16)
    query, map_T_query = seen(SE2(250.0, 250.0, 1.0), 17, sigma=0.2)
    found = verify(query, submap, map_T_submap.inverse() @ map_T_query, REACH)
    spread = least_squares(query.landmarks[found.query], found.transform, found.noise**2).covariance
    left = 1.5 * np.log(2.0 * np.pi) + 0.5 * np.log(np.linalg.det(spread))
    aligned = CONFIDENCE.alignment * found.overlap
    assert log_odds(found, query, 30.0) == pytest.approx(found.evidence - aligned + left - 30.0)
