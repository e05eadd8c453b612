"""Words say what the quads are, and merging tables loses nothing but what is dead."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import DTypeLike, NDArray

from tests.urquhart import forests
from tests.urquhart.tables import Decoded, decode, described, table_of
from urquhart import SE2, Config, Features, describe
from urquhart.index.quad_table import (
    HALF,
    LAST,
    STEPS,
    TURNS,
    QuadTable,
    build_table,
    centre_scale,
    measure_quads,
    merge_tables,
)


def by_hand(landmarks: NDArray[np.float64], quad: list[int]) -> tuple[list[float], float, NDArray[np.float64]]:
    """Lengths, direction in radians and centre of one quad, in the reading that a table keeps."""
    corners = landmarks[quad]
    first, third = np.linalg.norm(corners[1] - corners[0]), np.linalg.norm(corners[3] - corners[2])
    if first < third:
        corners = corners[[2, 3, 0, 1]]
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    diagonal = corners[2] - corners[0]
    lengths = [*sides.tolist(), float(np.linalg.norm(diagonal))]
    return lengths, float(np.arctan2(diagonal[1], diagonal[0])), corners.mean(axis=0)


def off_by(turns: NDArray[np.int64], radians: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far directions in 256ths of a turn are from angles, in 256ths of a turn."""
    apart = turns - radians * TURNS / (2.0 * np.pi)
    return np.asarray(np.abs((apart + TURNS / 2) % TURNS - TURNS / 2))


def in_table_order(features: Features, slot: int, decoded: Decoded) -> list[tuple[int, int]]:
    """Pairs (word, quad) of one submap: words of a slot lie by cell, quads of a cell in their own order."""
    lengths, _, _ = measure_quads(features.landmarks, features.tessellation.quads)
    cells = np.minimum((lengths / STEPS + 0.5).astype(np.int64) // 8, LAST)
    return list(zip(np.flatnonzero(decoded.slots == slot).tolist(), np.lexsort(cells.T[::-1]).tolist(), strict=True))


@pytest.mark.parametrize("make", [forests.uniform, forests.clustered, forests.grid, forests.lattice, forests.avenue])
def test_a_word_says_what_the_quad_is(make: Callable[[np.random.Generator], forests.Points]) -> None:
    submaps = [describe(make(np.random.default_rng(seed)), Config()) for seed in range(4)]
    table = table_of(submaps)
    decoded = decode(table)
    assert len(table) == sum(len(f.tessellation.quads) for f in submaps) > 0
    assert (np.diff(table.codes) > 0).all()
    for slot, features in enumerate(submaps):
        scale = centre_scale(features.landmarks)
        for word, quad in in_table_order(features, slot, decoded):
            lengths, direction, centre = by_hand(features.landmarks, features.tessellation.quads[quad].tolist())
            if abs(lengths[0] - lengths[2]) < 1e-9:
                continue  # either end of the diagonal will do; a test below is about these
            assert (np.abs(decoded.steps[word] * STEPS - lengths) <= 0.5 * np.array(STEPS) + 1e-9).all()
            assert off_by(decoded.turns[[word]], np.array([direction]))[0] <= 0.5 + 1e-9
            assert np.abs(decoded.centres[word] * scale - centre).max() <= 0.5 * scale + 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_neither_the_order_of_landmarks_nor_the_end_a_quad_is_read_from_matters(seed: int) -> None:
    rng = np.random.default_rng(seed)
    xy = forests.uniform(rng, 70, 70.0)
    landmarks = xy - xy.mean(axis=0)
    quads = describe(xy, Config()).tessellation.quads
    scale = centre_scale(landmarks)
    plain = decode(build_table([(landmarks, quads, scale)])).rows()

    order = rng.permutation(len(xy))
    renamed = np.argsort(order).astype(np.int32)[quads]
    assert decode(build_table([(landmarks[order], renamed, scale)])).rows() == plain

    turned = np.where(rng.random(len(quads))[:, None] < 0.5, quads[:, [2, 3, 0, 1]], quads)
    assert (turned != quads).any()
    assert decode(build_table([(landmarks, turned[rng.permutation(len(quads))], scale)])).rows() == plain

    # Described again from another order, the triangles are the same and so are the quads.
    again = decode(table_of([describe(xy[order], Config())]))
    assert sorted(again.steps.tolist()) == sorted(row[5:10] for row in map(list, plain))


@pytest.mark.parametrize("seed", range(6))
def test_a_moved_copy_has_the_same_lengths_and_its_directions_turn_with_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    features, motion = described(seed), forests.pose(rng, -300.0, 300.0)
    quads = features.tessellation.quads
    lengths, directions, centres = measure_quads(features.landmarks, quads)
    moved, turned, shifted = measure_quads(motion.apply(features.landmarks), quads)
    np.testing.assert_allclose(moved, lengths, atol=1e-9)
    np.testing.assert_allclose(shifted, motion.apply(centres), atol=1e-9)
    apart = (turned - directions - motion.yaw / (2.0 * np.pi) + 0.5) % 1.0 - 0.5
    assert np.abs(apart).max() < 1e-9
    assert ((directions >= 0.0) & (directions <= 1.0)).all()
    assert (lengths[:, 0] >= lengths[:, 2]).all()


def test_equal_sides_leave_two_readings_of_which_one_is_kept() -> None:
    """A square is the same from either end: its direction is one of two, opposite to each other."""
    square = np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]])
    for quad in ([0, 1, 2, 3], [2, 3, 0, 1]):
        decoded = decode(build_table([(square, np.array([quad], np.int32), 0.5)]))
        assert decoded.steps.tolist() == [[20, 20, 20, 20, 57]]
        assert decoded.turns[0] in (32, 160)
        assert decoded.centres.tolist() == [[0, 0]]


