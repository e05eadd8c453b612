"""The job that stores an uploaded NDJSON file, with one result for each line, whatever interrupts it.

The effect of a batch and the job's progress are one transaction. Its results are written before the commit. If the
commit fails, they lie beyond the length in the job's row: nobody reads them, and the next runner cuts them off.
"""

import logging
import os
import re
from collections import Counter, deque
from collections.abc import Generator
from contextlib import closing
from io import BufferedReader
from pathlib import Path
from typing import Any, BinaryIO, Final

import orjson

from server.errors import LinesRefused, StorageError, StorageUnavailable, TooLarge
from server.index.flushing import Stopped, flush
from server.jobs.folder import cut
from server.jobs.refused_lines import Refusals
from server.jobs.running_job import Interrupted, JobContext, RunningJob
from server.platform.disk_errors import disk_errors
from server.store.storage import WriteTransaction
from server.submaps import bulk_ingest, described_batches
from server.submaps.bulk_ingest import BatchResult, LineOutcome
from server.submaps.described_batches import BlankLines

_BLANK: Final = re.compile(rb"\s*\n")
_log = logging.getLogger(__name__)


def run_import(job: RunningJob, context: JobContext) -> None:
    """Store the upload. `parameters`: `on_conflict`, and `mode`: `continue` past refused lines, or `all` lines or none.

    Raises NotFound and Conflict (the collection was deleted or replaced), StorageError, Interrupted, Dismissed.
    """
    with context.database.read() as tx:
        job.collection(tx)
    with disk_errors(context.folder.path), context.folder.results(job.id).open("a+b") as results:
        context.folder.sync()  # the name of the file, without which its content is lost after a power cut
        cut(results, job.progress.get("written", 0))
        source = _InputLines(context.folder.input(job.id), job, context.settings.limits.body_bytes)
        if job.parameters["mode"] == "all":
            _all_or_nothing(job, context, source, results)
        else:
            _one_by_one(job, context, source, results)
    _write_index(job, context)


def _write_index(job: RunningJob, context: JobContext) -> None:
    """Write the new submaps to segments if there are many, so that the next query need not.

    Everything is stored, whatever happens here: maintenance tries again. Raises Interrupted.
    """
    try:
        with context.metrics.maintenance("flush"):
            flush(context.indexes.flush_context, job.collection_id, least=context.settings.index.flush_submaps + 1)
    except Stopped as error:
        raise Interrupted from error
    except (OSError, StorageError) as error:
        _log.warning("job %s: all lines are stored, but the index is not written yet: %s", job.id, error)


class _InputLines:
    """The lines from where the job stands, and the position in the file after a batch of them."""

    def __init__(self, path: Path, job: RunningJob, longest: int) -> None:
        self._path, self._longest, self._total = path, longest, job.total
        self.first: int = job.progress.get("line", 0)
        self._offset: int = job.progress.get("offset", 0)
        self._ends: deque[tuple[int, int]] = deque()

    def lines(self) -> Generator[bytes | BlankLines]:
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


def _one_by_one(job: RunningJob, context: JobContext, source: _InputLines, results: BinaryIO) -> None:
    refusals = Refusals(context.settings.limits.import_refusal_bytes, job.progress.get("refusals"))

    def on_written(tx: WriteTransaction, batch: BatchResult) -> None:
        job.collection(tx)
        _write_results(results, _refusal_lines(batch.lines, refusals))
        _count(job, batch.lines, batch.following)
        job.report(
            tx,
            line=batch.following,
            offset=source.after(batch.following),
            written=results.tell(),
            refusals=refusals.state(),
        )

    # Closed here: an error that ends the job may hold the generator, and its open file the space on a full disk.
    with closing(source.lines()) as sent, described_batches.describers(context.settings.jobs.processes) as workers:
        ingesting = bulk_ingest.ingest_lines(
            context.database,
            job.collection_id,
            sent,
            bulk_ingest.LineOptions(
                limits=context.settings.limits, workers=workers, first=source.first, careful=job.is_suspect
            ),
            on_conflict=job.parameters["on_conflict"],
            on_written=on_written,
        )
        with closing(ingesting):
            for batch in ingesting:
                _observe(context, batch)
                job.yield_turn()


def _all_or_nothing(job: RunningJob, context: JobContext, source: _InputLines, results: BinaryIO) -> None:
    if source.first:
        return  # all lines were stored, and only that could not be reported
    # Refused lines may have their results already, and only the end of the job was not stored.
    job.done, job.counts = 0, {}
    job.report(written=0)
    cut(results, 0)
    _check_size(job, context)
    found, refused = list[described_batches.DescribedBatch](), list[LineOutcome]()
    with closing(source.lines()) as sent, described_batches.describers(context.settings.jobs.processes) as workers:
        describing = bulk_ingest.describe_lines(
            context.database,
            job.collection_id,
            sent,
            bulk_ingest.LineOptions(limits=context.settings.limits, workers=workers, careful=job.is_suspect),
        )
        with closing(describing):
            for batch in describing:
                found.append(batch)
                refused += [
                    LineOutcome(one.position, one.submap_id, "refused", error=one.error) for one in batch.refused
                ]
                job.report()
    if not refused:
        refused = _store_all(job, context, found, results)
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
        _count(job, lines, found[-1].following)
        job.report(written=results.tell(), refusals=refusals.state())
        raise LinesRefused(
            f"Nothing was stored: {len(refused)} lines were refused, and mode=all stores all lines or none. Correct "
            "them, or use mode=continue."
        )


def _check_size(job: RunningJob, context: JobContext) -> None:
    """Raise TooLarge if the upload is too large for one transaction, which needs all of it in memory."""
    limits, path = context.settings.limits, context.folder.input(job.id)
    for name, allowed, got in (
        ("import_all_lines", limits.import_all_lines, job.total or 0),
        ("import_all_bytes", limits.import_all_bytes, path.stat().st_size if path.exists() else 0),
    ):
        if got > allowed:
            raise TooLarge(name, allowed, got, "Send the upload in parts, or with mode=continue.")


class _RolledBack(Exception):
    pass


def _store_all(
    job: RunningJob, context: JobContext, found: list[described_batches.DescribedBatch], results: BinaryIO
) -> list[LineOutcome]:
    """Store all lines in one transaction. If one is refused, store nothing and return the refused ones."""
    stored: list[BatchResult] = []
    refused: list[LineOutcome] = []
    try:
        with context.database.write() as tx:
            job.collection(tx)
            for batch in found:
                stored.append(bulk_ingest.write_in(tx, job.collection_id, batch, job.parameters["on_conflict"]))
                refused += [line for line in stored[-1].lines if line.outcome == "refused"]
            if refused:
                raise _RolledBack
            lines = [line for batch in stored for line in batch.lines]
            _write_results(results, _refusal_lines(lines, Refusals(0)))
            _count(job, lines, found[-1].following if found else 0)
            job.report(tx, line=job.done, written=results.tell())
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


def _count(job: RunningJob, lines: list[LineOutcome], following: int) -> None:
    job.done = following
    job.counts = dict(sorted((Counter(job.counts) + Counter(line.outcome for line in lines)).items()))


def _observe(context: JobContext, batch: BatchResult) -> None:
    for outcome, count in Counter(line.outcome for line in batch.lines).items():
        if outcome in ("created", "replaced", "unchanged"):
            context.metrics.submaps_written.labels(outcome).inc(count)
