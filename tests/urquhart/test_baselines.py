import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart.forests import all_kinds, pose, uniform
from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, SimulatedObservation, observe, paper_forest
from urquhart.paper.delaunay_triangles import describe_delaunay, match_triangles
from urquhart.paper.glarot import (
    GlarotConfig,
    describe_glare,
    distance_table,
    glarot_distance,
    global_distance,
    keep_mutual,
    local_signatures,
    match_glarot,
    spread_over,
)

CONFIG = GlarotConfig()
SHARP = GlarotConfig(direction_spread=0.0, distance_spread=0.0)
FOREST = paper_forest(np.random.default_rng(0), side=400.0)


def overlapping(seed: int, sigma: float) -> tuple[SimulatedObservation, SimulatedObservation]:
    """Two observations 20 m apart."""
    rng = np.random.default_rng(seed)
    first = pose(rng, 120.0, 280.0)
    second = SE2(first.x + 20.0, first.y, float(rng.uniform(-np.pi, np.pi)))
    return observe(FOREST, first, Sensor(50.0, sigma=sigma), rng), observe(
        FOREST, second, Sensor(50.0, sigma=sigma), rng
    )


# ------------------------------------------------------------------ GLAROT


def test_signatures_count_landmarks_by_direction_and_distance() -> None:
    landmarks = np.array([[0.0, 0.0], [3.5, 0.1], [0.1, 7.3], [-40.0, 0.0]])
    row = local_signatures(landmarks, 8, 50, 30.0, 0.0, 0.0)[0].reshape(8, 50)
    unit = row.max()
    assert np.count_nonzero(row) == 2
    assert row[0, int(3.5 / 0.6)] == unit  # direction of 0 to 45 degrees, ring of 0.6 m
    assert row[1, int(7.3 / 0.6)] == unit  # just short of 90 degrees
    assert row.sum() == 2 * unit  # the fourth is out of reach


@pytest.mark.parametrize("spread", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("offset", [-0.5, -0.2, 0.0, 0.3, 0.5])
def test_a_landmark_counts_once_however_it_is_spread(spread: float, offset: float) -> None:
    weights = np.empty(7)
    spread_over(weights, offset, spread)
    assert weights.sum() == pytest.approx(1.0)
    assert (weights >= 0.0).all()
    assert weights.argmax() == 3 or abs(offset) == 0.5


@pytest.mark.parametrize("seed", range(5))
def test_signatures_do_not_move_with_the_frame_or_the_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    landmarks = uniform(rng)
    plain = describe_glare(landmarks, CONFIG)
    # A turn by whole bins of direction shifts them; GLAROT's distance forgives that altogether.
    move = SE2(50.0, -9.0, 3.0 * np.pi / 4.0)
    order = rng.permutation(len(landmarks))
    moved = describe_glare(move.apply(landmarks)[order], CONFIG)
    table = distance_table(plain.local, moved.local, 8)
    # Rounding in the turn may move a share by a unit.
    own = table[order, np.arange(len(order))]
    assert own.max() <= 0.01 * plain.local.sum(axis=1).max()
    assert (table.argmin(axis=1)[order] == np.arange(len(order))).all()
    assert global_distance(plain, moved, CONFIG) < 0.01


def slow_distance(a: NDArray[np.int32], b: NDArray[np.int32]) -> int:
    """As published: the least L1 distance over the shifts of direction."""
    first, second = a.reshape(8, 50).astype(np.int64), b.reshape(8, 50).astype(np.int64)
    return min(int(np.abs(first - np.roll(second, shift, axis=0)).sum()) for shift in range(8))


@pytest.mark.parametrize("config", [CONFIG, SHARP])
def test_the_table_holds_the_distances_of_the_definition(config: GlarotConfig) -> None:
    rng = np.random.default_rng(0)
    a, b = describe_glare(uniform(rng, 30), config), describe_glare(uniform(rng, 25), config)
    table = distance_table(a.local, b.local, 8)
    assert table.shape == (30, 25)
    assert table.tolist() == [[slow_distance(x, y) for y in b.local] for x in a.local]
    assert glarot_distance(a.local[0], b.local[0], 8) == table[0, 0]
    np.testing.assert_array_equal(distance_table(b.local, a.local, 8), table.T)


def test_alike_is_zero_and_nothing_in_common_is_one() -> None:
    rng = np.random.default_rng(2)
    a = describe_glare(uniform(rng), CONFIG)
    assert global_distance(a, a, CONFIG) == 0.0
    near = describe_glare(np.array([[0.0, 0.0], [2.0, 0.0]]), SHARP)
    far = describe_glare(np.array([[0.0, 0.0], [25.0, 0.0]]), SHARP)
    assert global_distance(near, far, SHARP) == 1.0


def test_landmarks_of_the_same_place_find_themselves() -> None:
    shares, mutual = [], []
    for seed in range(8):
        first, second = overlapping(seed, 0.05)
        a, b = describe_glare(first.xy, CONFIG), describe_glare(second.xy, CONFIG)
        rows, columns = match_glarot(a, b, CONFIG)
        assert rows.tolist() == list(range(len(first.xy)))
        shared = np.isin(first.trees, second.trees)
        shares.append((first.trees[rows] == second.trees[columns])[shared].mean())
        rows, columns = match_glarot(a, b, CONFIG, mutual=True)
        assert len(set(columns.tolist())) == len(columns)
        mutual.append((first.trees[rows] == second.trees[columns]).mean())
    assert np.mean(shares) > 0.7
    assert np.mean(mutual) > np.mean(shares)


def test_mutual_pairs_are_nearest_both_ways() -> None:
    table = np.array([[1, 5, 9], [2, 3, 9], [8, 4, 7]], np.int32)
    rows, columns = keep_mutual(table)
    assert list(zip(rows.tolist(), columns.tolist(), strict=True)) == [(0, 0)]


def test_glarot_of_next_to_nothing() -> None:
    none, one = describe_glare(np.empty((0, 2)), CONFIG), describe_glare(np.zeros((1, 2)), CONFIG)
    some = describe_glare(uniform(np.random.default_rng(0), 5), CONFIG)
    for a, b in ((none, some), (some, none), (none, none)):
        for mutual in (False, True):
            rows, columns = match_glarot(a, b, CONFIG, mutual=mutual)
            assert len(rows) == len(columns) == 0
    assert len(match_glarot(one, some, CONFIG)[0]) == 1
    assert global_distance(none, none, CONFIG) == 0.0


# ------------------------------------------------------- Delaunay triangles


def test_golden_descriptor_of_a_triangle_with_three_neighbours() -> None:
    """A right triangle of 3, 4 and 5 with another on each side."""
    landmarks = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0], [2.0, -2.0], [-2.0, 1.5], [5.0, 4.0]])
    found = describe_delaunay(landmarks)
    assert [sorted(t) for t in found.triangles.tolist()] == [[0, 1, 2]]
    expected = [6.0, 12.0]
    neighbours = []
    for a, b, c in ((0, 1, 3), (0, 2, 4), (1, 2, 5)):
        corners = landmarks[[a, b, c]]
        (ux, uy), (vx, vy) = corners[1] - corners[0], corners[2] - corners[0]
        sides = [float(np.hypot(*(corners[k] - corners[k - 1]))) for k in range(3)]
        neighbours.append((0.5 * abs(ux * vy - uy * vx), sum(sides)))
    expected += [value for pair in sorted(neighbours, reverse=True) for value in pair]
    np.testing.assert_allclose(found.descriptors, [expected])


