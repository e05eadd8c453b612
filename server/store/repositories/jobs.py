"""Rows of jobs."""

from collections.abc import Collection, Sequence
from datetime import UTC, datetime
from typing import Any, Final, Unpack

from sqlalchemy import ColumnElement, Connection, Result, delete, exists, func, insert, or_, select, update

from server.store.columns import columns_of
from server.store.expressions import matches
from server.store.records import CollectionRecord
from server.store.service_records import UNFINISHED, JobChanges, JobRecord, Queue
from server.store.service_tables import JobRow
from server.store.tables import CollectionRow


class JobReader:
    """Reads jobs in a transaction of the caller."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def get(self, job_id: str) -> JobRecord | None:
        """The job of that id, or None."""
        return _first(self._connection.execute(_ALL.where(JobRow.id == job_id)))

    def unfinished_among(self, job_ids: Collection[str]) -> set[str]:
        """Which of these jobs are there and not finished."""
        return set(
            self._connection.scalars(select(JobRow.id).where(JobRow.id.in_(job_ids), JobRow.state.in_(UNFINISHED)))
        )

    def is_orphaned(self, job: JobRecord) -> bool:
        """Whether the collection that the job was accepted for is gone, even if another one has its name by now."""
        there = select(CollectionRow.key).where(CollectionRow.key == job.collection_key)
        return self._connection.scalar(there) is None

    def is_superseded(self, job: JobRecord) -> bool:
        """Whether another collection has the name of the one that the job was accepted for."""
        return self._connection.scalar(select(JobRow.key).where(JobRow.key == job.key, _superseded())) is not None

    def page(
        self,
        patterns: Sequence[str],
        *,
        state: str | None,
        collection_id: str | None,
        before_key: int | None,
        limit: int,
        caller: str,
    ) -> list[JobRecord]:
        """Up to `limit` jobs on collections that match a pattern, the newest first, beginning before a key.

        Jobs of a collection whose name another one has by now are listed only for the `caller` who started them, or
        for one who sees every collection.
        """
        query = _ALL.order_by(JobRow.key.desc()).limit(limit)
        if before_key is not None:
            query = query.where(JobRow.key < before_key)
        if state is not None:
            query = query.where(JobRow.state == state)
        if collection_id is not None:
            query = query.where(JobRow.collection_id == collection_id)
        if "*" not in patterns:
            query = query.where(matches(JobRow.collection_id, patterns), or_(JobRow.caller == caller, ~_superseded()))
        return [JobRecord(*row) for row in self._connection.execute(query)]

    def queues(self) -> list[Queue]:
        """The queues in which unfinished jobs wait, the one whose first job is the oldest first."""
        query = (
            select(JobRow.caller, JobRow.collection_key)
            .where(JobRow.state.in_(UNFINISHED))
            .group_by(JobRow.caller, JobRow.collection_key)
            .order_by(func.min(JobRow.key))
        )
        return [Queue(*row) for row in self._connection.execute(query)]

    def others_wait(self, queue: Queue) -> bool:
        """Whether a job of another queue waits for its turn."""
        other = or_(JobRow.caller != queue.caller, JobRow.collection_key != queue.collection_key)
        query = select(JobRow.key).where(JobRow.state == "accepted", other)
        return self._connection.scalar(query.limit(1)) is not None

    def unfinished_of(self, caller: str) -> int:
        """How many unfinished jobs a caller has."""
        query = select(func.count()).where(JobRow.state.in_(UNFINISHED), JobRow.caller == caller)
        return self._connection.scalar(query) or 0

    def all(self, states: Sequence[str] | None = None) -> list[JobRecord]:
        """All jobs, or those in some states, oldest first."""
        query = _ALL.order_by(JobRow.key)
        found = self._connection.execute(query if states is None else query.where(JobRow.state.in_(states)))
        return [JobRecord(*row) for row in found]

    def by_state(self) -> dict[str, int]:
        """How many jobs there are in each of the states before the end."""
        query = select(JobRow.state, func.count()).where(JobRow.state.in_(UNFINISHED)).group_by(JobRow.state)
        return dict.fromkeys(UNFINISHED, 0) | {row[0]: row[1] for row in self._connection.execute(query)}

    def next(self, queue: Queue) -> JobRecord | None:
        """The oldest unfinished job of a queue, or None."""
        query = _ALL.where(
            JobRow.state.in_(UNFINISHED),
            JobRow.caller == queue.caller,
            JobRow.collection_key == queue.collection_key,
        )
        return _first(self._connection.execute(query.order_by(JobRow.key).limit(1)))

    def unfinished(self, collection_key: int, kind: str) -> bool:
        """Whether the collection has an unfinished job of a kind."""
        query = select(JobRow.key).where(
            JobRow.state.in_(UNFINISHED), JobRow.collection_key == collection_key, JobRow.kind == kind
        )
        return self._connection.scalar(query.limit(1)) is not None

    def is_dismissed(self, job_id: str) -> bool:
        """Whether somebody wants the job ended, or it is no more."""
        return self._connection.scalar(select(JobRow.dismissed).where(JobRow.id == job_id)) is not False

    def with_results(self, since: datetime) -> set[str]:
        """Ids of the jobs that are unfinished, or were finished at a moment or later on a collection that is there."""
        there = exists().where(CollectionRow.key == JobRow.collection_key)
        query = select(JobRow.id).where(or_(JobRow.finished.is_(None), (JobRow.finished >= since) & there))
        return set(self._connection.scalars(query))

    def unfinished_ids(self) -> set[str]:
        """Ids of the jobs that are unfinished."""
        return set(self._connection.scalars(select(JobRow.id).where(JobRow.state.in_(UNFINISHED))))

    def surplus(self, most: int) -> list[str]:
        """Ids of the finished jobs beyond so many, the oldest ones."""
        query = select(JobRow.id).where(JobRow.finished.is_not(None)).order_by(JobRow.key.desc())
        return list(self._connection.scalars(query.offset(most)))


class Jobs(JobReader):
    """Reads and writes jobs in a transaction that the caller commits."""

    def add(
        self,
        *,
        job_id: str,
        kind: str,
        collection: CollectionRecord,
        caller: str,
        parameters: dict[str, Any],
        total: int | None,
    ) -> JobRecord:
        """Add a job that nobody has begun."""
        values = {
            "id": job_id,
            "kind": kind,
            "collection_id": collection.id,
            "collection_key": collection.key,
            "caller": caller,
            "state": "accepted",
            "parameters": parameters,
            "total": total,
            "done": 0,
            "counts": {},
            "progress": {},
            "dismissed": False,
            "created": datetime.now(UTC),
        }
        return JobRecord(*self._connection.execute(insert(JobRow).values(values).returning(*_COLUMNS)).one())

    def end(self, ids: Collection[str], problem: dict[str, Any]) -> None:
        """Dismiss unfinished jobs, for a reason: at once where nobody is at it, else after what is in progress."""
        for job_id in ids:
            self.change(job_id, dismissed=True, problem=problem)
            waiting = update(JobRow).where(JobRow.id == job_id, JobRow.state == "accepted")
            values = {"state": "dismissed", "finished": datetime.now(UTC)}
            self._connection.execute(waiting.values(**values))

    def end_those_of(self, caller: str, problem: dict[str, Any]) -> None:
        """Dismiss all unfinished jobs of a caller, for a reason."""
        self.end([row.id for row in self.all(UNFINISHED) if row.caller == caller], problem)

    def change(self, job_id: str, **values: Unpack[JobChanges]) -> None:
        """Set fields of a job."""
        self._connection.execute(update(JobRow).where(JobRow.id == job_id).values(**values))

    def end_unfinished(self, problem: dict[str, Any]) -> int:
        """Let every unfinished job fail, for one reason; how many there were."""
        statement = (
            update(JobRow)
            .where(JobRow.state.in_(UNFINISHED))
            .values(state="failed", problem=problem, finished=datetime.now(UTC))
            .returning(JobRow.key)
        )
        return len(self._connection.scalars(statement).all())

    def remove(self, ids: Collection[str]) -> None:
        """Remove jobs."""
        for job_id in ids:
            self._connection.execute(delete(JobRow).where(JobRow.id == job_id))


_COLUMNS: Final = columns_of(JobRecord, JobRow)
_ALL: Final = select(*_COLUMNS)


def _first(rows: Result[*tuple[Any, ...]]) -> JobRecord | None:
    row = rows.one_or_none()
    return None if row is None else JobRecord(*row)


def _superseded() -> ColumnElement[bool]:
    """Whether the name of a job's collection belongs to another collection by now."""
    return exists().where(CollectionRow.id == JobRow.collection_id, CollectionRow.key != JobRow.collection_key)
