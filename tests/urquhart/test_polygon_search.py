"""Polygons in segments: built, found, and none of it shaken by damaged arrays."""

from pathlib import Path

import numpy as np
import pytest

from tests.urquhart.polygons import (
    D,
    Rows,
    drawn,
    find,
    packed,
    random_partition,
    same,
    searched,
    units,
    whole,
)
from urquhart.budget import Abandoned, Budget
from urquhart.features.describe import Features
from urquhart.index import polygon_search
from urquhart.index.polygon_partition import exact_partition
from urquhart.index.polygon_search import (
    Partition,
    PolygonHits,
    build_partitions,
    merge_partitions,
    search_partitions,
)


def test_a_build_holds_every_polygon_of_every_submap(submaps: list[Features]) -> None:
    partitions, unit = build_partitions(submaps, units(submaps)), units(submaps)
    assert sum(map(len, partitions.values())) == sum(len(f.tessellation) for f in submaps)
    for count, partition in partitions.items():
        outlines = drawn(partition, unit)
        assert partition.count == count
        assert not partition.inverted
        at = 0
        for slot, f in enumerate(submaps):
            for i in np.flatnonzero(f.tessellation.vertex_counts() == count).tolist():
                assert partition.owners[at] == slot
                np.testing.assert_array_equal(partition.rows()[at], f.descriptors[i])
                corners = f.landmarks[f.tessellation.polygon(i)]
                # Half of a 252nd of the longest way between two vertices.
                assert (
                    np.abs(outlines[at] - corners).max() <= np.abs(np.diff(corners, axis=0)).max() / 250.0 + unit[slot]
                )
                at += 1
        assert at == len(partition)


@pytest.mark.parametrize("scale", [0.01, 1.0, 20.0, 300.0])
@pytest.mark.parametrize("count", [3, 5, 30])
def test_outlines_come_back_to_a_small_part_of_their_size(scale: float, count: int) -> None:
    """Rounding does not add up from vertex to vertex."""
    rng = np.random.default_rng(count)
    outlines = scale * rng.normal(0.0, 0.3, (40, count, 2)).clip(-1.0, 1.0)
    unit = max(0.01, scale / 16_000.0)
    partition = exact_partition(np.zeros(40, np.int32), packed(outlines, unit), np.zeros((40, D), np.float32))
    off = np.abs(drawn(partition, np.full(1, unit, np.float32)) - outlines).max(axis=(1, 2))
    assert (off <= 1.1 * unit + np.abs(np.diff(outlines, axis=1)).max(axis=(1, 2)) / 250.0).all()


def test_outlines_out_of_reach_of_their_unit_are_cut_off_and_bad_units_refused(submaps: list[Features]) -> None:
    tiny = np.full(len(submaps), 1e-6, np.float32)
    for partition in build_partitions(submaps, tiny).values():
        assert np.abs(drawn(partition, tiny)).max() < 0.034
    assert build_partitions([], np.empty(0, np.float32)) == {}
    for bad in (np.zeros(len(submaps), np.float32), units(submaps)[:-1], np.full(len(submaps), np.nan, np.float32)):
        with pytest.raises(ValueError, match="unit"):
            build_partitions(submaps, bad)


def test_finds_the_true_neighbours_over_all_segments() -> None:
    rng = np.random.default_rng(1)
    parts = {first: random_partition(rng, rows, 50) for first, rows in ((0, 700), (100, 3), (200, 1_300))}
    segments = [searched([p, random_partition(rng, 90, 50, count=6)], 50, first) for first, p in parts.items()]
    segments.insert(1, searched([], 4, 900))
    rows = np.concatenate([p.rows() for p in parts.values()])
    keys = np.concatenate([first + p.owners for first, p in parts.items()])
    outlines = np.concatenate([drawn(p, np.full(50, 0.001, np.float32)) for p in parts.values()])
    queries = rng.normal(0.0, 5.0, (20, D)).astype(np.float32)
    [hits] = search_partitions(segments, np.full(20, 5, np.int32), queries, neighbours=9)
    assert hits.count == 5
    assert hits.rows.tolist() == np.repeat(np.arange(20), 9).tolist()
    for i, query in enumerate(queries):
        distances = ((rows - query) ** 2).sum(axis=1)
        nearest = np.argsort(distances)[:9]
        mine = hits.rows == i
        np.testing.assert_allclose(hits.distances[mine], distances[nearest], rtol=1e-4)
        np.testing.assert_array_equal(hits.keys[mine], keys[nearest])
        np.testing.assert_allclose(hits.outlines[mine], outlines[nearest], atol=1e-5)


