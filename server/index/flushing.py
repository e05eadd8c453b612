"""What changed since the last segment, written to new ones: from the rows, or from what a live index holds in memory.

A file is complete and on the disk before a row lists it, and is removed where that fails. Whoever is ended in between
leaves a file that nobody lists, which is removed later.
"""

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from sqlalchemy.orm import Session

from server.index.derived import config_of, features_of
from server.index.live_index import IndexVersion
from server.index.segment_folder import SegmentFolder, is_of
from server.store.repositories.collections import Collections
from server.store.repositories.feature_rows import FeatureRows
from server.store.repositories.segments import SegmentRecord, Segments, trusted
from server.store.sqlite.database import Database
from server.store.tables import CollectionRow
from urquhart import Config
from urquhart.index.collection_index import LiveSegment
from urquhart.index.segment import Segment, merge_segments

_BATCH: Final = 500
"""Submaps whose features are in memory at a time."""
_log = logging.getLogger(__name__)

Progress = Callable[[int], Any]
"""Told how many submaps were written."""


class Stopped(Exception):
    """The work was given up because the process is about to end."""


@dataclass(frozen=True, slots=True)
class FlushContext:
    """What is needed to write segments.

    Attributes:
        database, folder: where they are listed, and where they lie.
        block: submaps of a segment made of rows; more where a single revision has more.
        stopping: asked now and then whether to give up.
    """

    database: Database
    folder: SegmentFolder
    block: int = 20_000
    stopping: Callable[[], bool] = lambda: False

    def check(self) -> None:
        """Raise Stopped when it is time to give up."""
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
    """Write the submaps that no segment holds, from their rows, block by block; how many.

    Blocks are listed one by one: what is done stays done, and others get their turn in between. What is stored
    meanwhile is not run after.

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
            # Another may have done it while this one waited.
            if count_uncovered(flush_context.database, collection_id, least) < least:
                break
            block, is_last = _write_block(flush_context, collection_id)
        if progress is not None:
            progress(block)
        written += block
        if is_last or not block:  # none: others changed the list meanwhile
            break
        time.sleep(0.02)  # for those that wait for the lock, which they look at every now and then
    return written


def flush_state(flush_context: FlushContext, collection_key: int, state: IndexVersion) -> int:
    """Write what a live index holds in memory, which is its rows' features laid out already; how many submaps.

    Raises OSError, StorageError, Stopped.
    """
    with flush_context.folder.lock("flush") as held:
        if not held or state.opened < len(state.chain) or not any(part.living for part in state.delta):
            return 0
        listed = write(flush_context, collection_key, state.delta, state.covered, state.revision)
        return listed.submaps if register(flush_context, collection_key, (), [listed]) else 0


def rebuild(flush_context: FlushContext, collection_id: str, *, progress: Progress | None = None) -> int:
    """Write all submaps of a collection to new segments, and list these in the place of all that are; how many.

    None are where the collection is gone, or goes meanwhile. Raises OSError, StorageError, Stopped.
    """
    made: list[SegmentRecord] = []
    key: int | None = None
    with (
        flush_context.folder.lock("flush", wait=lambda: not flush_context.stopping()),
        flush_context.folder.lock("merge", wait=lambda: not flush_context.stopping()),
    ):
        try:
            while True:
                flush_context.check()  # where it is set, the locks may not be held
                with flush_context.database.read() as session:
                    collection = Collections(session).get(collection_id)
                    if collection is None or collection.key != (key := key or collection.key):
                        flush_context.folder.remove(segment.name for segment in made)
                        return 0
                    since = made[-1].revision if made else 0
                    parts, end = _read_block(flush_context, session, collection, since)
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
    """Write what lives of segments to a file that holds `since` to `revision`. Raises OSError, Stopped."""
    flush_context.check()
    name, path = flush_context.folder.new_file()
    alive: list[tuple[Segment, NDArray[np.uint8]]] = [(part.segment, part.alive) for part in parts]
    segment = merge_segments(alive, path, **is_of(name, collection_key, since, revision))
    return SegmentRecord(name, since, revision, len(segment), path.stat().st_size)


def register(
    flush_context: FlushContext, collection_key: int, old: Sequence[SegmentRecord] | None, new: Sequence[SegmentRecord]
) -> bool:
    """List segments in the place of others (None: of all), if they fit there; whether they do.

    Their files are removed where not, and where it raises StorageError or Stopped.
    """
    listed = False
    try:
        flush_context.check()
        with flush_context.database.write() as session:
            segments = Segments(session, collection_key)
            done = segments.exchange(segments.chain() if old is None else old, new)
        listed = done
    finally:
        if not listed:
            flush_context.folder.remove(segment.name for segment in new)
    return listed


def count_uncovered(database: Database, collection_id: str, most: int) -> int:
    """How many submaps of a collection no segment holds, counted up to `most`. Raises StorageError."""
    with database.read() as session:
        collection = Collections(session).get(collection_id)
        if collection is None:
            return 0
        chain = Segments(session, collection.key).chain()
        return FeatureRows(session, collection.key).count_changed(_end(chain), most)


def _write_block(flush_context: FlushContext, collection_id: str) -> tuple[int, bool]:
    """Write and list the next block; how many submaps, and whether that was all there was when it was begun."""
    with flush_context.database.read() as session:
        collection = Collections(session).get(collection_id)
        if collection is None:
            return 0, True
        chain = Segments(session, collection.key).chain()
        parts, end = _read_block(flush_context, session, collection, _end(chain))
    if not parts:
        return 0, True
    listed = write(flush_context, collection.key, parts, _end(chain), end)
    # What stands behind a gap is of no use to anyone.
    done = register(flush_context, collection.key, chain[trusted(chain) :], [listed])
    return listed.submaps if done else 0, end == collection.revision


def _read_block(
    flush_context: FlushContext, session: Session, collection: CollectionRow, since: int
) -> tuple[list[LiveSegment], int]:
    """Segments in memory of the submaps that changed first after `since`, and the revision up to which that is all."""
    config, parts, count = config_of(collection), list[LiveSegment](), 0
    batch: list[tuple[int, Any]] = []
    last = since
    for row in FeatureRows(session, collection.key).changed_since(since, batch=_BATCH):
        if count >= flush_context.block and row.content_revision != last:
            parts.extend(_part(batch, config))
            return parts, last
        batch.append((row.key, features_of(row.features, row.landmarks, row.attributes, config)))
        count, last = count + 1, row.content_revision
        if len(batch) == _BATCH:
            parts.extend(_part(batch, config))
            batch = []
            flush_context.check()
        time.sleep(0)  # lets other threads go first: a query must not wait for a whole batch
    parts.extend(_part(batch, config))
    return parts, collection.revision


def _part(batch: list[tuple[int, Any]], config: Config) -> list[LiveSegment]:
    return [LiveSegment.of(Segment.build(batch, config))] if batch else []


def _end(chain: Sequence[SegmentRecord]) -> int:
    good = trusted(chain)
    return chain[good - 1].revision if good else 0
