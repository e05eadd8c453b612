"""Segments merged: small ones into larger ones, and those with much that is gone into what lives of them.

A search goes through every segment, so there are to be few; a merge writes all that it merges, so there are to be few
of these, too. Sizes that grow by a factor from each segment to the one before it keep both to the logarithm.
"""

from collections.abc import Sequence
from typing import Final

from server.index.flushing import FlushContext, register, write
from server.index.live_index import IndexVersion, UnusableSegment
from server.store.repositories.segments import SegmentRecord
from urquhart.index.collection_index import LiveSegment
from urquhart.index.quad_table import MOST_SLOTS
from urquhart.index.segment_file import SegmentDamaged

FANOUT: Final = 4
"""A segment is merged with the next one while it is less than so many times as large."""
_DEAD: Final = 0.25
"""Share of a segment that may be gone."""


def plan(living: Sequence[int], sizes: Sequence[int]) -> list[range]:
    """Runs of segments that are to be merged into one each, or rewritten without what is gone.

    Args:
        living, sizes: submaps that live, and that lie, in each segment, the oldest first.
    """
    runs: list[tuple[range, int]] = []
    for i, count in enumerate(living):
        runs.append((range(i, i + 1), count))
        while len(runs) > 1 and runs[-2][1] < FANOUT * runs[-1][1] and runs[-2][1] + runs[-1][1] < MOST_SLOTS:
            (last, more), (before, fewer) = runs.pop(), runs.pop()
            runs.append((range(before.start, last.stop), fewer + more))
    return [run for run, _ in runs if len(run) > 1 or sizes[run[0]] - living[run[0]] > _DEAD * sizes[run[0]]]


def due(state: IndexVersion) -> list[range]:
    """What is to be merged of an index."""
    return plan([part.living for part in state.files], [len(part.segment) for part in state.files])


def merge(flush_context: FlushContext, collection_key: int, state: IndexVersion, run: range) -> bool:
    """Merge a run of a state's segments and list the result in their place; whether that was done.

    Not where another process merges. What is read is checked first: a sum over what is damaged would make it sound.

    Raises:
        Unusable: a segment is not what was written.
        OSError, StorageError, Stopped.
    """
    with flush_context.folder.lock("merge") as held:
        if not held:
            return False
        parts, old = [state.files[i] for i in run], [state.chain[i] for i in run]
        stamps = [_stamp(part) for part in parts]
        for part, listed in zip(parts, old, strict=True):
            _check(part, listed)
            flush_context.check()
        revision = old[-1].revision
        if run.stop == len(state.chain) and not state.delta:
            # Nothing changed since: it holds everything up to now, and what was deleted until now can be forgotten.
            revision = state.revision
        new = write(flush_context, collection_key, parts, old[0].since, revision)
        if stamps != [_stamp(part) for part in parts]:
            # Somebody wrote to what was being read, after it was checked.
            flush_context.folder.remove([new.name])
            raise UnusableSegment(old[0], SegmentDamaged("its file changed during the merge"))
        if not register(flush_context, collection_key, old, [new]):
            return False
        flush_context.folder.remove(segment.name for segment in old)
    return True


def _stamp(part: LiveSegment) -> tuple[int, int, int] | None:
    return None if part.segment.file is None else part.segment.file.stamp_now()


def _check(part: LiveSegment, listed: SegmentRecord) -> None:
    try:
        if part.segment.file is not None:
            part.segment.file.check()
    except SegmentDamaged as error:
        raise UnusableSegment(listed, error) from error