def test_a_window_reaches_neighbouring_vertex_counts() -> None:
    rng = np.random.default_rng(2)
    segments = [searched([random_partition(rng, 30, 9, count) for count in range(3, 9)], 9)]
    queries = rng.normal(size=(3, D)).astype(np.float32)
    counts = np.array([5, 8, 40], np.int32)
    hits = list(search_partitions(segments, counts, queries, neighbours=4, window=2))
    assert [h.count for h in hits] == [3, 4, 5, 6, 7, 8]
    assert [sorted(set(h.rows.tolist())) for h in hits] == [[0], [0], [0], [0, 1], [0, 1], [1]]
    assert [h.outlines.shape for h in hits] == [(4 * len(set(h.rows.tolist())), h.count, 2) for h in hits]


@pytest.mark.parametrize("listed", [False, True])
def test_what_is_gone_is_never_found_and_takes_no_places(
    real: tuple[Partition, Rows], inverted: Partition, listed: bool
) -> None:
    partition = inverted if listed else real[0]
    partitions, keys, unit, alive = searched([partition], 1_000)
    every = find([(partitions, keys, unit, alive)], real[1][0], 400)
    alive = alive.copy()
    alive[np.unique(every.keys)[::2]] = False
    left = find([(partitions, keys, unit, alive)], real[1][0], 100)
    assert alive[left.keys].all()
    assert len(left.keys) == 100
    still = alive[every.keys]
    np.testing.assert_array_equal(left.distances, every.distances[still][:100])
    gone = np.zeros(1_000, np.uint8)
    assert list(search_partitions([(partitions, keys, unit, gone)], np.array([5]), real[1][:1], neighbours=9)) == []


def test_lists_find_nearly_all_that_a_full_search_finds(real: tuple[Partition, Rows], inverted: Partition) -> None:
    exact, queries = real[0], real[1][:300]
    assert inverted.inverted
    assert len(inverted.centroids) > 60
    counts = np.full(len(queries), 5, np.int32)
    [ours] = search_partitions([searched([inverted], 1_000)], counts, queries, neighbours=48)
    [theirs] = search_partitions([searched([exact], 1_000)], counts, queries, neighbours=48)
    assert len(ours.rows) == len(theirs.rows) == 48 * len(queries)

    def polygons(hits: PolygonHits) -> set[tuple[int, bytes]]:
        return {(row, outline.tobytes()) for row, outline in zip(hits.rows.tolist(), hits.outlines, strict=True)}

    # 0.991 when it was written: codes are rounded, and what is missed lies next to the last place of all.
    assert len(polygons(ours) & polygons(theirs)) > 0.98 * len(theirs.rows)
    first = np.tile(np.arange(48), len(queries)) < 5
    nearest = PolygonHits(5, theirs.rows[first], theirs.keys[first], theirs.outlines[first], theirs.distances[first])
    assert len(polygons(ours) & polygons(nearest)) > 0.995 * first.sum()


