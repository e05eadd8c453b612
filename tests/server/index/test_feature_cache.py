"""Features kept for the views that come: never those of another revision."""

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import urquhart
from server.collections import crud
from server.index.feature_cache import Entry, FeatureCache, FeatureReader
from server.schemas.collections import CollectionPut
from server.store.sqlite.database import Database
from tests.server.index.index_helpers import Process, trees
from urquhart import Config, Features

CONFIG = Config()
SOME: Features = urquhart.describe(trees(0), CONFIG)


def entry(revision: int, size: int = 100) -> Entry:
    return revision, SOME, size


def test_only_the_present_revision_may_put_something_in() -> None:
    cache = FeatureCache(1000)
    cache.put(1, {5: entry(1)}, 3)
    assert len(cache) == 0  # an owner that is not known
    cache.advance(1, 3, [])
    cache.put(1, {5: entry(1)}, 2)
    assert len(cache) == 0  # a view of before
    cache.put(1, {5: entry(1), 6: entry(3)}, 3)
    assert set(cache.get(1, [5, 6, 7], 3)) == {5, 6}
    assert set(cache.get(1, [5, 6, 7], 2)) == {5}  # a view of before 6 was changed
    assert cache.get(2, [5, 6], 3) == {}
    cache.advance(1, 4, [6, 99])
    assert set(cache.get(1, [5, 6], 4)) == {5}
    assert set(cache.get(1, [5, 6], 3)) == {5}
    cache.put(1, {6: entry(3)}, 3)
    assert set(cache.get(1, [5, 6], 3)) == {5}
    cache.advance(1, 5, None)
    assert (len(cache), cache.nbytes) == (0, 0)
    cache.put(1, {5: entry(1)}, 5)
    cache.forget(1)
    cache.put(1, {5: entry(1)}, 5)
    assert (len(cache), cache.nbytes) == (0, 0)


def test_the_least_lately_used_go_first() -> None:
    cache = FeatureCache(300)
    cache.advance(1, 1, [])
    cache.advance(2, 1, [])
    cache.put(1, {1: entry(1), 2: entry(1)}, 1)
    cache.put(2, {1: entry(1)}, 1)
    cache.get(1, [1], 1)
    cache.put(2, {2: entry(1)}, 1)
    assert (set(cache.get(1, [1, 2], 1)), set(cache.get(2, [1, 2], 1))) == ({1}, {1, 2})
    cache.put(1, {3: entry(1, 1000)}, 1)
    assert (len(cache), cache.nbytes) == (0, 0)
    cache = FeatureCache(0)
    cache.advance(1, 1, [])
    cache.put(1, {1: entry(1)}, 1)
    assert len(cache) == 0


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("write"), st.integers(0, 3)),
            st.tuples(st.just("view"), st.just(0)),
            st.tuples(st.just("read"), st.integers(0, 20)),
        ),
        max_size=60,
    )
)
def test_every_view_reads_what_was_at_its_revision(steps: list[tuple[str, int]]) -> None:
    """Views of any age read through one cache; `history` knows what each key was at each revision."""
    cache, revision = FeatureCache(250), 0
    made = dict.fromkeys(range(4), 0)  # the content revision of each, which stands for its features
    history, views = [dict(made)], [0]
    cache.advance(1, 0, [])
    for what, value in steps:
        if what == "write":
            revision += 1
            made[value] = revision
            history.append(dict(made))
            cache.advance(1, revision, [value])
        elif what == "view":
            views.append(revision)
        else:
            at = views[value % len(views)]
            there = history[at]
            found = cache.get(1, list(there), at)
            for key in found:
                assert cache._entries[1, key][0] == there[key]
            cache.put(1, {key: entry(made_at) for key, made_at in there.items() if key not in found}, at)


def test_readers_of_a_database(database: Database) -> None:
    crud.ensure(database, "plots", CollectionPut())
    process = Process(database.path)
    process.put_many(range(6))
    with process.database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE submaps SET features = x'0011' WHERE id = 'p2'")
        connection.exec_driver_sql("UPDATE submaps SET features = (SELECT zeroblob(length(features))) WHERE id = 'p3'")
    cache = FeatureCache(10**6)
    cache.advance(7, 1, [])
    with process.database.read() as tx:
        reader = FeatureReader(tx, 1, CONFIG, cache, 7, 1)
        first = reader.read([1, 2, 3, 4, 4])
        for key, features in first.items():
            made = urquhart.describe(trees(key - 1), CONFIG)
            assert np.array_equal(features.landmarks, made.landmarks)
            assert np.array_equal(features.tessellation.triangles, made.tessellation.triangles)
        second = reader.read([4, 3, 5])
        assert second[3] is first[3]
        with pytest.raises(KeyError, match="99"):
            reader.read([1, 99])
        assert FeatureReader(tx, 2, CONFIG, FeatureCache(0), 7, 1).read([]) == {}
        with pytest.raises(KeyError):
            FeatureReader(tx, 2, CONFIG, FeatureCache(0), 7, 1).read([1])
    other = Config(samples=12)
    with process.database.read() as tx:
        features = FeatureReader(tx, 1, other, cache, 8, 1).read([1])[1]
    assert features.fingerprint == other.fingerprint()
    process.close()


def test_threads_share_it() -> None:
    cache = FeatureCache(2000)
    cache.advance(1, 0, [])
    failures: list[str] = []

    def work(first: int) -> None:
        rng = np.random.default_rng(first)
        for _ in range(400):
            keys = rng.integers(0, 40, 5).tolist()
            found = cache.get(1, keys, 0)
            cache.put(1, {key: entry(0) for key in keys if key not in found}, 0)
            if cache.nbytes > 2000:
                failures.append(f"{cache.nbytes} bytes")

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    assert cache.nbytes == 100 * len(cache)
