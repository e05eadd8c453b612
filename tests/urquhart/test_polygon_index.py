"""Polygons in segments: found, merged, dropped, and none of it shaken by damaged arrays."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart import polygon_index
from urquhart.config import Config
from urquhart.features import Features, describe
from urquhart.polygon_index import (
    Hits,
    Partition,
    Searched,
    build_partitions,
    merge_partitions,
    search_partitions,
)
from urquhart.polygon_partition import exact_partition
from urquhart.simulation import paper_forest

D = 11
Rows = NDArray[np.float32]


def random_partition(rng: np.random.Generator, rows: int, slots: int, count: int = 5) -> Partition:
    return exact_partition(
        rng.integers(0, slots, rows).astype(np.int32),
        rng.integers(-9_000, 9_000, (rows, count, 2)).astype(np.int16),
        rng.normal(0.0, 5.0, (rows, D)).astype(np.float32),
    )


def searched(partitions: Iterable[Partition], slots: int, first_key: int = 0) -> Searched:
    return (
        {p.count: p for p in partitions},
        first_key + np.arange(slots, dtype=np.int64),
        np.full(slots, 0.001, np.float32),
        np.ones(slots, np.bool_),
    )


def whole(slots: int) -> NDArray[np.int32]:
    return np.arange(slots, dtype=np.int32)


def find(segments: list[Searched], row: Rows, neighbours: int, count: int = 5) -> Hits:
    [hits] = search_partitions(segments, np.array([count], np.int32), row[None], neighbours=neighbours)
    return hits


def same(one: Partition, other: Partition) -> bool:
    pairs = zip(one.arrays().values(), other.arrays().values(), strict=True)
    return one.count == other.count and all(a.dtype == b.dtype and np.array_equal(a, b) for a, b in pairs)


@pytest.fixture(scope="module")
def real() -> tuple[Partition, Rows]:
    """Pentagons of a forest seen ten times over with some noise, and twice more as queries."""
    rng = np.random.default_rng(0)
    features = describe(paper_forest(rng, 1_100.0), Config())
    pentagons = features.descriptors[features.tessellation.vertex_counts() == 5]
    seen = np.concatenate([pentagons + rng.normal(0.0, 0.6, pentagons.shape) for _ in range(12)]).astype(np.float32)
    stored, queries = np.split(seen, [10 * len(pentagons)])
    owners = np.arange(len(stored), dtype=np.int32) % 1_000
    outlines = rng.integers(-9_000, 9_000, (len(stored), 5, 2)).astype(np.int16)
    return exact_partition(owners, outlines, stored), queries


@pytest.fixture(scope="module")
def inverted(real: tuple[Partition, Rows]) -> Partition:
    return merge_partitions([({5: real[0]}, whole(1_000))], exact_below=1_000)[5]


@pytest.fixture(scope="module")
def submaps() -> list[Features]:
    rng = np.random.default_rng(5)
    few = [describe(rng.uniform(-30.0, 30.0, (n, 2)), Config()) for n in (60, 3, 120, 80, 40)]
    assert len(few[1].tessellation) == 0
    return few


def units(submaps: list[Features]) -> NDArray[np.float32]:
    return np.array([np.abs(f.landmarks).max() / 32_000.0 for f in submaps], np.float32)


def test_a_build_holds_every_polygon_of_every_submap(submaps: list[Features]) -> None:
    partitions, unit = build_partitions(submaps, units(submaps)), units(submaps)
    assert sum(map(len, partitions.values())) == sum(len(f.tessellation) for f in submaps)
    for count, partition in partitions.items():
        assert partition.count == count
        assert not partition.inverted
        at = 0
        for slot, f in enumerate(submaps):
            for i in np.flatnonzero(f.tessellation.vertex_counts() == count).tolist():
                assert partition.owners[at] == slot
                np.testing.assert_array_equal(partition.rows()[at], f.descriptors[i])
                corners = f.landmarks[f.tessellation.polygon(i)]
                np.testing.assert_allclose(partition.outlines[at] * unit[slot], corners, atol=0.6 * float(unit[slot]))
                at += 1
        assert at == len(partition)


def test_outlines_out_of_reach_of_their_unit_are_cut_off_and_bad_units_refused(submaps: list[Features]) -> None:
    partitions = build_partitions(submaps, np.full(len(submaps), 1e-6, np.float32))
    assert {abs(int(x)) for p in partitions.values() for x in p.outlines.ravel()} <= {*range(32_767), 32_767}
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
    outlines = np.concatenate([p.outlines for p in parts.values()])
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
        np.testing.assert_allclose(hits.outlines[mine], 0.001 * outlines[nearest], atol=1e-5)


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


def test_exact_merges_equal_one_build(submaps: list[Features]) -> None:
    unit = units(submaps)
    parts = [
        (build_partitions(submaps[a:b], unit[a:b]), np.arange(a, b, dtype=np.int32))
        for a, b in ((0, 2), (2, 3), (3, 5))
    ]
    merged, built = merge_partitions(parts), build_partitions(submaps, unit)
    assert list(merged) == sorted(built)
    assert all(same(merged[count], built[count]) for count in built)


@pytest.mark.parametrize("listed", [False, True])
def test_a_merge_drops_what_is_gone(real: tuple[Partition, Rows], inverted: Partition, listed: bool) -> None:
    source = inverted if listed else real[0]
    slots = np.where(whole(1_000) % 3 == 0, -1, whole(1_000) // 3).astype(np.int32)
    merged = merge_partitions([({5: source}, slots)], exact_below=1_000 if listed else 10**6)[5]
    kept = slots[source.owners] >= 0
    assert merged.inverted == listed
    np.testing.assert_array_equal(merged.owners, slots[source.owners[kept]])
    np.testing.assert_array_equal(merged.outlines, source.outlines[kept])
    np.testing.assert_array_equal(merged.rows(), source.rows()[kept])
    assert merge_partitions([({5: source}, np.full(1_000, -1, np.int32))]) == {}


def test_lists_find_nearly_all_that_a_full_search_finds(real: tuple[Partition, Rows], inverted: Partition) -> None:
    exact, queries = real
    assert inverted.inverted
    assert len(inverted.centroids) > 60
    counts = np.full(len(queries), 5, np.int32)
    [ours] = search_partitions([searched([inverted], 1_000)], counts, queries, neighbours=48)
    [theirs] = search_partitions([searched([exact], 1_000)], counts, queries, neighbours=48)
    assert len(ours.rows) == len(theirs.rows) == 48 * len(queries)

    def polygons(hits: Hits) -> set[tuple[int, bytes]]:
        return {(row, outline.tobytes()) for row, outline in zip(hits.rows.tolist(), hits.outlines, strict=True)}

    # 0.965 when it was written; what is missed lies next to the last place of all.
    assert len(polygons(ours) & polygons(theirs)) > 0.95 * len(theirs.rows)
    first = theirs.rows * 0 + np.tile(np.arange(48), len(queries)) < 5
    assert len(polygons(ours) & polygons(Hits(5, *(getattr(theirs, n)[first] for n in Hits.__slots__[1:])))) > (
        0.985 * first.sum()
    )


def test_codes_of_one_byte_do_not_matter_at_the_gate(real: tuple[Partition, Rows], inverted: Partition) -> None:
    order_of = {outline.tobytes(): i for i, outline in enumerate(real[0].outlines)}
    before = real[0].rows()[[order_of[outline.tobytes()] for outline in inverted.outlines]]
    off = np.linalg.norm(inverted.rows() - before, axis=1)
    assert off.max() < 0.05 * Config().tau
    assert inverted.nbytes < (4 + 4 * 5 + D + 1) * len(inverted)


def test_merging_again_changes_no_code_and_takes_over_centroids(inverted: Partition) -> None:
    assert same(merge_partitions([({5: inverted}, whole(1_000))], exact_below=1_000)[5], inverted)
    rng = np.random.default_rng(3)
    fresh = inverted.rows()[::3] + rng.normal(0.0, 0.5, inverted.rows()[::3].shape).astype(np.float32)
    fresh[0] = 1e4
    more = exact_partition(np.zeros(len(fresh), np.int32), np.zeros((len(fresh), 5, 2), np.int16), fresh)
    parts = [({5: more}, np.array([1_000], np.int32)), ({5: inverted}, whole(1_000))]
    merged = merge_partitions(parts, exact_below=1_000)[5]
    assert same(merged, merge_partitions(parts, exact_below=1_000)[5])
    np.testing.assert_array_equal(merged.centroids, inverted.centroids)
    old = merged.owners < 1_000
    np.testing.assert_array_equal(merged.rows()[old], inverted.rows())
    # One that no code reaches is cut off; all others are where they were.
    off = np.sort(np.linalg.norm(merged.rows()[~old][:, None] - fresh[None, :300], axis=2).min(axis=0))
    assert off[-1] > 1_000.0
    assert off[-2] < 0.6


def test_centroids_are_trained_anew_once_lists_have_grown_too_long(inverted: Partition) -> None:
    many = [({5: inverted}, whole(1_000)), *(({5: inverted}, whole(1_000)) for _ in range(5))]
    merged = merge_partitions(many, exact_below=1_000)[5]
    assert len(merged) == 6 * len(inverted)
    assert len(merged.centroids) == round(np.sqrt(len(merged)))
    step_by_step = inverted
    for _ in range(5):
        step_by_step = merge_partitions([({5: step_by_step}, whole(1_000)), many[0]], exact_below=1_000)[5]
    assert 0.5 <= len(step_by_step.centroids) / np.sqrt(len(step_by_step)) <= 2.0


def test_a_component_that_never_varies_is_no_trouble() -> None:
    rng = np.random.default_rng(4)
    rows = rng.normal(0.0, 5.0, (2_000, D)).astype(np.float32)
    rows[:, 3], rows[:, 4] = 0.0, 7.5
    plain = exact_partition(np.zeros(2_000, np.int32), np.zeros((2_000, 5, 2), np.int16), rows)
    merged = merge_partitions([({5: plain}, whole(1))], exact_below=100)[5]
    np.testing.assert_allclose(merged.rows()[:, 3:5], [[0.0, 7.5]] * 2_000, atol=1e-4)
    alike = exact_partition(plain.owners, plain.outlines, np.ones((2_000, D), np.float32))
    merged = merge_partitions([({5: alike}, whole(1))], exact_below=100)[5]
    np.testing.assert_allclose(merged.rows(), 1.0, atol=1e-4)


def test_a_search_reads_no_more_rows_than_its_budget(
    real: tuple[Partition, Rows], inverted: Partition, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(polygon_index, "_BUDGET", 37)
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
