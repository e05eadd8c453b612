"""Jobs as the operator of the host sees them: those of all callers."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from server.errors import Conflict, NotFound
from server.problem_types import plain, problem_type_of
from server.store.service_records import UNFINISHED, JobRecord
from server.store.storage import Storage

_CANCELLED = plain(problem_type_of(Conflict("")), "The operator of the service cancelled this job.")


@dataclass(frozen=True, slots=True)
class JobInfo:
    """A job as the operator sees it. `key` is empty if it was started without a key."""

    id: str
    kind: str
    collection: str
    key: str
    state: str
    done: int
    total: int | None
    created: datetime


def listed(database: Storage, *, finished: bool = False) -> list[JobInfo]:
    """Unfinished jobs, oldest first. With `finished`, finished ones as well. Raises StorageError."""
    with database.read() as tx:
        return [_info(row) for row in tx.jobs.all(UNFINISHED if not finished else None)]


def cancel(database: Storage, *, ids: Sequence[str] = (), key: str | None = None, every: bool = False) -> list[str]:
    """Cancel the jobs with these `ids`, all of a `key`, or `every` one. Returns the ids of those that were unfinished.

    All or none. Raises NotFound, Conflict (it has finished already) and StorageError.
    """
    with database.write() as tx:
        jobs = tx.jobs
        unfinished = jobs.all(UNFINISHED)
        if ids:
            for job_id in ids:
                row = jobs.get(job_id)
                if row is None:
                    raise NotFound("job", job_id[:100])
                if row.state not in UNFINISHED:
                    raise Conflict(f"The job {job_id} is {row.state} already.")
        chosen = [row.id for row in unfinished if every or row.id in ids or row.caller == key]
        jobs.end(chosen, _CANCELLED)
        return chosen


def _info(row: JobRecord) -> JobInfo:
    return JobInfo(row.id, row.kind, row.collection_id, row.caller, row.state, row.done, row.total, row.created)
