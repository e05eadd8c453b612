"""The live index: caught up before every use, alone in the process or not, and never ahead of its rows."""

import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from server.checks.database import discrepancies
from server.collections import crud
from server.config.settings import Limits
from server.errors import NotFound
from server.index.live_index import IndexVersion, LiveIndex
from server.index.live_indexes import LiveIndexes
from server.observability.metrics import Metrics
from server.queries import lookup
from server.queries.query import PlaceQuery
from server.schemas.collections import CollectionPut
from server.schemas.queries import QueryAnswer, QueryInput
from server.schemas.submaps import NamedSubmap, SubmapInput
from server.store.records import CollectionRecord
from server.store.repositories.feature_rows import FeatureRows
from server.store.sqlite.database import Database
from server.store.storage import ReadTransaction
from server.store.submap_records import StoredFeatures
from server.submaps import bulk_ingest, writes
from tests.server.factories import forest, points
from tests.server.index import index_helpers

LIMITS = Limits()


class CatalogProcess:
    """What another process would have: its own connections, locks and indexes over the same file."""

    def __init__(self, database: Database) -> None:
        self.database = Database(database.path)
        self.indexes = LiveIndexes(self.database, Metrics())

    def put(self, name: str, seed: int) -> None:
        """Store a forest."""
        writes.put(self.database, "plots", name, SubmapInput.model_validate({"xy": points(forest(seed))}), LIMITS)

    def delete(self, name: str) -> None:
        """Remove it."""
        writes.delete(self.database, "plots", name)

    def ask(self, seed: int) -> QueryAnswer:
        """Query with a forest."""
        query = PlaceQuery.of(QueryInput.model_validate({"xy": points(forest(seed))}), LIMITS)
        return lookup.answer_query(lookup.QueryContext(self.database, self.indexes, Metrics(), LIMITS), "plots", query)

    def found(self, seed: int) -> str | None:
        """The submap that a forest is matched to."""
        answer = self.ask(seed)
        return answer.candidates[0].submap_id if answer.verdict == "matched" else None


@pytest.fixture
def pair(database: Database) -> Iterator[tuple[CatalogProcess, CatalogProcess]]:
    """Two processes' parts over one database with the collection `plots`."""
    crud.ensure(database, "plots", CollectionPut())
    both = CatalogProcess(database), CatalogProcess(database)
    yield both
    for process in both:
        process.database.dispose()


def test_what_one_writes_the_other_finds(pair: tuple[CatalogProcess, CatalogProcess]) -> None:
    one, two = pair
    assert two.found(1) is None
    one.put("a", 1)
    assert two.found(1) == "a"
    one.put("a", 2)
    assert (two.found(1), two.found(2)) == (None, "a")
    two.put("b", 1)
    assert one.found(1) == "b"
    one.delete("b")
    assert two.found(1) is None
    two.put("b", 1)
    assert one.found(1) == "b"
    assert one.ask(1).revision == two.ask(1).revision == 5
    with one.indexes.view("plots") as view:
        assert len(view.recognizer) == 2


def test_a_collection_that_another_process_made_again(pair: tuple[CatalogProcess, CatalogProcess]) -> None:
    one, two = pair
    one.put("a", 1)
    assert two.found(1) == "a"
    crud.delete(one.database, "plots")
    with pytest.raises(NotFound):
        two.ask(1)
    crud.ensure(one.database, "plots", CollectionPut())
    assert two.ask(1).reason == "empty_collection"
    one.put("a", 2)
    assert (two.found(1), two.found(2)) == (None, "a")


