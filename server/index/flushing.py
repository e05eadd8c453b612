"""Write what changed since the last segment to new segments: from the rows, or from the memory of a live index.

A file is complete and on the disk before a row lists it, and is removed if that fails. A process that ends in between
leaves an unlisted file, which is removed later.
"""

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from server.index.index_folder import IndexFolder, is_of
from server.index.live_index import IndexVersion
from server.index.row_decoding import config_of, features_of
from server.store.records import CollectionRecord, SegmentRecord, trusted
from server.store.storage import ReadTransaction, Storage
from urquhart import Config
from urquhart.index.collection_index import LiveSegment
from urquhart.index.segment import Segment, merge_segments

_BATCH: Final = 500
"""Submaps whose features are in memory at the same time."""
_log = logging.getLogger(__name__)

Progress = Callable[[int], Any]
"""Called with the number of submaps that were written."""


class Stopped(Exception):
    """The work was stopped because the process is stopping."""


@dataclass(frozen=True, slots=True)
class FlushContext:
    """What is needed to write segments.

    Attributes:
        database, folder: where they are listed, and where they lie.
        block: submaps of a segment made of rows; more where a single revision has more.
        stopping: asked now and then whether to give up.
    """

    database: Storage
    folder: IndexFolder
    block: int = 20_000
    stopping: Callable[[], bool] = lambda: False

    def check(self) -> None:
        """Raise Stopped if the process is stopping."""
        if self.stopping():
            raise Stopped


def flush(
    flush_context: FlushContext,
    collection_id: str,
    *,
    least: int = 1,
    wait: bool = True,
    progress: Progress | None = None,
) -> int:
    """Write the submaps that are in no segment, from their rows, block by block. Returns their number.

    Each block is listed by itself, so what is done stays done, and others get their turn in between. Submaps stored in
    the meantime are not included.

    Args:
        least: fewer than so many are left as they are.
        wait: for another process that writes; what it writes is not written again.

    Raises:
        OSError, StorageError: as far as it came, it is listed.
        Stopped: likewise.
    """
    written = 0
    while count_uncovered(flush_context.database, collection_id, least) >= least:
        with flush_context.folder.lock("flush", wait=lambda: wait and not flush_context.stopping()) as held:
            if not held:
                break
            # Another process may have done it while this one waited.
            if count_uncovered(flush_context.database, collection_id, least) < least:
                break
            block, is_last = _write_block(flush_context, collection_id)
        if progress is not None:
            progress(block)
        written += block
        if is_last or not block:  # none: the list has changed in the meantime
            break
        time.sleep(0.02)  # gives way to those that wait for the lock, which they poll
    return written


def flush_state(flush_context: FlushContext, collection_key: int, state: IndexVersion) -> int:
    """Write the submaps in the memory of a live index to a segment. Returns their number.

    Raises OSError, StorageError, Stopped.
    """
    with flush_context.folder.lock("flush") as held:
        if not held or state.opened < len(state.chain) or not any(part.living for part in state.delta):
            return 0
        listed = write(flush_context, collection_key, state.delta, state.covered, state.revision)
        return listed.submaps if register(flush_context, collection_key, (), [listed]) else 0


def rebuild(flush_context: FlushContext, collection_id: str, *, progress: Progress | None = None) -> int:
    """Write all submaps of a collection to new segments, and replace all its segments by these. Returns their number.

    Nothing is written if the collection is deleted in the meantime. Raises OSError, StorageError, Stopped.
    """
    made: list[SegmentRecord] = []
    key: int | None = None
    with (
        flush_context.folder.lock("flush", wait=lambda: not flush_context.stopping()),
        flush_context.folder.lock("merge", wait=lambda: not flush_context.stopping()),
    ):
        try:
            while True:
                flush_context.check()  # if set, the locks may not be held
                with flush_context.database.read() as tx:
                    collection = tx.collections.get(collection_id)
                    if collection is None or collection.key != (key := key or collection.key):
                        flush_context.folder.remove(segment.name for segment in made)
                        return 0
                    since = made[-1].revision if made else 0
                    parts, end = _read_block(flush_context, tx, collection, since)
                if not parts:
                    break
                made.append(write(flush_context, collection.key, parts, since, end))
                if progress is not None:
                    progress(made[-1].submaps)
                if end == collection.revision:
                    break
        except BaseException:
            flush_context.folder.remove(segment.name for segment in made)
            raise
        listed = register(flush_context, collection.key, None, made)
    flush_context.folder.clean_up(grace=0.0)
    return sum(segment.submaps for segment in made) if listed else 0


