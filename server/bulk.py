"""Submaps by the thousand: described in processes, stored batch by batch, with a word on what became of each."""

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, nullcontext
from dataclasses import dataclass
from typing import Literal, TypeVar

from sqlalchemy.orm import Session

from server import batches
from server.batches import Described, Refusal
from server.errors import Conflict, DomainError
from server.ingest import Outcome, same_collection, store
from server.schemas.submaps import NamedSubmap
from server.settings import Limits
from server.store.database import Database
from server.store.submaps import Identity, SubmapRecord, Submaps
from server.threads import pin_threads
from server.workers import Work, Workers

OnConflict = Literal["replace", "skip", "fail"]
"""What to do with a submap whose id is taken by another content: put it there, leave it out, or refuse it."""

_Given = TypeVar("_Given")
_Task = TypeVar("_Task")


@dataclass(frozen=True, slots=True)
class Line:
    """What became of one submap.

    Attributes:
        position: in what was given, from 0.
        id: None where not even that could be read.
        outcome: `superseded` is one that the same id came after, in the same transaction; `withheld` one that is
            sound, where all or nothing was to be stored.
        revision: the collection's at the submap's last write, where there is one.
        error: why it was refused.
    """

    position: int
    id: str | None
    outcome: Outcome | Literal["superseded", "skipped", "refused", "withheld"]
    revision: int | None = None
    error: DomainError | None = None


@dataclass(slots=True)
class BatchResult:
    """What became of one batch; durable when it is yielded."""

    lines: list[Line]
    landmarks: int
    revision: int
    following: int

    @property
    def created(self) -> int:
        """How many are new."""
        return self._count("created")

    @property
    def replaced(self) -> int:
        """How many took the place of others, those that did not keep it among them."""
        return self._count("replaced") + self._count("superseded")

    @property
    def unchanged(self) -> int:
        """How many were there already."""
        return self._count("unchanged")

    @property
    def refused(self) -> list[Refusal]:
        """What cannot be used, and why."""
        return [Refusal(line.id, line.error, line.position) for line in self.lines if line.error is not None]

    @property
    def submaps(self) -> int:
        """How many submaps of the input this batch accounts for."""
        return len(self.lines)

    def _count(self, outcome: str) -> int:
        return sum(line.outcome == outcome for line in self.lines)


Witness = Callable[[Session, BatchResult], None]
"""Told of a batch in its transaction, just before it is committed; what it raises undoes the batch."""


def ingest_many(
    database: Database,
    collection_id: str,
    submaps: Iterable[NamedSubmap],
    *,
    batch_size: int = 500,
    limits: Limits | None = None,
    workers: Workers | None = None,
) -> Iterator[BatchResult]:
    """Store many submaps, a transaction for each batch; yields what became of each batch once it is durable.

    A submap that cannot be used is reported in `refused` and does not stop the others. An id that is there already is
    replaced; of an id that comes twice in a batch, the last stands. While a batch is written, the next ones are
    described by `workers` (of `batches.describers`; without it a pool for this call, a process for each core), which
    are started when the work goes on for more than a second.

    Raises NotFound, StorageError and WorkerLost; what was yielded is stored.
    """
    work = batches.of_submaps(database, collection_id, limits or Limits())
    cut = batches.cut(submaps, batch_size, batches.weigh_submap)
    for described in _described(work, cut, workers):
        yield write(database, collection_id, described)


def ingest_lines(
    database: Database,
    collection_id: str,
    lines: Iterable[bytes],
    *,
    batch_size: int = 500,
    limits: Limits | None = None,
    workers: Workers | None = None,
    first: int = 0,
    on_conflict: OnConflict = "replace",
    witness: Witness | None = None,
) -> Generator[BatchResult, None, None]:
    """Store submaps that come as lines of NDJSON, each the body of a PUT with the submap's `id`; as `ingest_many`.

    Lines are read where they are described, which is the fastest way in. Empty ones are passed over. `first` is the
    position of the first line.
    """
    described_lines = describe_lines(
        database, collection_id, lines, batch_size=batch_size, limits=limits, workers=workers, first=first
    )
    # Closed here, where what it waits for is known, and not when it is found to be garbage.
    with closing(described_lines):
        for described in described_lines:
            yield write(database, collection_id, described, on_conflict, witness)


def describe_lines(
    database: Database,
    collection_id: str,
    lines: Iterable[bytes],
    *,
    batch_size: int = 500,
    limits: Limits | None = None,
    workers: Workers | None = None,
    first: int = 0,
) -> Generator[Described, None, None]:
    """The same without storing: what each batch of lines holds. Raises NotFound, StorageError and WorkerLost."""
    work = batches.of_lines(database, collection_id, limits or Limits())
    return _described(work, batches.cut(lines, batch_size, len, first), workers)


def write(
    database: Database,
    collection_id: str,
    batch: Described,
    on_conflict: OnConflict = "replace",
    witness: Witness | None = None,
) -> BatchResult:
    """Store a batch in a transaction of its own. Raises NotFound, Conflict (another collection now), StorageError."""
    with database.write() as session:
        result = write_in(session, collection_id, batch, on_conflict)
        if witness is not None:
            witness(session, result)
    return result


def write_in(session: Session, collection_id: str, batch: Described, on_conflict: OnConflict) -> BatchResult:
    """Store a batch in a transaction that others share. Raises NotFound and Conflict."""
    collection = same_collection(session, collection_id, batch.collection_key)
    known = Submaps(session, collection.key).identities({record.id for _, record in batch.records})
    lines = [Line(one.position, one.submap_id, "refused", error=one.error) for one in batch.refused]
    chosen: dict[str, tuple[int, SubmapRecord]] = {}
    for position, record in batch.records:
        taken, earlier = known.get(record.id), chosen.get(record.id)
        if on_conflict == "replace":
            if earlier is not None:
                lines.append(Line(earlier[0], record.id, "superseded"))
            chosen[record.id] = (position, record)
        elif earlier is None and (taken is None or taken.etag == record.etag):
            chosen[record.id] = (position, record)
        elif earlier is not None and earlier[1].etag == record.etag:
            lines.append(Line(position, record.id, "unchanged"))
        else:
            lines.append(_conflicting(position, record, taken, on_conflict))
    records = [(known.get(record.id), record) for _, record in chosen.values()]
    receipts = store(session, collection, records)
    for (position, record), receipt in zip(chosen.values(), receipts, strict=True):
        lines.append(Line(position, record.id, receipt.outcome, receipt.revision))
    lines.sort(key=lambda line: line.position)
    revision = max((receipt.revision for receipt in receipts), default=collection.revision)
    return BatchResult(lines, batch.landmarks, revision, batch.following)


def _conflicting(position: int, record: SubmapRecord, taken: Identity | None, on_conflict: OnConflict) -> Line:
    if on_conflict == "skip":
        return Line(position, record.id, "skipped", taken.revision if taken is not None else None)
    where = "in the collection" if taken is not None else "on an earlier line"
    error = Conflict(
        f"There is a submap {record.id!r} with other content {where}; on_conflict=replace would replace it."
    )
    return Line(position, record.id, "refused", error=error)


def _described(
    work: Work[_Given, _Task, Described], given: Iterable[_Given], workers: Workers | None
) -> Generator[Described, None, None]:
    pin_threads()
    with (
        nullcontext(workers) if workers is not None else batches.describers() as pool,
        closing(pool.map(work, given)) as results,
    ):
        yield from results
