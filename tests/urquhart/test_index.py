from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart.index import Hits, IndexDamaged, PolygonIndex

D = 11
Batch = tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float32], NDArray[np.float32]]


def batch(rng: np.random.Generator, count: int, keys: NDArray[np.int64]) -> Batch:
    n = len(keys)
    return (
        keys,
        np.arange(n, dtype=np.int32),
        rng.normal(size=(n, count, 2)).astype(np.float32),
        rng.normal(size=(n, D)).astype(np.float32),
    )


def filled(rng: np.random.Generator, exact_below: int = 50_000) -> tuple[PolygonIndex, dict[int, Batch]]:
    index, batches = PolygonIndex(D, exact_below), {}
    for count in range(3, 10):
        batches[count] = batch(rng, count, rng.integers(0, 60, 400))
        index.add(*batches[count])
    return index, batches


def search(index: PolygonIndex, count: int, row: NDArray[np.float32], neighbours: int, window: int = 0) -> list[Hits]:
    return list(index.search(np.array([count], np.int32), row[None], neighbours=neighbours, window=window))


def test_finds_the_true_neighbours_of_the_right_vertex_count() -> None:
    rng = np.random.default_rng(0)
    index, batches = filled(rng)
    for count, (keys, ordinals, outlines, descriptors) in batches.items():
        query = rng.normal(size=D).astype(np.float32)
        [hits] = search(index, count, query, 7)
        distances = ((descriptors - query) ** 2).sum(axis=1)
        nearest = np.argsort(distances)[:7]
        np.testing.assert_allclose(hits.distances, distances[nearest], rtol=1e-4)
        np.testing.assert_array_equal(hits.keys, keys[nearest])
        np.testing.assert_array_equal(hits.ordinals, ordinals[nearest])
        np.testing.assert_array_equal(hits.outlines, outlines[nearest])
        assert hits.count == count


def test_a_window_reaches_neighbouring_vertex_counts() -> None:
    rng = np.random.default_rng(1)
    index, _ = filled(rng)
    hits = search(index, 5, rng.normal(size=D).astype(np.float32), 4, window=2)
    assert [h.count for h in hits] == [3, 4, 5, 6, 7]
    assert search(index, 40, rng.normal(size=D).astype(np.float32), 4, window=2) == []


def test_removed_submaps_are_never_found_and_their_places_are_reused() -> None:
    rng = np.random.default_rng(2)
    index, batches = filled(rng)
    gone = {3, 17, 40}
    expected = sum(int(np.isin(keys, list(gone)).sum()) for keys, *_ in batches.values())
    assert index.remove(gone) == expected
    assert index.remove(gone) == 0
    for count in batches:
        [hits] = search(index, count, rng.normal(size=D).astype(np.float32), 400)
        assert not gone & set(hits.keys.tolist())
    before = len(index.partitions[5].keys)
    fresh = batch(rng, 5, np.full(5, 99, np.int64))
    index.add(*fresh)
    assert len(index.partitions[5].keys) == before
    [hits] = search(index, 5, fresh[3][2], 1)
    assert (hits.keys[0], hits.ordinals[0]) == (99, 2)


@pytest.mark.parametrize("seed", range(4))
def test_any_history_equals_a_fresh_build(seed: int) -> None:
    rng = np.random.default_rng(seed)
    index, alive = PolygonIndex(D, exact_below=150), dict[int, Batch]()
    for key in range(120):
        alive[key] = batch(rng, 5, np.full(int(rng.integers(1, 6)), key, np.int64))
        index.add(*alive[key])
        if rng.random() < 0.4:
            gone = int(rng.choice(list(alive)))
            index.remove({gone})
            del alive[gone]
    fresh = PolygonIndex(D)
    for part in alive.values():
        fresh.add(*part)
    assert len(index) == len(fresh)
    # Every list of the inverted file is read here, so both must agree to the last neighbour.
    index.partitions[5].faiss.nprobe = 10_000
    for _ in range(20):
        query = rng.normal(size=D).astype(np.float32)
        [ours], [theirs] = search(index, 5, query, 10), search(fresh, 5, query, 10)
        np.testing.assert_allclose(ours.distances, theirs.distances, rtol=1e-4)
        assert set(zip(ours.keys.tolist(), ours.ordinals.tolist(), strict=True)) == set(
            zip(theirs.keys.tolist(), theirs.ordinals.tolist(), strict=True)
        )


def test_large_partitions_turn_into_an_inverted_file_and_still_find() -> None:
    rng = np.random.default_rng(3)
    index, exact = PolygonIndex(D, exact_below=4_000), PolygonIndex(D)
    for part in range(6):
        rows = batch(rng, 6, np.arange(part * 1000, part * 1000 + 1000))
        index.add(*rows)
        exact.add(*rows)
    assert exact.partitions[6].exact
    assert not index.partitions[6].exact
    found = wanted = 0
    for _ in range(100):
        query = rng.normal(size=D).astype(np.float32)
        [ours], [theirs] = search(index, 6, query, 10), search(exact, 6, query, 10)
        found += len(set(ours.keys.tolist()) & set(theirs.keys.tolist()))
        wanted += 10
    # Normal rows in eleven dimensions have no clusters at all: the hardest case for an inverted file.
    assert found / wanted > 0.5
    stored = exact.partitions[6].faiss
    for slot in rng.integers(0, 6000, 50).tolist():
        [hits] = search(index, 6, stored.reconstruct(slot), 1)
        assert hits.distances[0] == pytest.approx(0.0, abs=1e-6)
    assert index.remove(set(range(3000))) == 3000
    assert len(index) == 3000


@pytest.mark.parametrize("exact_below", [50_000, 300])
def test_saved_and_loaded_it_answers_alike(tmp_path: Path, exact_below: int) -> None:
    rng = np.random.default_rng(4)
    index, _ = filled(rng, exact_below)
    index.remove({1, 2, 3})
    index.save(tmp_path / "polygons.index")
    loaded = PolygonIndex.load(tmp_path / "polygons.index")
    assert len(loaded) == len(index)
    for count in range(3, 10):
        query = rng.normal(size=D).astype(np.float32)
        [ours], [theirs] = search(index, count, query, 9), search(loaded, count, query, 9)
        for name in ("keys", "ordinals", "outlines", "distances"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert loaded.remove({5}) == index.remove({5}) > 0
    loaded.add(*batch(rng, 4, np.full(900, 77, np.int64)))
    assert list(tmp_path.iterdir()) == [tmp_path / "polygons.index"]


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    index, _ = filled(rng)
    path = tmp_path / "polygons.index"
    index.save(path)
    data = path.read_bytes()
    for position in [0, 9, 41, *rng.integers(0, len(data), 40).tolist()]:
        path.write_bytes(data[:position] + bytes([data[position] ^ 4]) + data[position + 1 :])
        with pytest.raises(IndexDamaged):
            PolygonIndex.load(path)
    for length in (0, 8, 39, 40, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:length])
        with pytest.raises(IndexDamaged):
            PolygonIndex.load(path)


def test_searches_run_on_one_thread() -> None:
    import faiss

    index, _ = filled(np.random.default_rng(6))
    faiss.omp_set_num_threads(2)
    search(index, 5, np.zeros(D, np.float32), 3)
    assert faiss.omp_get_max_threads() == 1
