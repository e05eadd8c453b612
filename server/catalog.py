"""The live index of each collection: derived from the database, caught up before every use.

Every process has its own. The database's revision says what an index has to hold; the rows changed and the deletions
noted since the revision it does hold say what is missing. Nothing here has to be told of a write, so several processes
may write to one database.
"""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from sqlalchemy.orm import Session

from server.derive import config_of, features_of
from server.errors import NotFound
from server.locks import ReadersWriterLock
from server.metrics import Metrics
from server.store.collections import Collections
from server.store.database import Database
from server.store.submaps import StoredFeatures, Submaps
from server.store.tables import CollectionRow
from urquhart import Recognizer

_BATCH = 500
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class View:
    """A collection at one revision: the index and the rows agree for as long as the view is held."""

    session: Session
    collection: CollectionRow
    recognizer: Recognizer
    revision: int


class _LiveIndex:
    def __init__(self, collection: CollectionRow) -> None:
        self.collection_key = collection.key
        self.config = config_of(collection)
        self.lock = ReadersWriterLock()
        self._clear()

    def _clear(self) -> None:
        self.recognizer = Recognizer(self.config)
        self.revision = 0

    def catch_up(self, session: Session, collection: CollectionRow) -> int:
        """Bring the index to the collection's revision in the session's snapshot; how many revisions it was behind.

        The revision moves last: a catch-up that fails half-way is repeated whole, which adds and removes the same.
        """
        if collection.revision < self.revision:
            # The file was put back to an earlier state, by a restored backup: what is held may never have been.
            _log.warning(
                "collection %s went back to revision %d; rebuilding its index", collection.id, collection.revision
            )
            self._clear()
        behind = collection.revision - self.revision
        if behind:
            submaps = Submaps(session, collection.key)
            self.recognizer.remove(submaps.deleted_since(self.revision))
            for batch in _in_batches(submaps.changed_since(self.revision, batch=_BATCH)):
                self.recognizer.add(
                    (row.key, features_of(row.features, row.landmarks, row.attributes, self.config)) for row in batch
                )
            self.revision = collection.revision
        return behind


class Catalog:
    """The live indexes of one process."""

    def __init__(self, database: Database, metrics: Metrics) -> None:
        self._database = database
        self._metrics = metrics
        self._indexes: dict[str, _LiveIndex] = {}
        self._guard = threading.Lock()

    @contextmanager
    def view(self, collection_id: str) -> Iterator[View]:
        """A collection with an index that holds every write committed before the call.

        Raises NotFound. The rows are read in the snapshot that the index was brought to, so that a candidate's
        landmarks cannot be replaced between search and answer.
        """
        live = self._indexes.get(collection_id)
        if live is not None:
            # The snapshot is begun under the lock: no other thread can move the index away from it.
            with live.lock.reading(), self._database.read() as session:
                collection = self._collection(session, collection_id)
                if (collection.key, collection.revision) == (live.collection_key, live.revision):
                    yield View(session, collection, live.recognizer, live.revision)
                    return
        yield from self._caught_up(collection_id)

    def warm_up(self) -> Iterator[tuple[str, int, int]]:
        """Build or catch up every collection's index; yields its id, how many are done and how many there are."""
        with self._database.read() as session:
            ids = Collections(session).ids()
        for done, collection_id in enumerate(ids, start=1):
            try:
                with self.view(collection_id):
                    pass
            except NotFound:
                _log.info("collection %s was deleted during the warm-up", collection_id)
            yield collection_id, done, len(ids)

    def forget(self, collection_id: str) -> None:
        """Drop the index of a collection that is no more."""
        with self._guard:
            known = self._indexes.pop(collection_id, None)
        if known is not None:
            self._metrics.forget_index(collection_id)

    def _caught_up(self, collection_id: str) -> Iterator[View]:
        while True:
            with self._database.read() as session:
                live = self._live(self._collection(session, collection_id))
            with live.lock.writing_then_reading() as held, self._database.read() as session:
                collection = self._collection(session, collection_id)
                if collection.key != live.collection_key:
                    continue  # dropped and made again since the lines above
                lag = live.catch_up(session, collection)
                self._metrics.observe_index(
                    collection_id, revision=live.revision, submaps=len(live.recognizer), lag=lag
                )
                held.downgrade()
                yield View(session, collection, live.recognizer, live.revision)
                return

    def _collection(self, session: Session, collection_id: str) -> CollectionRow:
        collection = Collections(session).get(collection_id)
        if collection is None:
            self.forget(collection_id)
            raise NotFound("collection", collection_id)
        return collection

    def _live(self, collection: CollectionRow) -> _LiveIndex:
        with self._guard:
            live = self._indexes.get(collection.id)
            # A collection dropped and made again has another key, whichever process did it.
            if live is None or live.collection_key != collection.key:
                live = self._indexes[collection.id] = _LiveIndex(collection)
            return live


def _in_batches(rows: Iterator[StoredFeatures]) -> Iterator[list[StoredFeatures]]:
    batch: list[StoredFeatures] = []
    for row in rows:
        batch.append(row)
        if len(batch) == _BATCH:
            yield batch
            batch = []
    if batch:
        yield batch
