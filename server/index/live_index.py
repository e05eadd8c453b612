"""A `CollectionIndex` kept up to date with the database: mapped segments, and recent changes in memory.

A version of the index never changes. A catch-up builds another one from the rows of a read view and replaces the old
one, so readers of either are not disturbed and wait for nothing.
"""

import itertools
import logging
import threading
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.index.feature_cache import FeatureCache
from server.index.index_folder import IndexFolder
from server.index.row_decoding import config_of, features_of
from server.store.records import CollectionRecord, SegmentRecord, trusted
from server.store.repositories.feature_rows import FeatureRows
from server.store.storage import ReadTransaction
from server.store.submap_records import StoredFeatures
from urquhart import Config, Features
from urquhart.index.collection_index import CollectionIndex, LiveSegment
from urquhart.index.segment import Segment
from urquhart.index.segment_file import SegmentDamaged

_BATCH: Final = 500
_EARLIER: Final = 4
"""Versions that are kept. Without them, a query beside writers often found that a later version had been built since
its read view was opened, and began again: with 32 clients, an answer took 14 ms of processor time where a tenth of the
requests were writes, and 10 ms where none were (`python -m benchmarks.service --only crowd`)."""
_MANY: Final = 10_000
"""Number of changed submaps from which all cached features of the collection are dropped instead of these."""
_owners = itertools.count(1)
_log = logging.getLogger(__name__)


class CatchUpError(Exception):
    """Why an index cannot be caught up to a read view."""


class Superseded(CatchUpError):
    """Another thread has caught up to a later revision: open a new read view."""


class TooManyChanges(CatchUpError):
    """More submaps changed than may be read into memory: write them to segments first."""


class UnusableSegment(CatchUpError):
    """A listed segment cannot be trusted or read: `listed`, and the error."""

    def __init__(self, listed: SegmentRecord, error: Exception) -> None:
        super().__init__(str(error))
        self.listed, self.error = listed, error


@dataclass(frozen=True, slots=True, eq=False)
class IndexVersion:
    """A collection's index at one revision.

    Attributes:
        revision, updated: of the collection. Both, because a database that was put back comes to a revision again.
        chain: the segments that were listed then.
        opened: how many of these, from the first one on, are used; they are the first parts of the index.
        index: what is searched.
    """

    revision: int
    updated: datetime
    chain: tuple[SegmentRecord, ...]
    opened: int
    index: CollectionIndex

    @property
    def files(self) -> tuple[LiveSegment, ...]:
        """The segments that are mapped from files."""
        return self.index.live_segments[: self.opened]

    @property
    def delta(self) -> tuple[LiveSegment, ...]:
        """The submaps in memory: all that changed after `covered`."""
        return self.index.live_segments[self.opened :]

    @property
    def covered(self) -> int:
        """The revision up to which files contain everything."""
        return self.chain[self.opened - 1].revision if self.opened else 0

    def is_of(self, collection: CollectionRecord) -> bool:
        """Whether this is the index of the collection in that row."""
        return self.revision == collection.revision and self.updated == collection.updated


def assemble(segments: Sequence[Segment], gone: NDArray[np.int64]) -> list[LiveSegment]:
    """Segments of a collection, oldest first, with their living submaps.

    Left out are `gone` (K,) int64, the keys of submaps that were deleted or changed after the last segment, and submaps
    that a later segment replaces.
    """
    parts: list[LiveSegment] = []
    for segment in reversed(segments):
        parts.insert(0, LiveSegment.of(segment).without(gone))
        gone = np.concatenate([gone, segment.keys])
    return parts


