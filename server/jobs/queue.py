"""Jobs as callers see them: accepted, reported, cancelled (the API says dismissed)."""

from collections.abc import Collection
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, BinaryIO, Literal

from server.collections.crud import get_collection
from server.config.settings import Limits
from server.constraints.extraction import read_found
from server.constraints.formats import StoredSubmap, is_stale, write_out
from server.errors import Conflict, Forbidden, Gone, NotFound, StorageReadOnly
from server.jobs.folder import JobFolder
from server.jobs.quota import check_key, check_quota
from server.jobs.refused_lines import summary
from server.platform.disk_errors import disk_errors
from server.platform.ids import new_id
from server.resources import links
from server.resources.idempotency import NO_CONTENT, IdempotencyKey, StoredResponse, find_response, store_response
from server.resources.paging import PageRequest, page_size, read_cursor, write_cursor
from server.schemas.common import to_json
from server.schemas.constraints import ConstraintFormat
from server.schemas.jobs import JobAnswer, JobLinks, JobPage, JobState
from server.security.principal import Principal, Scope
from server.store.service_records import UNFINISHED, JobRecord
from server.store.storage import ReadTransaction, Storage
from server.store.submap_records import SubmapMetadata

JobType = Literal["import", "reindex", "constraints", "map", "coregistration", "merge"]


@dataclass(frozen=True, slots=True)
class NewJob:
    """A job to accept.

    Attributes:
        type: what it does.
        parameters: for whoever runs it.
        id: under which files of it were made already; None for a new one.
        total: of its steps; None where that is not known.
        exclusive: not beside another unfinished one of its type on the collection.
        collection_key: of the collection that `check` found, where one of that name may have been made again since.
    """

    type: JobType
    parameters: dict[str, Any] = field(default_factory=dict)
    id: str | None = None
    total: int | None = None
    exclusive: bool = False
    collection_key: int | None = None


def accept(
    database: Storage,
    collection_id: str,
    caller: Principal,
    job: NewJob,
    idempotency_key: IdempotencyKey | None,
    limits: Limits,
) -> StoredResponse:
    """Accept a job, unless the same request was carried out before. Returns the response.

    Raises NotFound, Conflict, KeyReused, TooManyJobs, Unauthorized (the key was just revoked) and StorageError.
    """
    with database.write() as tx:
        collection = get_collection(tx, collection_id)
        if job.collection_key not in (None, collection.key):
            raise NotFound("collection", collection_id)
        operation = f"{job.type} {collection.key}"
        response = find_response(tx, idempotency_key, operation)
        if response is not None:
            return response
        jobs = tx.jobs
        check_key(tx, caller)
        check_quota(tx, caller, limits)
        if job.exclusive and jobs.unfinished(collection.key, job.type):
            raise Conflict(
                f"Another job of the type {job.type} works on {collection_id!r}. Wait until it ends, or cancel it."
            )
        row = jobs.add(
            job_id=job.id or new_id(),
            kind=job.type,
            collection=collection,
            caller=caller.id,
            parameters=job.parameters,
            total=job.total,
        )
        answer = StoredResponse(202, {"Location": links.job(row.id), "Retry-After": "1"}, to_json(describe(row)))
        return store_response(tx, idempotency_key, operation, answer)


def check(database: Storage, collection_id: str) -> int:
    """Refuse a job that could not be accepted before its upload is sent. Returns the collection's key.

    Raises NotFound and StorageError.
    """
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
    if database.read_only:
        raise StorageReadOnly("The service has opened the database read-only, so nothing can be imported.")
    return collection.key


def read(database: Storage, caller: Principal, job_id: str) -> JobAnswer:
    """A job. Raises NotFound."""
    with database.read() as tx:
        return describe(_row(tx, caller, job_id))


def page(
    database: Storage,
    limits: Limits,
    caller: Principal,
    asked: PageRequest,
    *,
    state: JobState | None,
    collection_id: str | None,
) -> JobPage:
    """A page of the jobs on collections that the caller may see, newest first. Raises InvalidField."""
    size = page_size(asked.limit, limits)
    with database.read() as tx:
        rows = tx.jobs.page(
            caller.patterns,
            state=state,
            collection_id=collection_id,
            before_key=read_cursor("jobs", asked.cursor) or None,
            limit=size + 1,
            caller=caller.id,
        )
        more = len(rows) > size
        return JobPage(
            jobs=[describe(row) for row in rows[:size]],
            next=write_cursor("jobs", rows[size - 1].key) if more else None,
        )


def unfinished(database: Storage, job_ids: Collection[str]) -> set[str]:
    """Those of these jobs that are not finished. Raises StorageError."""
    with database.read() as tx:
        return tx.jobs.unfinished_among(job_ids)