def write(
    flush_context: FlushContext, collection_key: int, parts: Sequence[LiveSegment], since: int, revision: int
) -> SegmentRecord:
    """Write the living submaps of segments to a file for the revisions `since` to `revision`. Raises OSError,
    Stopped.
    """
    flush_context.check()
    name, path = flush_context.folder.new_file()
    alive: list[tuple[Segment, NDArray[np.uint8]]] = [(part.segment, part.alive) for part in parts]
    segment = merge_segments(alive, path, **is_of(name, collection_key, since, revision))
    return SegmentRecord(name, since, revision, len(segment), path.stat().st_size)


def register(
    flush_context: FlushContext, collection_key: int, old: Sequence[SegmentRecord] | None, new: Sequence[SegmentRecord]
) -> bool:
    """List segments in place of others (None: of all), if they still fit. Returns whether they do.

    If not, or if it raises StorageError or Stopped, their files are removed.
    """
    listed = False
    try:
        flush_context.check()
        with flush_context.database.write() as tx:
            segments = tx.segments(collection_key)
            done = segments.exchange(segments.chain() if old is None else old, new)
        listed = done
    finally:
        if not listed:
            flush_context.folder.remove(segment.name for segment in new)
    return listed


def count_uncovered(database: Storage, collection_id: str, most: int) -> int:
    """Number of submaps of a collection that are in no segment, counted up to `most`. Raises StorageError."""
    with database.read() as tx:
        collection = tx.collections.get(collection_id)
        if collection is None:
            return 0
        chain = tx.segments(collection.key).chain()
        return tx.features(collection.key).count_changed(_end(chain), most)


def _write_block(flush_context: FlushContext, collection_id: str) -> tuple[int, bool]:
    """Write and list the next block. Returns its number of submaps, and whether it was the last one."""
    with flush_context.database.read() as tx:
        collection = tx.collections.get(collection_id)
        if collection is None:
            return 0, True
        chain = tx.segments(collection.key).chain()
        parts, end = _read_block(flush_context, tx, collection, _end(chain))
    if not parts:
        return 0, True
    listed = write(flush_context, collection.key, parts, _end(chain), end)
    # Segments after a gap are not usable.
    done = register(flush_context, collection.key, chain[trusted(chain) :], [listed])
    return listed.submaps if done else 0, end == collection.revision


def _read_block(
    flush_context: FlushContext, tx: ReadTransaction, collection: CollectionRecord, since: int
) -> tuple[list[LiveSegment], int]:
    """The submaps that changed first after `since`, as segments in memory, and the revision up to which they are
    complete.
    """
    config, parts, count = config_of(collection), list[LiveSegment](), 0
    batch: list[tuple[int, Any]] = []
    last = since
    for row in tx.features(collection.key).changed_since(since, batch=_BATCH):
        if count >= flush_context.block and row.content_revision != last:
            parts.extend(_part(batch, config))
            return parts, last
        batch.append((row.key, features_of(row.features, row.landmarks, row.attributes, config)))
        count, last = count + 1, row.content_revision
        if len(batch) == _BATCH:
            parts.extend(_part(batch, config))
            batch = []
            flush_context.check()
        time.sleep(0)  # lets other threads run: a query must not wait for a whole batch
    parts.extend(_part(batch, config))
    return parts, collection.revision


def _part(batch: list[tuple[int, Any]], config: Config) -> list[LiveSegment]:
    return [LiveSegment.of(Segment.build(batch, config))] if batch else []


def _end(chain: Sequence[SegmentRecord]) -> int:
    good = trusted(chain)
    return chain[good - 1].revision if good else 0