def test_only_landmarks_concern_the_index(
    pair: tuple[CatalogProcess, CatalogProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = pair
    one.put("a", 1)
    one.put("b", 2)
    assert two.found(1) == "a"
    streamed: list[int] = []
    changed_since = FeatureRows.changed_since

    def watched(self: FeatureRows, revision: int, *, batch: int) -> Iterator[StoredFeatures]:
        for row in changed_since(self, revision, batch=batch):
            streamed.append(row.key)
            yield row

    monkeypatch.setattr(FeatureRows, "changed_since", watched)
    body = SubmapInput.model_validate({"xy": points(forest(1)), "session": "s", "ids": [f"t{i}" for i in range(60)]})
    assert writes.put(one.database, "plots", "a", body, LIMITS).outcome == "replaced"
    answer = two.ask(1)
    assert streamed == []
    assert (answer.candidates[0].session, answer.candidates[0].inliers[0].submap[0]) == ("s", "t")
    one.put("b", 3)
    assert two.found(3) == "b"
    assert len(streamed) == 1


def put_back_to_the_first(one: CatalogProcess, two: CatalogProcess) -> None:
    """Both know two submaps, and then the file is as it was after the first."""
    one.put("a", 1)
    one.put("b", 2)
    assert two.found(2) == "b"
    with one.database.write_connection() as connection:
        connection.exec_driver_sql("DELETE FROM submaps WHERE id = 'b'")
        connection.exec_driver_sql("UPDATE collections SET revision = 1, submap_count = 1")


def test_a_database_put_back_to_an_earlier_state(pair: tuple[CatalogProcess, CatalogProcess]) -> None:
    one, two = pair
    put_back_to_the_first(one, two)
    assert (two.found(1), two.found(2)) == ("a", None)


def test_damaged_features_are_made_again(
    pair: tuple[CatalogProcess, CatalogProcess], caplog: pytest.LogCaptureFixture
) -> None:
    one, two = pair
    one.put("a", 1)
    one.put("b", 2)
    assert list(discrepancies(one.database)) == []
    with one.database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE submaps SET features = x'00112233' WHERE id = 'a'")
    assert two.found(1) == "a"
    assert "describing the landmarks again" in caplog.text
    (finding,) = discrepancies(one.database)
    assert (finding.where, finding.what.split(":")[0]) == ("plots/a", "the features cannot be unpacked")


def test_a_failed_catch_up_is_repeated_whole(
    pair: tuple[CatalogProcess, CatalogProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = pair
    one.put("a", 1)
    with monkeypatch.context() as patched:
        patched.setattr("server.index.live_index.features_of", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            two.ask(1)
    assert two.found(1) == "a"


def test_readers_and_writers_together(pair: tuple[CatalogProcess, CatalogProcess]) -> None:
    """While others replace the same submap over and over, every answer agrees with some state that was there."""
    one, two = pair
    for i in range(3):
        one.put(f"p{i}", i)
    failures: list[BaseException] = []
    stop = threading.Event()

    def write() -> None:
        round_ = 0
        while not stop.is_set():
            one.put("p0", 10 + round_ % 5)
            one.delete("p2")
            one.put("p2", 2)
            round_ += 1

    def read() -> None:
        last = 0
        for _ in range(15):
            answer = two.ask(1)
            assert answer.verdict == "matched"
            assert answer.candidates[0].submap_id == "p1"
            assert answer.revision >= last
            last = answer.revision
            for seed in (10, 12):
                for candidate in two.ask(seed).candidates:
                    assert candidate.inlier_count <= 60

    def guarded(work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:
            failures.append(error)
            raise

    readers = [threading.Thread(target=guarded, args=(read,)) for _ in range(3)]
    writer = threading.Thread(target=guarded, args=(write,))
    for thread in (*readers, writer):
        thread.start()
    for thread in readers:
        thread.join()
    stop.set()
    writer.join()
    assert failures == []
    assert list(discrepancies(one.database)) == []


def test_every_view_is_of_one_revision(database: Database) -> None:
    """While two threads write, segments are written and merged: each view holds all that was acknowledged before it."""
    crud.ensure(database, "plots", CollectionPut())
    process = index_helpers.Process(database.path)
    acknowledged: list[int] = []
    failures: list[BaseException] = []
    stop = threading.Event()

    def write(first: int) -> None:
        for i in range(first, 240, 2):  # no more: who reads must not be outrun on a busy machine
            if stop.is_set():
                return
            process.put(f"p{i}", i)
            acknowledged.append(i)
            if i % 5 == 0:
                process.put(f"p{i}", 10_000 + i)

    def look_after() -> None:
        while not stop.is_set():
            process.maintenance.run()
            stop.wait(0.01)

    def read() -> None:
        while len(acknowledged) < 50:
            before = list(acknowledged)
            assert process.held() >= {f"p{i}" for i in before}
            if before:
                seen = next((i for i in reversed(before) if i % 5), before[-1])
                assert seen % 5 == 0 or process.found(seen) == f"p{seen}"

    def guarded(work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:
            failures.append(error)
            raise

    readers = [threading.Thread(target=guarded, args=(read,)) for _ in range(3)]
    others = [partial(write, 0), partial(write, 1), look_after]
    workers = [threading.Thread(target=guarded, args=(work,)) for work in others]
    for thread in (*readers, *workers):
        thread.start()
    for thread in readers:
        thread.join()
    stop.set()
    for thread in workers:
        thread.join()
    assert failures == []
    assert process.chain()
    process.agreed()
    process.close()


def test_a_reader_that_is_always_overtaken_gets_its_turn(
    pair: tuple[CatalogProcess, CatalogProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = pair
    one.put("a", 1)
    assert two.found(1) == "a"
    catch_up, overtaken = LiveIndex.catch_up, list[int]()

    def late(self: LiveIndex, tx: ReadTransaction, collection: CollectionRecord, *rest: Any) -> IndexVersion:
        # Another reader is faster, each time that it can be: between this one's read view and its catch-up.
        if not overtaken:
            overtaken.append(1)
            one.put("b", 2)
            assert two.found(2) == "b"
        return catch_up(self, tx, collection, *rest)

    one.put("c", 3)
    monkeypatch.setattr(LiveIndex, "catch_up", late)
    with two.indexes.view("plots") as view:
        assert (view.revision, len(view.recognizer)) == (3, 3)
    assert overtaken


def test_a_reader_that_was_overtaken_has_the_version_of_its_read_view(
    pair: tuple[CatalogProcess, CatalogProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = pair
    one.put("a", 1)
    assert two.found(1) == "a"
    catch_up, calls = LiveIndex.catch_up, list[int]()

    def late(self: LiveIndex, tx: ReadTransaction, collection: CollectionRecord, *rest: Any) -> IndexVersion:
        calls.append(collection.revision)
        if len(calls) == 1:
            one.put("b", 2)
            assert two.found(2) == "b"
        return catch_up(self, tx, collection, *rest)

    monkeypatch.setattr(LiveIndex, "catch_up", late)
    with two.indexes.view("plots") as view:
        assert (view.revision, len(view.recognizer)) == (1, 1)
    assert calls == [1, 2], "the reader did not begin again"
    assert two.found(2) == "b", "and nobody else is set back"


def test_a_database_that_was_put_back_and_written_to(pair: tuple[CatalogProcess, CatalogProcess]) -> None:
    """It comes to the same revision again, but not in the same way."""
    one, two = pair
    put_back_to_the_first(one, two)
    one.put("c", 3)
    assert (two.found(2), two.found(3)) == (None, "c")


def test_warm_up_builds_every_index_but_empty_ones(pair: tuple[CatalogProcess, CatalogProcess]) -> None:
    one, two = pair
    one.put("a", 1)
    crud.ensure(one.database, "never", CollectionPut())
    crud.ensure(one.database, "other", CollectionPut())
    writes.put(one.database, "other", "b", SubmapInput(xy=points(forest(2))), Limits())
    assert list(two.indexes.warm_up()) == [("plots", 1, 2), ("other", 2, 2)]
    assert two.indexes.live("never") is None
    with two.indexes.view("never") as view:
        assert view.recognizer.locate(forest(1)).verdict == "no_match"


def test_ingest_many(database: Database) -> None:
    crud.ensure(database, "plots", CollectionPut())
    process = CatalogProcess(database)

    def submaps(first: int) -> Iterator[NamedSubmap]:
        for i in range(10):
            xy = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]] if i == 4 else points(forest(first + i))
            yield NamedSubmap.model_validate({"id": f"s{i}", "xy": xy})

    batches = list(bulk_ingest.ingest_many(database, "plots", submaps(0), batch_size=4))
    assert [(b.submaps, b.created, len(b.refused)) for b in batches] == [(4, 4, 0), (4, 3, 1), (2, 2, 0)]
    assert (batches[1].refused[0].submap_id, batches[-1].revision) == ("s4", 3)
    assert "line" in str(batches[1].refused[0].error)
    assert process.found(9) == "s9"
    again = list(bulk_ingest.ingest_many(database, "plots", submaps(0)))
    assert [(b.unchanged, b.revision) for b in again] == [(9, 3)]
    moved = list(bulk_ingest.ingest_many(database, "plots", submaps(1)))
    assert moved[0].replaced == 9
    assert process.found(9) == "s8"
    twice = [NamedSubmap.model_validate({"id": "t", "xy": points(forest(seed))}) for seed in (50, 51)]
    (batch,) = bulk_ingest.ingest_many(database, "plots", twice)
    assert (batch.submaps, batch.created, batch.replaced) == (2, 1, 1)
    assert (process.found(50), process.found(51)) == (None, "t")
    assert list(discrepancies(database)) == []
    with pytest.raises(NotFound):
        list(bulk_ingest.ingest_many(database, "nope", submaps(0)))
    process.database.dispose()


def test_findings_tell_what_does_not_agree(database: Database) -> None:
    crud.ensure(database, "plots", CollectionPut())
    process = CatalogProcess(database)
    for i in range(6):
        process.put(f"p{i}", i)
    statements = [
        "UPDATE collections SET submap_count = 7, landmark_count = 1, fingerprint = 'f'",
        "UPDATE submaps SET landmarks = zeroblob(length(landmarks)) WHERE id = 'p0'",
        "UPDATE submaps SET features = (SELECT features FROM submaps WHERE id = 'p2') WHERE id = 'p1'",
        "UPDATE submaps SET revision = 99 WHERE id = 'p3'",
        "INSERT INTO deletions SELECT key, collection_key, 99 FROM submaps WHERE id = 'p4'",
    ]
    with database.write_connection() as connection:
        for statement in statements:
            connection.exec_driver_sql(statement)
    found = {(finding.where, finding.what) for finding in discrepancies(database)}
    wheres = [where for where, _ in found]
    assert sorted(set(wheres)) == ["plots", "plots/p0", "plots/p1", "plots/p3"]
    assert ("plots/p1", "the features are not those of the landmarks") in found
    assert wheres.count("plots") == 5
    with database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE submaps SET landmark_ids = CAST('[\"a\"]' AS BLOB) WHERE id = 'p2'")
    assert ("plots/p2", "ids or attributes are not one for each landmark") in {
        (finding.where, finding.what) for finding in discrepancies(database)
    }
    process.database.dispose()
