"""The job that stores an uploaded NDJSON file, with one result for each line, whatever interrupts it.

The effect of a batch and the job's progress are one transaction. Its results are written before the commit. If the
commit fails, they lie beyond the length in the job's row: nobody reads them, and the next runner cuts them off.
"""

import logging
import os
import re
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import closing
from io import BufferedReader
from pathlib import Path
from typing import Any, BinaryIO, Final

import orjson

from server.errors import LinesRefused, StorageError, StorageUnavailable, TooLarge
from server.index.flushing import Stopped, flush
from server.jobs.assignment import Assignment, Interrupted, JobContext
from server.jobs.folder import cut
from server.jobs.refusals import Refusals
from server.platform.disk_errors import disk_errors
from server.store.storage import WriteTransaction
from server.submaps import batches, bulk
from server.submaps.batches import BlankLines
from server.submaps.bulk import BatchResult, LineOutcome

_BLANK: Final = re.compile(rb"\s*\n")
_log = logging.getLogger(__name__)


def run_import(assignment: Assignment, context: JobContext) -> None:
    """Store the upload. `parameters`: `on_conflict`, and `mode`: `continue` past refused lines, or `all` lines or none.

    Raises NotFound and Conflict (the collection was deleted or replaced), StorageError, Interrupted, Dismissed.
    """
    with context.database.read() as tx:
        assignment.collection(tx)
    with disk_errors(context.folder.path), context.folder.results(assignment.id).open("a+b") as results:
        context.folder.sync()  # the name of the file, without which its content is lost after a power cut
        cut(results, assignment.progress.get("written", 0))
        source = _InputLines(context.folder.input(assignment.id), assignment, context.settings.limits.body_bytes)
        if assignment.parameters["mode"] == "all":
            _all_or_nothing(assignment, context, source, results)
        else:
            _one_by_one(assignment, context, source, results)
    _write_index(assignment, context)


def _write_index(assignment: Assignment, context: JobContext) -> None:
    """Write the new submaps to segments if there are many, so that the next query need not.

    Everything is stored, whatever happens here: maintenance tries again. Raises Interrupted.
    """
    try:
        with context.metrics.maintenance("flush"):
            flush(
                context.catalog.flush_context, assignment.collection_id, least=context.settings.index.flush_submaps + 1
            )
    except Stopped as error:
        raise Interrupted from error
    except (OSError, StorageError) as error:
        _log.warning("job %s: all lines are stored, but the index is not written yet: %s", assignment.id, error)


class _InputLines:
    """The lines from where the job stands, and the position in the file after a batch of them."""

    def __init__(self, path: Path, assignment: Assignment, longest: int) -> None:
        self._path, self._longest, self._total = path, longest, assignment.total
        self.first: int = assignment.progress.get("line", 0)
        self._offset: int = assignment.progress.get("offset", 0)
        self._ends: deque[tuple[int, int]] = deque()

    def lines(self) -> Iterator[bytes | BlankLines]:
        """Each line as it was sent; blank lines together; of a line that is too long, only enough to show that.

        Raises StorageUnavailable if the upload is missing.
        """
        if self.first == self._total:
            return  # it was read to its end, and only that could not be stored
        if not self._path.exists():
            raise StorageUnavailable(
                "The upload is missing from the folder of jobs. Send the lines again that have no result yet."
            )
        with self._path.open("rb") as file:
            file.seek(self._offset)
            following = self.first
            while True:
                blank = _skip_blank(file)
                if blank:
                    following += blank
                    self._ends.append((following, file.tell()))
                    yield BlankLines(blank)
                line = file.readline(self._longest + 2)
                if not line:
                    return
                if not line.endswith(b"\n"):
                    _skip_line(file)
                following += 1
                self._ends.append((following, file.tell()))
                yield line.rstrip(b"\r\n")

    def after(self, following: int) -> int:
        """Offset in the file after the line before that position."""
        while self._ends and self._ends[0][0] <= following:
            _, self._offset = self._ends.popleft()
        return self._offset


def _skip_blank(file: BufferedReader) -> int:
    """Skip the blank lines that come next, buffer by buffer. Returns their number."""
    count = 0
    while (blank := _BLANK.match(file.peek())) is not None:
        count += file.read(blank.end()).count(b"\n")
    return count


def _skip_line(file: BinaryIO) -> None:
    while (piece := file.readline(1 << 20)) and not piece.endswith(b"\n"):
        pass


def _one_by_one(assignment: Assignment, context: JobContext, source: _InputLines, results: BinaryIO) -> None:
    refusals = Refusals(context.settings.limits.import_refusal_bytes, assignment.progress.get("refusals"))

    def on_written(tx: WriteTransaction, batch: BatchResult) -> None:
        assignment.collection(tx)
        _write_results(results, _refusal_lines(batch.lines, refusals))
        _count(assignment, batch.lines, batch.following)
        assignment.report(
            tx,
            line=batch.following,
            offset=source.after(batch.following),
            written=results.tell(),
            refusals=refusals.state(),
        )

    with batches.describers(context.settings.jobs.processes) as workers:
        ingesting = bulk.ingest_lines(
            context.database,
            assignment.collection_id,
            source.lines(),
            bulk.LineOptions(
                limits=context.settings.limits, workers=workers, first=source.first, careful=assignment.is_suspect
            ),
            on_conflict=assignment.parameters["on_conflict"],
            on_written=on_written,
        )
        with closing(ingesting):
            for batch in ingesting:
                _observe(context, batch)
                assignment.yield_turn()


