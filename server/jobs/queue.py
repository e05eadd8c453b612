"""Jobs as callers see them: taken on, told of, dismissed."""

from collections.abc import Callable
from typing import Any, Literal

import orjson
from sqlalchemy.orm import Session

from server import links
from server.access import Caller
from server.constraints import write_out
from server.errors import Conflict, Gone, NotFound
from server.idempotency import Kept, Once, keep, recall
from server.identifiers import new_id
from server.jobs.folder import JobFolder
from server.paging import page_size, read_cursor, write_cursor
from server.registry import get_collection
from server.schemas.common import to_json
from server.schemas.constraints import ConstraintFormat
from server.schemas.jobs import JobAnswer, JobLinks, JobPage, JobState
from server.settings import Limits
from server.store.database import Database
from server.store.jobs import UNFINISHED, Jobs
from server.store.submaps import Submaps, stored_place
from server.store.tables import CollectionRow, JobRow
from urquhart import SE2

Kind = Literal["import", "reindex", "constraints"]


def accept(
    database: Database,
    collection_id: str,
    caller: Caller,
    kind: Kind,
    once: Once | None,
    *,
    job_id: str | None = None,
    parameters: dict[str, Any] | None = None,
    total: int | None = None,
    alone: bool = False,
    check: Callable[[Session, CollectionRow], None] | None = None,
) -> Kept:
    """Take a job on, unless the same was done before; what is answered.

    `alone`: not beside another unfinished one of its kind on the collection. `check` may refuse it.
    Raises NotFound, Conflict, KeyReused and StorageError.
    """
    with database.write() as session:
        collection = get_collection(session, collection_id)
        operation = f"{kind} {collection.key}"
        kept = recall(session, once, operation)
        if kept is not None:
            return kept
        if check is not None:
            check(session, collection)
        jobs = Jobs(session)
        if alone and jobs.unfinished(collection.key, kind):
            raise Conflict(f"A job of the kind {kind} is at work on {collection_id!r}; wait for it, or dismiss it.")
        row = jobs.add(
            job_id=job_id or new_id(),
            kind=kind,
            collection_id=collection.id,
            collection_key=collection.key,
            caller=caller.id,
            parameters=parameters or {},
            total=total,
        )
        answer = Kept(202, {"Location": links.job(row.id), "Retry-After": "1"}, to_json(describe(row)))
        return keep(session, once, operation, answer)


def read(database: Database, caller: Caller, job_id: str) -> JobAnswer:
    """A job. Raises NotFound."""
    with database.read() as session:
        return describe(_row(session, caller, job_id))


def page(
    database: Database,
    limits: Limits,
    caller: Caller,
    *,
    state: JobState | None,
    collection_id: str | None,
    limit: int | None,
    cursor: str | None,
) -> JobPage:
    """A page of the jobs on collections that the caller sees, the newest first. Raises InvalidField."""
    size = page_size(limit, limits)
    with database.read() as session:
        rows = Jobs(session).page(
            caller.patterns,
            state=state,
            collection_id=collection_id,
            before_key=read_cursor("jobs", cursor) or None,
            limit=size + 1,
        )
        more = len(rows) > size
        return JobPage(
            jobs=[describe(row) for row in rows[:size]],
            next=write_cursor("jobs", rows[size - 1].key) if more else None,
        )


def dismiss(database: Database, folder: JobFolder, caller: Caller, job_id: str) -> JobAnswer | None:
    """End a job, which may take until what is at hand is done; or forget a finished one (None) with its files.

    Raises NotFound and StorageError.
    """
    with database.write() as session:
        row, jobs = _row(session, caller, job_id), Jobs(session)
        if row.state in UNFINISHED:
            jobs.change(job_id, dismissed=True)
            session.refresh(row)
            return describe(row)
        jobs.remove([job_id])
    folder.remove(job_id)
    return None


def results(database: Database, folder: JobFolder, caller: Caller, job_id: str) -> int:
    """How many bytes of a job's results can be read. Raises NotFound, Conflict (unfinished), Gone (swept)."""
    with database.read() as session:
        row = _row(session, caller, job_id)
    if row.state in UNFINISHED:
        raise Conflict(f"The job {job_id} is {row.state}; ask for its results when it is finished.")
    if not folder.results(job_id).is_file():
        raise Gone(f"The job {job_id} left no results, or they were kept long enough and are gone.")
    return int(row.progress.get("written", 0))


def constraints(database: Database, folder: JobFolder, caller: Caller, job_id: str, wanted: ConstraintFormat) -> bytes:
    """The results of a job that looked for constraints, in a format. Raises as `results`, and Conflict for others."""
    size = results(database, folder, caller, job_id)
    with database.read() as session:
        row = _row(session, caller, job_id)
        if row.kind != "constraints":
            raise Conflict(f"The job {job_id} is of the kind {row.kind}; only constraints come in other formats.")
        with folder.results(job_id).open("rb") as file:
            found = [orjson.loads(line) for line in file.read(size).splitlines()]
        names = {name for one in found for name in (one["from"], one["to"])}
        submaps = Submaps(session, row.collection_key)
        poses = {
            known.id: SE2(place.map_x, place.map_y, place.map_yaw)
            for known in submaps.rows(submaps.keys(names).values())
            if (place := stored_place(known)) is not None
        }
    return write_out(found, wanted, poses)


def describe(row: JobRow) -> JobAnswer:
    """A job as it is answered."""
    eta = None
    worked = row.progress.get("worked")
    if row.state == "running" and row.total is not None and row.done and worked is not None:
        eta = round(max(row.total - row.done, 0) * worked / row.done, 1)
    return JobAnswer(
        id=row.id,
        kind=row.kind,
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
            collection=links.collection(row.collection_id),
        ),
    )


def _row(session: Session, caller: Caller, job_id: str) -> JobRow:
    row = Jobs(session).get(job_id)
    if row is None or not caller.sees(row.collection_id):
        raise NotFound("job", job_id[:100])
    return row
