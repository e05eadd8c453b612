"""Many submaps: described in worker processes and stored batch by batch, with an outcome for each."""

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, nullcontext
from dataclasses import dataclass, field
from typing import Final, Literal, TypeVar

from server.config.settings import Limits
from server.errors import Conflict, DomainError
from server.platform.process_pool import PoolTask, ProcessPool
from server.platform.thread_limits import pin_threads
from server.schemas.submaps import NamedSubmap
from server.store.storage import Storage, WriteTransaction
from server.store.submap_records import SubmapRecord
from server.submaps import described_batches
from server.submaps.described_batches import BlankLines, DescribedBatch, Refusal
from server.submaps.write_answers import Outcome
from server.submaps.writes import same_collection, store

OnConflict = Literal["replace", "skip", "fail"]
"""What to do if an id is stored with other content: replace it, skip the new one, or refuse it."""

_Given = TypeVar("_Given")
_Task = TypeVar("_Task")


@dataclass(frozen=True, slots=True)
class LineOutcome:
    """The outcome of one submap.

    Attributes:
        position: in what was given, from 0.
        id: None where not even that could be read.
        outcome: as if one after the other were stored, wherever a batch ends; `skipped` is one that was left out for
            what is there already, or because all or nothing was to be stored and others were refused.
        revision: the collection's at the submap's last write, where there is one.
        error: why it was refused.
    """

    position: int
    id: str | None
    outcome: Outcome | Literal["skipped", "refused"]
    revision: int | None = None
    error: DomainError | None = None


@dataclass(slots=True)
class BatchResult:
    """The outcome of one batch. It is durable when it is yielded."""

    lines: list[LineOutcome]
    landmarks: int
    revision: int
    following: int

    @property
    def created(self) -> int:
        """Number of new submaps."""
        return self._count("created")

    @property
    def replaced(self) -> int:
        """Number of submaps that replaced others."""
        return self._count("replaced")

    @property
    def unchanged(self) -> int:
        """Number of submaps that were stored already."""
        return self._count("unchanged")

    @property
    def refused(self) -> list[Refusal]:
        """The submaps that were refused, and why."""
        return [Refusal(line.id, line.error, line.position) for line in self.lines if line.error is not None]

    @property
    def submaps(self) -> int:
        """Number of submaps of the input that this batch covers."""
        return len(self.lines)

    def _count(self, outcome: str) -> int:
        return sum(line.outcome == outcome for line in self.lines)


OnWritten = Callable[[WriteTransaction, BatchResult], None]
"""Called with a batch in its transaction, just before the commit. An exception undoes the batch."""


def ingest_many(
    database: Storage,
    collection_id: str,
    submaps: Iterable[NamedSubmap],
    *,
    batch_size: int = 500,
    limits: Limits | None = None,
    workers: ProcessPool | None = None,
) -> Iterator[BatchResult]:
    """Store many submaps in one transaction per batch. Yields the outcome of each batch once it is durable.

    A submap that cannot be used is reported in `refused` and does not stop the others. A stored id is replaced. If an
    id is twice in a batch, the last one counts. While a batch is written, `workers` describe the next ones (of
    `described_batches.describers`; without it a pool for this call, with a process for each core). They are started
    when the work takes longer than a second.

    Raises NotFound, StorageError and WorkerLost; what was yielded is stored.
    """
    work = described_batches.of_submaps(database, collection_id, limits or Limits())
    cut = described_batches.cut(submaps, batch_size, described_batches.weigh_submap)
    for described in _described(work, cut, workers):
        yield write(database, collection_id, described)


@dataclass(frozen=True, slots=True)
class LineOptions:
    """How lines of NDJSON are read and described.

    Attributes:
        batch_size: lines of a batch, at most.
        limits: what a line is held to.
        workers: processes that describe; None for a pool of this call, a process for each core.
        first: position of the first line.
        careful: one of the lines is suspected to end the process that describes it.
    """

    batch_size: int = 500
    limits: Limits = field(default_factory=Limits)
    workers: ProcessPool | None = None
    first: int = 0
    careful: bool = False


USUAL: Final = LineOptions()