def cancel(
    database: Storage, folder: JobFolder, caller: Principal, job_id: str, idempotency_key: IdempotencyKey | None
) -> StoredResponse:
    """End a job, at once or after the work in progress, or delete a finished one with its files. Returns the response.

    Raises NotFound, Forbidden (the job of another key, and a key that may only read), KeyReused and StorageError.
    """
    operation = f"deleteJob {job_id}"
    with database.write() as tx:
        response = find_response(tx, idempotency_key, operation)
        if response is not None:
            return response
        row, jobs = _row(tx, caller, job_id), tx.jobs
        if not (row.caller == caller.id or caller.scopes & {Scope.WRITE, Scope.ADMIN}):
            raise Forbidden("The job belongs to another key. To cancel it, your key needs the scope write or admin.")
        answer = None
        match row.state:
            case "running":
                jobs.change(job_id, dismissed=True)
            case "accepted":  # a runner announces its start in a transaction, so none works on the job
                jobs.change(job_id, dismissed=True, state="dismissed", finished=datetime.now(UTC))
            case _:
                jobs.remove([job_id])
        if row.state in UNFINISHED:
            answer = describe(_row(tx, caller, job_id))
        response = store_response(
            tx,
            idempotency_key,
            operation,
            NO_CONTENT if answer is None else StoredResponse(202, {}, to_json(answer)),
        )
    with disk_errors(folder.path):
        if answer is None:
            folder.remove(job_id)
        elif answer.finished is not None:
            folder.clear(job_id)
    return response


def finished_row(database: Storage, caller: Principal, job_id: str) -> JobRecord:
    """A job whose results can be read. Raises NotFound, Conflict (unfinished), Gone (deleted with the collection)."""
    with database.read() as tx:
        row = _row(tx, caller, job_id)
        orphaned = tx.jobs.is_orphaned(row)
    if row.state in UNFINISHED:
        raise Conflict(f"The job {job_id} is {row.state}. Read its results when it has ended.")
    if orphaned:
        raise Gone(f"The results of the job {job_id} were deleted with its collection.")
    return row


@dataclass(frozen=True, slots=True)
class Results:
    """The results of a job of a type: an open file, the number of bytes that are valid, and lines that follow."""

    kind: str
    collection_key: int
    file: BinaryIO
    size: int
    rest: bytes


def results(database: Storage, folder: JobFolder, caller: Principal, job_id: str) -> Results:
    """The results of a job, to be closed by the caller.

    Raises NotFound, Conflict (unfinished), Gone (deleted after a time, or with the collection).
    """
    row = finished_row(database, caller, job_id)
    try:
        # Once open, they can be read to their end even if the job is deleted.
        file = folder.results(job_id).open("rb")
    except FileNotFoundError as error:
        raise Gone(
            f"The job {job_id} has no results, or they were deleted because they are only kept for some time."
        ) from error
    size, rest = int(row.progress.get("written", 0)), summary(row.progress.get("refusals"))
    return Results(row.kind, row.collection_key, file, size, rest)


def constraints(
    database: Storage, left: Results, wanted: ConstraintFormat, frame_id: str | None = None
) -> tuple[bytes, int]:
    """The constraints that a job found, in a format, and the number of stale ones. Closes the results.

    `frame_id`: the map frame in which the vertices of a g2o file start; by default the one of most submaps. Raises
    Conflict for results of other jobs, InvalidField if no submap has a pose in `frame_id`.
    """
    with left.file as file:
        if left.kind != "constraints":
            raise Conflict(
                f"The job is of the type {left.kind}. Only jobs of the type constraints have results in other formats."
            )
        found = [read_found(line) for line in file.read(left.size).splitlines()]
    names = {name for one in found for name in (one["from"], one["to"])}
    with database.read() as tx:
        submaps = tx.submaps(left.collection_key)
        known = {
            row.id: StoredSubmap(row.content_revision, row.place)
            for row in submaps.some(submaps.keys(names).values(), SubmapMetadata)
        }
    told = [one | {"stale": is_stale(one, known)} for one in found]
    return write_out(told, wanted, known, frame_id), sum(one["stale"] for one in told)


def describe(row: JobRecord) -> JobAnswer:
    """A job as it is answered."""
    eta = None
    worked = row.progress.get("worked")
    if row.state == "running" and row.total is not None and row.done and worked is not None:
        eta = round(max(row.total - row.done, 0) * worked / row.done, 1)
    return JobAnswer(
        id=row.id,
        type=row.kind,
        collection=row.collection_id,
        state=row.state,
        total=row.total,
        done=row.done,
        counts=row.counts,
        eta_seconds=eta,
        dismissed=row.dismissed,
        created=row.created,
        started=row.started,
        finished=row.finished,
        problem=row.problem,
        links=JobLinks(
            self=links.job(row.id),
            results=f"{links.job(row.id)}/results",
            errors=f"{links.job(row.id)}/errors",
            files=links.job_files(row.id) if row.kind == "coregistration" else None,
            collection=links.collection(row.collection_id),
        ),
    )


def _row(tx: ReadTransaction, caller: Principal, job_id: str) -> JobRecord:
    jobs = tx.jobs
    row = jobs.get(job_id)
    if row is None or not caller.sees(row.collection_id):
        raise NotFound("job", job_id[:100])
    # The name decides who may see a collection, and this one belongs to another collection by now.
    if not (caller.sees_all or caller.id == row.caller) and jobs.is_superseded(row):
        raise NotFound("job", job_id[:100])
    return row