def test_a_direction_just_below_a_whole_turn_is_none() -> None:
    for angle, turn in ((-1e-4, 0), (1e-4, 0), (np.pi, 128), (-np.pi, 128), (-0.5 * np.pi, 192)):
        corners = SE2(0.0, 0.0, angle).apply(np.array([[-3.0, 0.0], [0.5, -2.0], [3.0, 0.0], [-0.5, 1.0]]))
        decoded = decode(build_table([(corners, np.array([[0, 1, 2, 3]], np.int32), 0.5)]))
        assert decoded.turns.tolist() == [turn]


@pytest.mark.parametrize("size", [300.0, 3_000.0, 1e6, 1e9])
def test_in_a_huge_submap_centres_are_coarser_and_long_sides_are_in_the_last_cell(size: float) -> None:
    rng = np.random.default_rng(5)
    near = rng.uniform(-15.0, 15.0, (8, 2))
    corners = np.concatenate([near, size * np.array([[-1.0, 0.0], [0.1, -1.0], [1.0, 0.0], [-0.1, 0.5]])])
    quads = np.array([[0, 1, 2, 3], [2, 4, 6, 7], [8, 9, 10, 11], [0, 8, 1, 9], [5, 6, 10, 7]], np.int32)
    scale = centre_scale(corners)
    assert scale == size / (HALF - 1) > 0.5
    table = build_table([(corners, quads, scale)])
    decoded = decode(table)
    order = np.lexsort(np.minimum((measure_quads(corners, quads)[0] / STEPS + 0.5) // 8, LAST).T[::-1])
    for word, quad in enumerate(quads[order].tolist()):
        lengths, direction, centre = by_hand(corners, quad)
        short = np.array(lengths) < np.array(LAST) * 8 * STEPS - 0.5 * np.array(STEPS)
        assert (decoded.cells[word] < LAST).tolist() == short.tolist()
        assert (np.abs(decoded.steps[word] * STEPS - lengths) <= 0.5 * np.array(STEPS) + 1e-9)[short].all()
        assert off_by(decoded.turns[[word]], np.array([direction]))[0] <= 0.5 + 1e-6
        assert np.abs(decoded.centres[word] * scale - centre).max() <= 0.5 * scale + 1e-9 * size
    assert table.codes[-1] == (1 << 32) - 1
    assert (decoded.cells < LAST).any()


def test_a_centre_outside_what_a_coordinate_holds_stays_at_its_rim() -> None:
    corners = np.array([[99.0, 500.0], [100.0, 498.0], [101.0, 500.0], [100.0, 501.0]])
    decoded = decode(build_table([(corners, np.array([[0, 1, 2, 3]], np.int32), 0.5)]))
    assert decoded.centres.tolist() == [[127, 127]]
    decoded = decode(build_table([(-corners, np.array([[0, 1, 2, 3]], np.int32), 0.5)]))
    assert decoded.centres.tolist() == [[-128, -128]]


def test_small_submaps_have_steps_of_half_a_metre() -> None:
    assert centre_scale(np.array([[-30.0, 12.0], [63.0, -5.0]])) == 0.5
    assert centre_scale(np.array([[-127.0, 12.0], [3.0, -5.0]])) == 1.0
    assert centre_scale(np.empty((0, 2))) == 0.5


def same(a: QuadTable, b: QuadTable) -> None:
    """Equal but for the order of quads within a cell."""
    for table in (a, b):
        assert (np.diff(table.codes) > 0).all()
        assert len(table.starts) == len(table.codes) + 1
        assert (table.starts[0], table.starts[-1]) == (0, len(table.words))
        assert (np.diff(table.starts.astype(np.int64)) > 0).all()
    np.testing.assert_array_equal(a.codes, b.codes)
    np.testing.assert_array_equal(a.starts, b.starts)
    assert decode(a).rows() == decode(b).rows()


@pytest.mark.parametrize("tables", [1, 2, 5])
def test_merged_tables_are_the_table_of_the_union_without_the_dead(tables: int) -> None:
    rng = np.random.default_rng(tables)
    submaps = [described(seed) for seed in range(20)]
    owner = rng.integers(0, tables, len(submaps))
    alive = rng.random(len(submaps)) < 0.7
    new = rng.permutation(int(alive.sum()))
    place = np.full(len(submaps), -1, np.int32)
    place[alive] = new
    parts = [
        (table_of([f for f, o in zip(submaps, owner, strict=True) if o == t]), place[owner == t]) for t in range(tables)
    ]
    survivors = [submaps[i] for i in np.argsort(np.where(alive, place, 99))[: len(new)]]
    assert 5 < len(survivors) < 20
    before = [(table.codes.copy(), table.starts.copy(), table.words.copy()) for table, _ in parts]
    same(merge_tables(parts), table_of(survivors))
    for (table, _), kept in zip(parts, before, strict=True):
        for array, copy in zip((table.codes, table.starts, table.words), kept, strict=True):
            np.testing.assert_array_equal(array, copy)


def test_merging_merged_tables_is_merging_all_at_once() -> None:
    a, b, c = ([described(seed) for seed in range(s, s + 4)] for s in (0, 10, 20))
    slots = [np.arange(first, first + 4, dtype=np.int32) for first in (0, 4, 8)]
    at_once = merge_tables([(table_of(part), s) for part, s in zip((a, b, c), slots, strict=True)])
    pair = merge_tables([(table_of(a), slots[0]), (table_of(b), slots[1])])
    same(merge_tables([(pair, np.arange(8, dtype=np.int32)), (table_of(c), slots[2])]), at_once)


def test_the_words_are_made_by_whom_the_caller_says() -> None:
    asked: list[tuple[int, np.dtype[np.generic]]] = []
    mine = np.full(10_000, 7, np.uint64)

    def empty(size: int, dtype: DTypeLike) -> NDArray[np.uint64]:
        asked.append((size, np.dtype(dtype)))
        return mine[:size]

    tables = [(table_of([described(seed)]), np.array([seed], np.int32)) for seed in range(3)]
    merged = merge_tables(tables, empty)
    assert asked == [(len(merged), np.dtype(np.uint64))]
    assert np.shares_memory(merged.words, mine)
    same(merged, table_of([described(seed) for seed in range(3)]))


def test_of_nothing_there_is_an_empty_table() -> None:
    bare = describe(np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]]), Config())
    assert len(bare.tessellation.quads) == 0
    full = table_of([described(0)])
    gone = np.array([-1], np.int32)
    for table in (
        build_table([]),
        table_of([bare, bare]),
        merge_tables([]),
        merge_tables([(full, gone)]),
        merge_tables([(table_of([bare]), np.array([3], np.int32)), (full, gone)]),
    ):
        assert len(table) == len(table.codes) == 0
        assert table.starts.tolist() == [0]
    same(merge_tables([(table_of([bare]), gone), (full, np.array([0], np.int32))]), full)


def test_the_last_slot_of_all_fits_into_a_word() -> None:
    last = (1 << 24) - 1
    table = merge_tables([(table_of([described(0)]), np.array([last], np.int32))])
    assert set(decode(table).slots.tolist()) == {last}
    assert decode(table).steps.tolist() == decode(table_of([described(0)])).steps.tolist()