def test_a_search_reads_no_more_rows_than_its_budget(
    real: tuple[Partition, Rows], inverted: Partition, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(polygon_search, "POLYGONS", polygon_search.POLYGONS._replace(most_rows=37))
    assert len(find([searched([inverted], 1_000)], real[1][0], 400).keys) == 37


def test_partitions_survive_a_file_and_refuse_other_arrays(
    tmp_path: Path, real: tuple[Partition, Rows], inverted: Partition
) -> None:
    for name, array in inverted.arrays().items():
        np.save(tmp_path / f"{name}.npy", array)
    mapped = {name: np.load(tmp_path / f"{name}.npy", mmap_mode="c") for name in inverted.arrays()}
    assert same(Partition.of(5, mapped), inverted)
    assert np.shares_memory(Partition.of(5, mapped).descriptors, mapped["descriptors"])
    ours = find([searched([Partition.of(5, mapped)], 1_000)], real[1][0], 9)
    theirs = find([searched([inverted], 1_000)], real[1][0], 9)
    np.testing.assert_array_equal(ours.distances, theirs.distances)
    for name, array in inverted.arrays().items():
        with pytest.raises(ValueError, match=name):
            Partition.of(5, inverted.arrays() | {name: array.astype(np.float64)})
        with pytest.raises(KeyError):
            Partition.of(5, {other: kept for other, kept in inverted.arrays().items() if other != name})
    with pytest.raises(ValueError, match="outlines"):
        Partition.of(6, inverted.arrays())
    with pytest.raises(ValueError, match="lists"):
        Partition.of(5, inverted.arrays() | {"lists": inverted.lists[:-1]})


@pytest.mark.parametrize("seed", range(12))
def test_damaged_arrays_mislead_but_never_crash(real: tuple[Partition, Rows], inverted: Partition, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for source in (real[0], inverted):
        arrays = {name: array.copy() for name, array in source.arrays().items()}
        for name in ("owners", "lists"):
            at = rng.random(len(arrays[name])) < 0.3
            extreme = np.iinfo(arrays[name].dtype)
            arrays[name][at] = rng.choice([-1, 999, 1_000, 10**6, len(source), extreme.min, extreme.max], at.sum())
        for name in ("centroids", "low", "step", *([] if source.inverted else ["descriptors"])):
            flat = arrays[name].reshape(-1)
            at = rng.random(len(flat)) < 0.05
            flat[at] = rng.choice([np.nan, np.inf, -np.inf, 0.0], at.sum())
        damaged = Partition.of(5, arrays)
        parts = [damaged, *merge_partitions([({5: damaged}, whole(1_000))], exact_below=1_000).values()]
        parts += merge_partitions([({5: p}, whole(1_000)) for p in (real[0], damaged)], exact_below=1_000).values()
        for part in parts:
            segment = searched([part], 1_000)
            for hits in search_partitions([segment], np.full(9, 5), real[1][:9], neighbours=20):
                assert ((hits.keys >= 0) & (hits.keys < 1_000)).all()
                assert np.isfinite(hits.distances).all()


def test_nothing_to_search_or_too_little() -> None:
    rng = np.random.default_rng(6)
    query = np.zeros((1, D), np.float32)
    few = searched([random_partition(rng, 3, 2)], 2)
    assert list(search_partitions([], np.array([5]), query, neighbours=3)) == []
    assert list(search_partitions([few], np.empty(0, np.int32), query[:0], neighbours=3)) == []
    assert list(search_partitions([few], np.array([4]), query, neighbours=3)) == []
    assert len(find([few], query[0], 48).keys) == 3
    assert merge_partitions([]) == {}
    assert merge_partitions([({}, whole(3))]) == {}
    with pytest.raises(ValueError, match="components"):
        find([few], query[0, :7], 3)
    with pytest.raises(ValueError, match="marks"):
        find([(few[0], few[1], few[2], np.ones(2, np.int64))], query[0], 3)  # type: ignore[list-item]
    with pytest.raises(ValueError, match="marks"):
        find([(few[0], few[1], few[2], np.ones(5, np.uint8))], query[0], 3)


def test_hits_come_in_portions_where_there_is_much_work(real: tuple[Partition, Rows]) -> None:
    """So that a search can be ended between them; together they are the hits of each row, in order."""
    exact, queries = real
    segments = [searched([exact], 1_000)]
    counts = np.full(len(queries), 5, np.int32)
    portions = list(search_partitions(segments, counts, queries, neighbours=6))
    assert len(portions) > 3
    for hits in portions:
        assert hits.rows.tolist() == sorted(hits.rows.tolist())
    assert np.concatenate([hits.rows for hits in portions]).tolist() == np.repeat(np.arange(len(queries)), 6).tolist()
    last = len(queries) - 1
    [alone] = search_partitions(segments, counts[:1], queries[last:], neighbours=6)
    np.testing.assert_array_equal(portions[-1].keys[-6:], alone.keys)
    np.testing.assert_array_equal(portions[-1].outlines[-6:], alone.outlines)


def test_the_budget_is_asked_where_nothing_is_found_too(real: tuple[Partition, Rows]) -> None:
    """Submaps that are left out are searched like others, and their hits dropped: hours may pass without one."""
    partitions, keys, unit, _ = searched([real[0]], 1_000)
    gone = [(partitions, keys, unit, np.zeros(1_000, np.uint8))]
    abandoned = Budget()
    abandoned.abandon()
    with pytest.raises(Abandoned):
        list(search_partitions(gone, np.array([5]), real[1][:1], neighbours=9, budget=abandoned))
    found = [(partitions, keys, unit, np.ones(1_000, np.uint8))]
    assert list(search_partitions(found, np.array([5]), real[1][:1], neighbours=9, budget=Budget(0.0))) == []