@pytest.mark.parametrize("seed", range(5))
def test_triangles_do_not_move_with_the_frame_or_the_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    landmarks = uniform(rng)
    order = rng.permutation(len(landmarks))
    plain, moved = describe_delaunay(landmarks), describe_delaunay(SE2(7.0, 80.0, 2.2).apply(landmarks)[order])
    first, second = match_triangles(plain, moved, 1e-9)
    assert len(first) > 40
    np.testing.assert_array_equal(order[second], first)
    by_value = [np.sort(d.descriptors.round(6).view(f"{'f8,' * 7}f8").ravel()) for d in (plain, moved)]
    for a, b in zip(*by_value, strict=True):
        np.testing.assert_allclose(list(a), list(b), atol=2e-6)


def test_right_on_clean_data_and_a_higher_threshold_lets_more_in() -> None:
    clean, noisy = [], []
    for seed in range(8):
        first, second = overlapping(seed, 0.0)
        rows, columns = match_triangles(describe_delaunay(first.xy), describe_delaunay(second.xy), 1e-6)
        clean.append((first.trees[rows] == second.trees[columns]).mean())
        first, second = overlapping(seed, 0.3)
        a, b = describe_delaunay(first.xy), describe_delaunay(second.xy)
        noisy.append([len(match_triangles(a, b, threshold)[0]) for threshold in (5.0, 30.0, 100.0)])
    assert np.mean(clean) > 0.99
    assert (np.diff(noisy, axis=1) >= 0).all()


@pytest.mark.parametrize(("kind", "landmarks"), list(all_kinds(0, 2)))
def test_triangles_have_three_neighbours_and_correspondences_are_one_to_one(
    kind: str, landmarks: NDArray[np.float64]
) -> None:
    found = describe_delaunay(landmarks)
    assert found.descriptors.shape == (len(found.triangles), 8)
    assert np.isfinite(found.descriptors).all()
    first, second = match_triangles(found, found, 1.0)
    assert len(first) == len(set(first.tolist())) == len(set(second.tolist()))


def test_triangles_of_next_to_nothing() -> None:
    some = describe_delaunay(uniform(np.random.default_rng(0), 20))
    for few in (np.empty((0, 2)), np.zeros((1, 2)), np.eye(2), np.column_stack([np.arange(9.0), np.zeros(9)])):
        nothing = describe_delaunay(few)
        assert nothing.descriptors.shape == (0, 8)
        for a, b in ((nothing, some), (some, nothing), (nothing, nothing)):
            rows, columns = match_triangles(a, b, 100.0)
            assert len(rows) == len(columns) == 0
