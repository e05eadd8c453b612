"""The seam of the store: transactions, and what each of them may do."""

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import create_engine

from server.collections import crud
from server.config.settings import Limits
from server.index.live_indexes import LiveIndexes
from server.observability.metrics import Metrics
from server.queries import lookup, stored_queries
from server.queries.query import PlaceQuery
from server.schemas.collections import CollectionPut
from server.schemas.queries import QueryInput
from server.schemas.submaps import SubmapInput
from server.store.columns import BaseRow
from server.store.records import StandRecord
from server.store.sqlite import expressions
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.store.storage import ReadTransaction, Storage, WriteTransaction
from server.submaps import reader, writes
from tests.server.factories import forest, observed, points

OF_ALL = ("api_keys", "collections", "jobs", "responses")
OF_ONE = ("submaps", "constraints", "map_frames", "segments", "stands", "queries")
NO_WRITER = {"all_segments", "sessions", "features", "candidates"}


@pytest.fixture
def storage(tmp_path: Path) -> Iterator[Storage]:
    database = Database(tmp_path / "storage.db")
    migrations_runner.upgrade(database)
    yield database
    database.dispose()


def create(tx: WriteTransaction, name: str) -> int:
    return tx.collections.create(name, title=None, config={}, fingerprint="f", crs=None, origin=None).key


def methods(repository: object) -> set[str]:
    return {name for name in dir(repository) if not name.startswith("_")}


def test_a_read_transaction_has_no_method_that_writes(storage: Storage) -> None:
    with storage.write() as tx:
        create(tx, "plots")
        plots = tx.collections.get("plots")
        assert plots is not None
    assert {*OF_ALL, *OF_ONE} | NO_WRITER == methods(ReadTransaction) == methods(WriteTransaction)
    with storage.read() as reading, storage.write() as writing:
        pairs = [(getattr(reading, name), getattr(writing, name)) for name in OF_ALL]
        for name in OF_ONE:
            which = plots if name == "map_frames" else plots.key
            pairs.append((getattr(reading, name)(which), getattr(writing, name)(which)))
        for reader, writer in pairs:
            assert issubclass(type(writer), type(reader))
            assert methods(reader) < methods(writer), type(reader)


def test_a_write_transaction_is_stored_whole_or_not_at_all(storage: Storage) -> None:
    def fail() -> None:
        with storage.write() as tx:
            create(tx, "plots")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    with storage.write() as tx:
        create(tx, "kept")
    with storage.read() as reading:
        assert reading.collections.ids() == ["kept"]
        with storage.write() as tx:
            create(tx, "later")
        assert reading.collections.ids() == ["kept"]  # in its read view
    with storage.read() as reading:
        assert reading.collections.ids() == ["kept", "later"]


def test_a_read_transaction_begins_with_whatever_is_read_first(storage: Storage) -> None:
    """Also with a statement that goes to the driver itself."""
    with storage.write() as tx:
        key = create(tx, "plots")
    with storage.read() as reading:
        assert reading.candidates(key).read([1], landmarks=True) == {}
        with storage.write() as tx:
            tx.collections.delete(key)
        assert reading.collections.ids() == ["plots"]


def test_a_stand_keeps_its_key(storage: Storage) -> None:
    with storage.write() as tx:
        key = create(tx, "plots")
        first = tx.stands(key).put(StandRecord("north", "map", "a", "b", 3, 10.0, 5.0, None))
    with storage.write() as tx:
        assert tx.stands(key).put(StandRecord("north", "map", "c", "d", 4, 12.0, 6.0, None)) == first
        assert tx.stands(key).put(StandRecord("south", "map", "c", "d", 4, 12.0, 6.0, None)) != first
    with storage.read() as reading:
        stored = reading.stands(key).get("north")
        assert stored is not None
        assert (stored.key, stored.source_hash, stored.tree_count, stored.radius) == (first, "c", 4, 12.0)
        assert reading.stands(key).get("west") is None


def test_another_process_opens_a_storage_once(storage: Storage) -> None:
    with storage.write() as tx:
        create(tx, "plots")
    sent = pickle.dumps(storage)
    opened = pickle.loads(sent)
    assert opened is pickle.loads(sent)
    assert opened is not storage
    with opened.read() as reading:
        assert reading.collections.ids() == ["plots"]
    opened.dispose()


class PlainStorage:
    """Another storage: SQLAlchemy's own engine, with nothing of what `store.sqlite` does."""

    read_only = False

    def __init__(self, path: Path) -> None:
        self.path = path
        expressions.register()
        self._engine = create_engine(f"sqlite:///{path}")
        BaseRow.metadata.create_all(self._engine)

    @contextmanager
    def read(self) -> Iterator[ReadTransaction]:
        with self._engine.connect() as connection:
            yield ReadTransaction(connection)

    @contextmanager
    def write(self, *, shares: bool = False) -> Iterator[WriteTransaction]:
        with self._engine.begin() as connection:
            yield WriteTransaction(connection)


def test_services_need_no_more_of_a_storage_than_its_protocol(tmp_path: Path) -> None:
    storage, limits, metrics = PlainStorage(tmp_path / "plain.db"), Limits(), Metrics()
    crud.ensure(storage, "plots", CollectionPut())
    for seed in range(3):
        body = SubmapInput.model_validate({"xy": points(forest(seed)), "session": "monday"})
        writes.put(storage, "plots", f"p{seed}", body, limits)
    writes.delete(storage, "plots", "p2")
    assert reader.read(storage, "plots", "p0").session == "monday"
    context = lookup.QueryContext(storage, LiveIndexes(storage, metrics), metrics, limits)
    query = PlaceQuery.of(QueryInput.model_validate({"xy": observed(forest(1), 2)[0], "store": True}), limits)
    answer = lookup.answer_query(context, "plots", query)
    assert [(one.submap_id, one.session) for one in answer.candidates] == [("p1", "monday")]
    assert b'"verdict":"matched"' in stored_queries.stored_answer(storage, "plots", answer.id or "")
