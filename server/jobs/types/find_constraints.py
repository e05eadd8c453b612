"""The job that looks up every submap of a collection in the others and stores the constraints that it finds."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final, TypeVar

import orjson
from pydantic import BaseModel, ValidationError

from server.constraints.extraction import Found, agree, chosen_submaps, from_look, question, read_found, search_of
from server.constraints.rows import store_found
from server.errors import Conflict, NotFound
from server.jobs.folder import cut
from server.jobs.running_job import JobContext, RunningJob
from server.platform.disk_errors import disk_errors
from server.queries.contradicting_maps import REASON
from server.queries.lookup import LookupResult, QueryContext, look_up
from server.queries.older_answers import completed
from server.schemas.constraints import ConstraintsInput
from server.store.storage import ReadTransaction
from server.store.submap_records import SubmapMetadata

_Body = TypeVar("_Body", bound=BaseModel)
_PAGE: Final = 50
"""Submaps that are looked up before the job reports progress."""
_SILENCE: Final = 1.0
"""Seconds after which it reports even if they are fewer."""
_LOOKED_UP: Final = "looked_up"
"""Member of a line that notes a submap that was looked up; other lines are constraints."""
CONTRADICTING: Final = "contradicting_maps"
"""Number of submaps without a result because the maps that they were found in contradict each other."""


def run_constraints(job: RunningJob, context: JobContext) -> None:
    """Look submaps up one by one. At the end, keep one constraint for each pair. Raises NotFound, StorageError and
    others.
    """
    if "written" in job.progress:
        return  # only its end could not be stored
    body = parameters_of(job, ConstraintsInput)
    search = find_all(job, context, body)
    size = write_results(job, context, (orjson.dumps(one) + b"\n" for one in search.kept))
    job.counts = search.counts
    with context.database.write() as tx:
        job.collection(tx)
        store_found(tx, job.collection_key, search.kept, search.looked_up, (search_of(body), job.id))
        job.report(tx, written=size)


def parameters_of(job: RunningJob, kind: type[_Body]) -> _Body:
    """The parameters that a job was accepted with. Raises Conflict if this version cannot read them."""
    try:
        return kind.model_validate(completed(kind, job.parameters))
    except ValidationError as error:
        raise Conflict(
            "Another version of the service accepted this job, and this version cannot read its parameters. Post it "
            "again."
        ) from error


def write_results(job: RunningJob, context: JobContext, lines: Iterable[bytes]) -> int:
    """Write the lines of a job's results and wait until the disk has them. Returns their bytes. Raises StorageError."""
    with disk_errors(context.folder.path), context.folder.results(job.id).open("wb") as results:
        context.folder.sync()
        results.writelines(lines)
        results.flush()
        os.fsync(results.fileno())
        return results.tell()


@dataclass(frozen=True, slots=True)
class FinishedSearch:
    """What a search found.

    Attributes:
        kept: one constraint for each pair of submaps.
        counts: of the job.
        looked_up: key and revision of the landmarks of each submap that was looked up, by id.
    """

    kept: list[Found]
    counts: dict[str, int]
    looked_up: dict[str, tuple[int, int]]


def find_all(job: RunningJob, context: JobContext, body: ConstraintsInput) -> FinishedSearch:
    """Look submaps up one by one, from where the job stands.

    Raises NotFound, StorageError, and what `RunningJob.report` raises.
    """
    found_file = context.folder.found(job.id)
    if job.total is None:
        with context.database.read() as tx:
            job.total = len(_pending(job, tx, body))
    with disk_errors(context.folder.path), found_file.open("a+b") as found:
        context.folder.sync()
        cut(found, job.progress.get("found", 0))
        contradicting = int(job.progress.get(CONTRADICTING, 0))
        for row, is_last in _rows(job, context, body):
            look = _look_up(job, context, row, body)
            if look is not None:
                contradicting += look.answer.reason == REASON
                found.writelines(orjson.dumps(one) + b"\n" for one in from_look(row, look, body))
                revision = look.content_revisions.get(row.id, row.content_revision)
                found.write(orjson.dumps({_LOOKED_UP: [row.id, row.key, revision]}) + b"\n")
            job.done += 1
            # A search may take seconds, and somebody may wait for the end of the job, or for a turn.
            if is_last or job.since_report > _SILENCE:
                found.flush()
                os.fsync(found.fileno())
                job.report(after=row.key, found=found.tell(), contradicting_maps=contradicting)
                job.yield_turn()
        found.seek(0)
        lines = [read_found(line) for line in found]
    kept, contradictions = agree(line for line in lines if _LOOKED_UP not in line)
    looked_up = {
        line[_LOOKED_UP][0]: (line[_LOOKED_UP][1], line[_LOOKED_UP][2]) for line in lines if _LOOKED_UP in line
    }
    job.total = job.done  # submaps may have been stored or deleted in the meantime
    counts = {"constraints": len(kept), "inconsistent": contradictions, CONTRADICTING: contradicting}
    return FinishedSearch(kept, counts, looked_up)


def _rows(job: RunningJob, context: JobContext, body: ConstraintsInput) -> Iterator[tuple[SubmapMetadata, bool]]:
    """Submaps to look up, in the order of their keys, from where the job stands, each with whether it is the last of a
    page.
    """
    after = int(job.progress.get("after", 0))
    known = dict[int, int]()
    if body.changed_only:
        with context.database.read() as tx:
            known = tx.constraints(job.collection(tx).key).searched(search_of(body))
    while True:
        with context.database.read() as tx:
            rows = _page(job, tx, body, after)
        if not rows:
            return
        some = [row for row in rows if known.get(row.key) != row.content_revision]
        for row in some:
            yield row, row is some[-1]
        after = rows[-1].key


def _page(job: RunningJob, tx: ReadTransaction, body: ConstraintsInput, after: int) -> list[SubmapMetadata]:
    submaps = tx.submaps(job.collection(tx).key)
    if body.submap_ids is None:
        return submaps.page(chosen_submaps(body), SubmapMetadata, after_key=after, limit=_PAGE)
    keys = sorted(key for key in _matching(job, tx, body) if key > after)
    return submaps.some(keys[:_PAGE], SubmapMetadata)


def _pending(job: RunningJob, tx: ReadTransaction, body: ConstraintsInput) -> list[int]:
    """Keys of the submaps to look up."""
    keys = _matching(job, tx, body)
    if not body.changed_only:
        return sorted(keys)
    collection = job.collection(tx).key
    known = tx.constraints(collection).searched(search_of(body))
    rows = tx.submaps(collection).some(sorted(keys), SubmapMetadata)
    return [row.key for row in rows if known.get(row.key) != row.content_revision]


def _matching(job: RunningJob, tx: ReadTransaction, body: ConstraintsInput) -> set[int]:
    submaps = tx.submaps(job.collection(tx).key)
    keys = submaps.matching(chosen_submaps(body))
    return keys if body.submap_ids is None else keys & set(submaps.keys(body.submap_ids).values())


def _look_up(job: RunningJob, context: JobContext, row: SubmapMetadata, body: ConstraintsInput) -> LookupResult | None:
    limits = context.settings.limits
    asked = question(row, body, limits.candidates)
    queries = QueryContext(context.database, context.indexes, context.metrics, limits)
    try:
        return look_up(queries, job.collection_id, asked, budget=job.budget)
    except NotFound:
        return None  # deleted in the meantime
