import numpy as np
import pytest

from urquhart import SE2, Config, describe
from urquhart.evaluation.simulation import Sensor, observe, paper_forest
from urquhart.paper.matching import assign_edges, keep_one_to_one, match_landmarks, sample_polygons

FOREST = paper_forest(np.random.default_rng(0), side=500.0)


def overlapping(seed: int, sigma: float = 0.0) -> tuple[float, int]:
    """Share of right pairs, and their number, between two observations up to 40 m apart."""
    rng = np.random.default_rng(seed)
    centre = rng.uniform(100.0, 400.0, 2)
    bearing, apart = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 40.0)
    other = centre + apart * np.array([np.cos(bearing), np.sin(bearing)])
    a = observe(FOREST, SE2.shift(centre) @ SE2(0.0, 0.0, 1.3), Sensor(50.0, sigma=sigma), rng)
    b = observe(FOREST, SE2.shift(other) @ SE2(0.0, 0.0, -2.2), Sensor(50.0, sigma=sigma), rng)
    first, second = match_landmarks(describe(a.xy, Config()), describe(b.xy, Config()), Config(), rng)
    assert len(set(first.tolist())) == len(first)
    assert len(set(second.tolist())) == len(second)
    return float((a.trees[first] == b.trees[second]).mean()), len(first)


def test_on_clean_data_the_pairs_are_the_true_trees() -> None:
    shares, counts = zip(*(overlapping(seed) for seed in range(60)), strict=True)
    assert np.average(shares, weights=counts) >= 0.99
    assert np.mean(counts) > 30


def test_with_noise_fewer_pairs_but_still_true_ones() -> None:
    shares, counts = zip(*(overlapping(seed, 0.1) for seed in range(30)), strict=True)
    assert np.average(shares, weights=counts) >= 0.95


@pytest.mark.parametrize("seed", range(20))
def test_edges_are_assigned_by_the_landmark_they_share(seed: int) -> None:
    """Whatever order the corners of a moved triangle are listed in, each goes with itself."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0.0, 10.0, (3, 2))
    order = rng.permutation(3)
    moved = SE2(5.0, -3.0, rng.uniform(0.0, 6.0)).apply(corners)[order]
    mapping = np.empty(3, np.int64)
    one = np.array([[0, 1, 2]], np.int32)
    assign_edges(corners, one[0], moved, one[0], mapping)
    np.testing.assert_array_equal(order[mapping], [0, 1, 2])


def test_sampling_takes_four_to_nine_vertices_then_larger_then_triangles() -> None:
    counts = np.array([3, 12, 5, 9, 3, 4, 20, 7], np.int32)
    rng = np.random.default_rng(0)
    assert set(sample_polygons(counts, 4, rng).tolist()) == {2, 3, 5, 7}
    assert {2, 3, 5, 7} < set(sample_polygons(counts, 5, rng).tolist()) <= {1, 2, 3, 5, 6, 7}
    assert {1, 2, 3, 5, 6, 7} < set(sample_polygons(counts, 7, rng).tolist())
    assert sample_polygons(counts, None, rng).tolist() == list(range(8))
    assert sample_polygons(counts, 99, rng).tolist() == list(range(8))
    some = {tuple(sample_polygons(counts, 2, np.random.default_rng(seed)).tolist()) for seed in range(40)}
    assert len(some) == 6


def test_a_contested_landmark_goes_with_the_most_frequent_claim() -> None:
    claims = np.array([[0, 5], [0, 5], [0, 6], [1, 5], [2, 7], [2, 7], [2, 7], [3, 7]])
    first, second = keep_one_to_one(claims, 4, 8)
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == [(0, 5), (2, 7)]
    empty, _ = keep_one_to_one(np.empty((0, 2), np.int64), 4, 8)
    assert len(empty) == 0


def test_polygons_apart_in_vertex_count_or_shape_do_not_match() -> None:
    rng = np.random.default_rng(1)
    a = describe(observe(FOREST, SE2(150.0, 150.0, 0.0), Sensor(50.0), rng).xy, Config())
    b = describe(observe(FOREST, SE2(380.0, 380.0, 0.0), Sensor(50.0), rng).xy, Config())
    first, _ = match_landmarks(a, b, Config(tau=0.1), rng)
    assert len(first) == 0
