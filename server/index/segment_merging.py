"""Merge segments: small ones into larger ones, and those with many deleted submaps into their living ones.

A search visits every segment, so there should be few. A merge rewrites everything it merges, so merges should be few,
too. Segments whose sizes grow by a factor keep both numbers logarithmic.
"""

from collections.abc import Sequence
from typing import Final

from server.index.flushing import FlushContext, register, write
from server.index.live_index import IndexVersion, UnusableSegment
from server.store.records import SegmentRecord
from urquhart.index.collection_index import LiveSegment
from urquhart.index.quad_table import MOST_SLOTS
from urquhart.index.segment_file import SegmentDamaged

FANOUT: Final = 4
"""A segment is merged with the next one if it is less than this many times as large."""
_DEAD: Final = 0.25
"""Share of deleted submaps above which a segment is rewritten."""


def plan(living: Sequence[int], sizes: Sequence[int]) -> list[range]:
    """Runs of segments that should each be merged into one, or rewritten without deleted submaps.

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
    """The runs of an index that should be merged."""
    return plan([part.living for part in state.files], [len(part.segment) for part in state.files])


def merge(flush_context: FlushContext, collection_key: int, state: IndexVersion, run: range) -> bool:
    """Merge a run of segments and list the result in their place. Returns whether that was done.

    It is not done if another process merges. The input is checked first, because a new checksum over damaged data would
    make it look intact.

    Raises:
        UnusableSegment: a segment is not what was written.
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
            # Nothing has changed since, so the result contains everything, and the list of deleted submaps can be
            # shortened.
            revision = state.revision
        new = write(flush_context, collection_key, parts, old[0].since, revision)
        if stamps != [_stamp(part) for part in parts]:
            # Somebody wrote to the input after it was checked.
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