def ingest_lines(
    database: Storage,
    collection_id: str,
    lines: Iterable[bytes | BlankLines],
    options: LineOptions = USUAL,
    *,
    on_conflict: OnConflict = "replace",
    on_written: OnWritten | None = None,
) -> Generator[BatchResult, None, None]:
    """Store submaps from lines of NDJSON, each the body of a PUT with the submap's `id`, as `ingest_many` does.

    Lines are parsed where they are described, which is fastest. Empty lines are skipped.
    """
    described_lines = describe_lines(database, collection_id, lines, options)
    # Closed here, where its state is known, and not by garbage collection.
    with closing(described_lines):
        for described in described_lines:
            yield write(database, collection_id, described, on_conflict, on_written)


def describe_lines(
    database: Storage, collection_id: str, lines: Iterable[bytes | BlankLines], options: LineOptions = USUAL
) -> Generator[DescribedBatch, None, None]:
    """Read and describe the lines without storing them, batch by batch. Raises NotFound, StorageError and
    WorkerLost.
    """
    work = described_batches.of_lines(database, collection_id, options.limits, careful=options.careful)
    return _described(work, described_batches.cut(lines, options.batch_size, len, options.first), options.workers)


def write(
    database: Storage,
    collection_id: str,
    batch: DescribedBatch,
    on_conflict: OnConflict = "replace",
    on_written: OnWritten | None = None,
) -> BatchResult:
    """Store a batch in a transaction of its own. Raises NotFound, Conflict (the collection was replaced),
    StorageError.
    """
    with database.write() as tx:
        result = write_in(tx, collection_id, batch, on_conflict)
        if on_written is not None:
            on_written(tx, result)
    return result


def write_in(tx: WriteTransaction, collection_id: str, batch: DescribedBatch, on_conflict: OnConflict) -> BatchResult:
    """Store a batch within a transaction, as if its submaps were stored one after the other.

    If an id comes again, the last one is written, and each has the outcome that it would have had by itself.

    Raises NotFound and Conflict.
    """
    collection = same_collection(tx, collection_id, batch.collection_key)
    known = tx.submaps(collection.key).identities({record.id for _, record in batch.records})
    etags = {submap_id: identity.etag for submap_id, identity in known.items()}
    chosen: dict[str, SubmapRecord] = {}
    told: list[tuple[int, str, Outcome | Literal["skipped"]]] = []
    lines = [LineOutcome(one.position, one.submap_id, "refused", error=one.error) for one in batch.refused]
    for position, record in batch.records:
        there = etags.get(record.id)
        if there is None or there == record.etag or on_conflict == "replace":
            told.append((position, record.id, _outcome(there, record.etag)))
            chosen[record.id], etags[record.id] = record, record.etag
        elif on_conflict == "skip":
            told.append((position, record.id, "skipped"))
        else:
            lines.append(LineOutcome(position, record.id, "refused", error=_conflict(record.id, record.id in known)))
    receipts = store(tx, collection, [(known.get(record.id), record) for record in chosen.values()])
    revisions = {submap_id: identity.revision for submap_id, identity in known.items()}
    revisions |= {submap_id: receipt.revision for submap_id, receipt in zip(chosen, receipts, strict=True)}
    lines += [LineOutcome(position, submap_id, outcome, revisions[submap_id]) for position, submap_id, outcome in told]
    lines.sort(key=lambda line: line.position)
    revision = max((receipt.revision for receipt in receipts), default=collection.revision)
    return BatchResult(lines, batch.landmarks, revision, batch.following)


def _outcome(there: str | None, etag: str) -> Outcome:
    if there is None:
        return "created"
    return "unchanged" if there == etag else "replaced"


def _conflict(submap_id: str, known: bool) -> Conflict:
    where = "in the collection" if known else "on an earlier line"
    return Conflict(
        f"The submap {submap_id!r} exists with other content {where}. Use on_conflict=replace to replace it."
    )


def _described(
    work: PoolTask[_Given, _Task, DescribedBatch], given: Iterable[_Given], workers: ProcessPool | None
) -> Generator[DescribedBatch, None, None]:
    pin_threads()
    with (
        nullcontext(workers) if workers is not None else described_batches.describers() as pool,
        closing(pool.map(work, given)) as results,
    ):
        yield from results