class LiveIndex:
    """The index of one collection, and its changes from one version to the next."""

    def __init__(self, collection: CollectionRecord, folder: IndexFolder, cache: FeatureCache) -> None:
        """The index of a stored collection. Raises StorageUnavailable if its configuration cannot be used."""
        self.key, self.id = collection.key, collection.id
        self.config: Config = config_of(collection)
        self.owner = next(_owners)
        self.mutex = threading.RLock()
        """Held by the one who makes the next state; never during a search."""
        self.state: IndexVersion | None = None
        self._earlier: tuple[IndexVersion, ...] = ()
        """The versions before `state`, for read views that were opened before it was built."""
        self.left_out: dict[str, str] = {}
        """Segments that this process does without although they are listed, by name, and why."""
        self._folder, self._cache = folder, cache

    def catch_up(
        self, tx: ReadTransaction, collection: CollectionRecord, seen: IndexVersion | None, most: int | None
    ) -> IndexVersion:
        """The index at the revision of the transaction's read view, in which `collection` was read.

        Args:
            seen: the state before the read view was opened.
            most: changed submaps that may be held in memory; None for any number.

        Raises:
            Superseded, TooManyChanges, UnusableSegment: it cannot be had so; the state is as it was.
        """
        state = self.state
        if state is not None and state.is_of(collection):
            return state
        if state is not seen:
            for earlier in self._earlier:
                if earlier.is_of(collection):
                    return earlier
        with self.mutex:
            state = self.state
            if state is not None and state.is_of(collection):
                return state
            if state is not None and state.revision >= collection.revision:
                if state is not seen:
                    raise Superseded
                # The read view was opened after that version was built, so the database was restored from a backup,
                # and what the version contains may never have existed.
                _log.warning("collection %s went back to revision %d", self.id, collection.revision)
                self.drop()
                state = None
            return self._go_on(tx, collection, state, most)

    def refresh(self, tx: ReadTransaction, collection: CollectionRecord) -> None:
        """Use segments that were written, merged or repaired since this version was built.

        Raises UnusableSegment.
        """
        with self.mutex:
            state = self.state
            if state is None or collection.revision < state.revision:
                return  # the next view builds one, or finds out what happened
            chain = tx.segments(self.key).chain()
            more = state.opened < len(chain) and chain[state.opened].name not in self.left_out
            if chain != state.chain or more:
                self._earlier = ()  # segments that were merged are not held open longer than searches need them
                self.state = self._assembled(tx, collection, state, chain, None)

    def drop(self) -> None:
        """Drop the index. The next view rebuilds it."""
        with self.mutex:
            self.state, self._earlier = None, ()
            self._cache.forget(self.owner)

    def _go_on(
        self, tx: ReadTransaction, collection: CollectionRecord, state: IndexVersion | None, most: int | None
    ) -> IndexVersion:
        chain = tx.segments(self.key).chain()
        if state is not None and state.chain == chain and collection.pruned_revision <= state.revision:
            new = self._advanced(tx, collection, state, most)
        else:
            new = self._assembled(tx, collection, state, chain, most)
        if state is not None and new.chain == state.chain:
            self._earlier = (*self._earlier, state)[-_EARLIER:]
        else:
            self._earlier = ()
        self.state = new
        return new

    def _advanced(
        self, tx: ReadTransaction, collection: CollectionRecord, state: IndexVersion, most: int | None
    ) -> IndexVersion:
        described = tx.features(self.key)
        if most is not None and state.opened == len(state.chain):
            room = max(most - sum(part.living for part in state.delta), 0)
            if described.count_changed(state.revision, room + 1) > room:
                raise TooManyChanges
        gone, changed = described.deleted_since(state.revision), list[int]()
        index = state.index.with_changes(removed=gone) if gone else state.index
        for batch in self._batches(described.changed_since(state.revision, batch=_BATCH)):
            index = index.with_changes(batch)
            changed.extend(key for key, _ in batch)
        self._cache.advance(self.owner, collection.revision, gone + changed)
        return IndexVersion(collection.revision, collection.updated, state.chain, state.opened, index)

    def _assembled(
        self,
        tx: ReadTransaction,
        collection: CollectionRecord,
        state: IndexVersion | None,
        chain: tuple[SegmentRecord, ...],
        most: int | None,
    ) -> IndexVersion:
        """A new version from the listed segments and from what `state` has in memory and is still valid."""
        described = tx.features(self.key)
        segments = self._opened(chain, state)
        covered = chain[len(segments) - 1].revision if segments else 0
        # Submaps that must be left out of a segment must not be written again, so they are read into memory.
        if most is not None and len(segments) == len(chain) and described.count_changed(covered, most + 1) > most:
            raise TooManyChanges
        uncovered = described.content_revisions(covered)
        gone = np.array([*uncovered, *(described.deleted_since(0) if segments else ())], np.int64)
        files = assemble(segments, gone)
        held: list[LiveSegment] = []
        if state is not None:
            same = [key for key, changed in uncovered.items() if changed <= state.revision]
            held = [part.only(np.array(same, np.int64)) for part in state.delta]
        index = CollectionIndex(self.config, (*files, *(part for part in held if part.living)))
        for part in held:
            for key in part.segment.keys[part.alive > 0].tolist():
                del uncovered[key]
        for batch in self._batches(described.stored(uncovered)):
            index = index.with_changes(batch)
        self._cache.advance(self.owner, collection.revision, self._touched(described, state))
        return IndexVersion(collection.revision, collection.updated, chain, len(segments), index)

    def _opened(self, chain: tuple[SegmentRecord, ...], state: IndexVersion | None) -> list[Segment]:
        """The segments that can be used, from the first one on. Raises UnusableSegment."""
        mapped = {} if state is None else dict(zip(state.chain, (p.segment for p in state.files), strict=False))
        good, segments = trusted(chain), list[Segment]()
        self.left_out = {name: why for name, why in self.left_out.items() if name in {s.name for s in chain}}
        for i, listed in enumerate(chain):
            if listed.name in self.left_out:
                break
            if i == good:
                raise UnusableSegment(
                    listed, SegmentDamaged(f"it begins at revision {listed.since}, which leaves a gap")
                )
            try:
                segments.append(mapped.get(listed) or self._folder.open(listed, self.key, self.config))
            except (SegmentDamaged, OSError) as error:
                raise UnusableSegment(listed, error) from error
        return segments

    def _touched(self, described: FeatureRows, state: IndexVersion | None) -> Iterable[int] | None:
        if state is None or described.count_changed(state.revision, _MANY + 1) > _MANY:
            return None
        return described.content_revisions(state.revision)

    def _batches(self, rows: Iterator[StoredFeatures]) -> Iterator[list[tuple[int, Features]]]:
        while batch := list(itertools.islice(rows, _BATCH)):
            yield [(row.key, features_of(row.features, row.landmarks, row.attributes, self.config)) for row in batch]