def _all_or_nothing(assignment: Assignment, context: JobContext, source: _InputLines, results: BinaryIO) -> None:
    if source.first:
        return  # all lines were stored, and only that could not be reported
    # Refused lines may have their results already, and only the end of the job was not stored.
    assignment.done, assignment.counts = 0, {}
    assignment.report(written=0)
    cut(results, 0)
    _check_size(assignment, context)
    found, refused = list[batches.DescribedBatch](), list[LineOutcome]()
    with batches.describers(context.settings.jobs.processes) as workers:
        describing = bulk.describe_lines(
            context.database,
            assignment.collection_id,
            source.lines(),
            bulk.LineOptions(limits=context.settings.limits, workers=workers, careful=assignment.is_suspect),
        )
        with closing(describing):
            for batch in describing:
                found.append(batch)
                refused += [
                    LineOutcome(one.position, one.submap_id, "refused", error=one.error) for one in batch.refused
                ]
                assignment.report()
    if not refused:
        refused = _store_all(assignment, context, found, results)
    if refused:
        at_fault = {line.position for line in refused}
        lines = refused + [
            LineOutcome(position, record.id, "skipped")
            for batch in found
            for position, record in batch.records
            if position not in at_fault
        ]
        lines.sort(key=lambda line: line.position)
        refusals = Refusals(context.settings.limits.import_refusal_bytes)
        _write_results(results, _refusal_lines(lines, refusals))
        _count(assignment, lines, found[-1].following)
        assignment.report(written=results.tell(), refusals=refusals.state())
        raise LinesRefused(
            f"Nothing was stored: {len(refused)} lines were refused, and mode=all stores all lines or none. Correct "
            "them, or use mode=continue."
        )


def _check_size(assignment: Assignment, context: JobContext) -> None:
    """Raise TooLarge if the upload is too large for one transaction, which needs all of it in memory."""
    limits, path = context.settings.limits, context.folder.input(assignment.id)
    for name, allowed, got in (
        ("import_all_lines", limits.import_all_lines, assignment.total or 0),
        ("import_all_bytes", limits.import_all_bytes, path.stat().st_size if path.exists() else 0),
    ):
        if got > allowed:
            raise TooLarge(name, allowed, got, "Send the upload in parts, or with mode=continue.")


class _RolledBack(Exception):
    pass


def _store_all(
    assignment: Assignment, context: JobContext, found: list[batches.DescribedBatch], results: BinaryIO
) -> list[LineOutcome]:
    """Store all lines in one transaction. If one is refused, store nothing and return the refused ones."""
    stored: list[BatchResult] = []
    refused: list[LineOutcome] = []
    try:
        with context.database.write() as tx:
            assignment.collection(tx)
            for batch in found:
                stored.append(bulk.write_in(tx, assignment.collection_id, batch, assignment.parameters["on_conflict"]))
                refused += [line for line in stored[-1].lines if line.outcome == "refused"]
            if refused:
                raise _RolledBack
            lines = [line for batch in stored for line in batch.lines]
            _write_results(results, _refusal_lines(lines, Refusals(0)))
            _count(assignment, lines, found[-1].following if found else 0)
            assignment.report(tx, line=assignment.done, written=results.tell())
    except _RolledBack:
        return refused
    for result in stored:
        _observe(context, result)
    return []


def _write_results(results: BinaryIO, lines: list[bytes]) -> None:
    results.writelines(lines)
    results.flush()
    os.fsync(results.fileno())


def _refusal_lines(lines: list[LineOutcome], refusals: Refusals) -> list[bytes]:
    """The result of each line, apart from refused ones that are only counted."""
    told = (_line_of(line) if line.error is None else refusals.describe(line) for line in lines)
    return [line for line in told if line is not None]


def _line_of(line: LineOutcome) -> bytes:
    told: dict[str, Any] = {"line": line.position + 1}
    if line.id is not None:
        told["id"] = line.id
    told["outcome"] = line.outcome
    if line.revision is not None:
        told["revision"] = line.revision
    return orjson.dumps(told) + b"\n"


def _count(assignment: Assignment, lines: list[LineOutcome], following: int) -> None:
    assignment.done = following
    assignment.counts = dict(sorted((Counter(assignment.counts) + Counter(line.outcome for line in lines)).items()))


def _observe(context: JobContext, batch: BatchResult) -> None:
    for outcome, count in Counter(line.outcome for line in batch.lines).items():
        if outcome in ("created", "replaced", "unchanged"):
            context.metrics.submaps_written.labels(outcome).inc(count)
