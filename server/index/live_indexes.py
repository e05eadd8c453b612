"""The live index of each collection, derived from the database and caught up before every use.

Every process has its own indexes. The database's revision says what an index must contain; the rows changed and deleted
since its own revision say what is missing. No write has to notify an index, so several processes may write to one
database.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Final, TypeVar

from server.config.settings_groups import IndexSettings
from server.errors import DomainError, NotFound, StorageError
from server.index.feature_cache import FeatureCache, FeatureReader
from server.index.flushing import FlushContext, Stopped, flush
from server.index.index_folder import IndexFolder
from server.index.live_index import CatchUpError, IndexVersion, LiveIndex, TooManyChanges, UnusableSegment
from server.observability.metrics import Metrics
from server.store.records import CollectionRecord, SegmentRecord
from server.store.storage import ReadTransaction, Storage
from urquhart import Abandoned, Recognizer
from urquhart.index.collection_index import LiveSegment
from urquhart.index.segment_file import SegmentDamaged

_AGAIN: Final = 60.0
"""Seconds after a failure to write segments before a query tries again."""
_TRIES: Final = 10
"""Times that a search is repeated because yet another segment is damaged."""
_log = logging.getLogger(__name__)
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class View:
    """A collection at one revision. Index and rows agree for as long as the view is held."""

    tx: ReadTransaction
    collection: CollectionRecord
    recognizer: Recognizer
    revision: int


class LiveIndexes:
    """The live indexes of one process."""

    def __init__(self, database: Storage, metrics: Metrics, settings: IndexSettings | None = None) -> None:
        self._database = database
        self._metrics = metrics
        self.settings = settings or IndexSettings()
        self.folder = IndexFolder(database)
        self.stopping = threading.Event()
        self.flush_context = FlushContext(database, self.folder, self.settings.block_submaps, self.stopping.is_set)
        self._cache = FeatureCache(self.settings.cache_mb * 1_000_000)
        self._indexes: dict[str, LiveIndex] = {}
        self._guard = threading.Lock()
        self._not_before = 0.0
        self._sound: dict[str, tuple[int, int, int]] = {}
        """Stamps at which segments that somebody touched were found to be what was written, by name."""
        self._distrusted = 0

    @contextmanager
    def view(self, collection_id: str) -> Iterator[View]:
        """A collection with an index that contains every write committed before the call.

        Rows are read in the read view that the index was caught up to, so nobody can replace a candidate's landmarks
        between search and answer. Readers wait only while another thread catches the index up.

        Raises:
            NotFound, StorageError.
        """
        most: int | None = self._most()
        missed: set[str] = set()
        exclusive = flushed = False
        while True:
            with ExitStack() as stack:
                try:
                    view = self._enter(stack, collection_id, most, exclusive=exclusive)
                except CatchUpError as error:
                    obstacle = error
                else:
                    yield view
                    return
            # Outside of the read view: the next one sees the result.
            exclusive = True
            if isinstance(obstacle, TooManyChanges):
                # Only once: if submaps are stored faster than segments are written, it reads all of them into memory.
                most = self._most() if self._flush(collection_id) and not flushed else None
                flushed = True
            elif isinstance(obstacle, UnusableSegment):
                self._look_into(collection_id, obstacle, missed)

    def whatever_happens(self, collection_id: str, work: Callable[[], Result]) -> Result:
        """Run `work`, which searches a collection, and repeat it if it failed because a segment is damaged.

        Kernels trust their input, so changed bytes in a mapped file can make a search fail in any way. Raises what
        `work` raises on intact segments.
        """
        for _ in range(_TRIES):
            before = self._distrusted
            try:
                return work()
            except (DomainError, Abandoned):
                raise
            except Exception:
                if self._distrusted == before and not self.find_damage(collection_id):
                    raise
                _log.warning("collection %s: a look-up failed on a damaged segment; trying again", collection_id)
        return work()

    def find_damage(self, collection_id: str) -> bool:
        """Check all segments of a collection against their checksums. Returns whether one is damaged; it is no longer
        used.
        """
        live = self._indexes.get(collection_id)
        state = live.state if live is not None else None
        if live is None or state is None:
            return False
        segments = zip(state.chain, state.files, strict=False)
        return not all(self.verify(live, listed, part) for listed, part in segments)

    def verify(self, live: LiveIndex, listed: SegmentRecord, part: LiveSegment) -> bool:
        """Check a mapped segment against its checksums. Returns whether it is intact; a damaged one is no longer
        used.
        """
        try:
            if part.segment.file is not None:
                part.segment.file.check()
        except SegmentDamaged as error:
            self.quarantine(live, UnusableSegment(listed, error))
            return False
        return True

    def warm_up(self) -> Iterator[tuple[str, int, int]]:
        """Open or catch up the index of every collection that is not empty. Yields the id of each, the number done and
        the number of all. An empty one takes no time to open later.
        """
        with self._database.read() as tx:
            ids = [collection_id for _, collection_id, _ in tx.collections.revisions(least=1)]
        for done, collection_id in enumerate(ids, start=1):
            try:
                with self.view(collection_id):
                    pass
            except NotFound:
                _log.info("collection %s was deleted during the warm-up", collection_id)
            yield collection_id, done, len(ids)

    def live(self, collection_id: str) -> LiveIndex | None:
        """The live index of a collection, None if it was never used."""
        return self._indexes.get(collection_id)

    def all_live(self) -> list[LiveIndex]:
        """The live indexes of all collections that were used."""
        with self._guard:
            return list(self._indexes.values())

    def refresh(self, collection_id: str) -> None:
        """Start to use segments that this or another process has written or merged. Raises StorageError."""
        live = self._indexes.get(collection_id)
        if live is None:
            return
        try:
            with self._database.read() as tx:
                collection = tx.collections.get(collection_id)
                if collection is not None and collection.key == live.key:
                    live.refresh(tx, collection)
                    self._observe(live)
        except UnusableSegment as obstacle:
            self._look_into(collection_id, obstacle, set())

    def quarantine(self, live: LiveIndex, obstacle: UnusableSegment) -> None:
        """Stop using a segment that is damaged or missing. Its submaps are read from the rows until it is rebuilt."""
        name, why = obstacle.listed.name, str(obstacle.error)
        self._distrusted += 1
        self._metrics.segments_damaged.inc()
        _log.warning("collection %s: segment %s cannot be used (%s); rebuilding it", live.id, name, why)
        # A segment that cannot be read now may be intact, so it is not rebuilt.
        lost = isinstance(obstacle.error, FileNotFoundError) or not isinstance(obstacle.error, OSError)
        try:
            if not lost or self._database.read_only:
                live.left_out[name] = why
            else:
                with self._database.write() as tx:
                    tx.segments(live.key).drop_from(name)
        except StorageError:
            _log.exception("collection %s: the segment %s cannot be taken off the list", live.id, name)
            live.left_out[name] = why
        live.drop()

    def forget(self, collection_id: str) -> None:
        """Drop the index of a collection that was deleted."""
        with self._guard:
            known = self._indexes.pop(collection_id, None)
        if known is not None:
            known.drop()
            self._metrics.forget_index(collection_id)

    def _enter(self, stack: ExitStack, collection_id: str, most: int | None, *, exclusive: bool) -> View:
        live = self._indexes.get(collection_id)
        if live is None or not exclusive:
            return self._open_view(stack, collection_id, live.state if live is not None else None, most)
        # Other threads wait while the read view is opened, so no later state can overtake this attempt.
        with live.mutex:
            return self._open_view(stack, collection_id, live.state, most)

    def _open_view(self, stack: ExitStack, collection_id: str, seen: IndexVersion | None, most: int | None) -> View:
        tx = stack.enter_context(self._database.read())
        collection = tx.collections.get(collection_id)
        if collection is None:
            self.forget(collection_id)
            raise NotFound("collection", collection_id)
        live = self._live(collection)
        before = live.state
        state = live.catch_up(tx, collection, seen, most)
        if state is not before:
            self._observe(live)
        self._check_touched(state)
        source = FeatureReader(tx, live.key, live.config, self._cache, live.owner, state.revision)
        return View(tx, collection, Recognizer(live.config, state.index, source), state.revision)

    def _check_touched(self, state: IndexVersion) -> None:
        """Check segments whose files were written to, which must not happen, against their checksums. Raises
        UnusableSegment.
        """
        for listed, part in zip(state.chain, state.files, strict=False):
            file = part.segment.file
            if file is None:
                continue
            try:
                stamp = file.stamp_now()
                if stamp not in (file.stamp, self._sound.get(listed.name)):
                    file.check()
                    self._sound[listed.name] = stamp
            except (SegmentDamaged, OSError) as error:
                raise UnusableSegment(listed, error) from error

    def _live(self, collection: CollectionRecord) -> LiveIndex:
        with self._guard:
            live = self._indexes.get(collection.id)
            # A collection that was deleted and created again has another key, whichever process did it.
            if live is None or live.key != collection.key:
                if live is not None:
                    live.drop()
                live = self._indexes[collection.id] = LiveIndex(collection, self.folder, self._cache)
            return live

    def _most(self) -> int | None:
        """Most changed submaps that may be read into memory; None if they cannot be written to segments."""
        can_write = not self._database.read_only and time.monotonic() >= self._not_before
        return self.settings.memory_submaps if can_write else None

    def _flush(self, collection_id: str) -> bool:
        try:
            with self._metrics.maintenance("flush"):
                return flush(self.flush_context, collection_id) > 0
        except (OSError, StorageError, Stopped) as error:
            _log.warning(
                "collection %s: recent changes stay in memory, because they cannot be written to segments: %s",
                collection_id,
                error,
            )
            self._not_before = time.monotonic() + _AGAIN
            return False

    def _look_into(self, collection_id: str, obstacle: UnusableSegment, missed: set[str]) -> None:
        live, name = self._indexes.get(collection_id), obstacle.listed.name
        if isinstance(obstacle.error, FileNotFoundError) and name not in missed:
            missed.add(name)  # it was merged after the read view was opened, as the next one shows
        elif live is not None:
            self.quarantine(live, obstacle)

    def _observe(self, live: LiveIndex) -> None:
        state = live.state
        if state is not None:
            chain = state.chain
            self._metrics.observe_index(live.id, revision=state.revision, submaps=len(state.index))
            self._metrics.observe_segments(live.id, len(chain), sum(segment.size for segment in chain))
