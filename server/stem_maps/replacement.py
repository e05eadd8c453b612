"""A stand replaces everything that was stored under its name, in one transaction."""

import pickle
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from server.collections.crud import get_collection
from server.platform.disk_errors import disk_errors
from server.store.records import CollectionRecord, StandRecord
from server.store.storage import Storage, WriteTransaction
from server.submaps.bulk_ingest import BatchResult, write_in
from server.submaps.described_batches import DescribedBatch, Refusal

_IN_MEMORY: Final = 32 * 1024 * 1024
"""Bytes of described submaps that wait in memory. The rest waits in a file beside the database."""


class StandError(ValueError):
    """A stand that cannot be stored. The message is one line that says what to change."""


@dataclass(slots=True)
class ReplacementReport:
    """The outcome of storing a stand, including the submaps that it had before.

    Attributes:
        created, replaced, unchanged: submaps of the stand as it is now.
        removed: submaps of before whose place in the grid is no more, or empty.
        adopted: of those of before, how many were stored by a version that knew no stands, or over HTTP.
        refused: submaps that cannot be used, and why; they are not stored.
        before: radius and spacing that the stand had before, metres; None for a new one.
        alike: other stands of the collection that have exactly the same trees.
    """

    created: int = 0
    replaced: int = 0
    unchanged: int = 0
    removed: int = 0
    adopted: int = 0
    refused: list[Refusal] = field(default_factory=list)
    before: tuple[float, float] | None = None
    alike: list[str] = field(default_factory=list)

    def count(self, result: BatchResult) -> None:
        """Add the outcome of one batch."""
        self.created += result.created
        self.replaced += result.replaced
        self.unchanged += result.unchanged
        self.refused += result.refused


@contextmanager
def keep_on_disk(batches: Iterable[DescribedBatch], folder: Path) -> Iterator[Iterator[DescribedBatch]]:
    """Read all batches first and then yield them, so that the transaction that stores them need not wait.

    Raises what `batches` raises, and StorageError.
    """
    with tempfile.SpooledTemporaryFile(_IN_MEMORY, mode="w+b", dir=str(folder)) as file:
        count = 0
        for batch in batches:
            with disk_errors(folder):
                pickle.dump(batch, file, protocol=pickle.HIGHEST_PROTOCOL)
            count += 1
        file.seek(0)
        yield (pickle.load(file) for _ in range(count))


@dataclass(frozen=True, slots=True)
class DescribedStand:
    """A stand that is ready to be stored: its row, and the submaps of `batches`, whose ids are among `ids`."""

    record: StandRecord
    ids: Collection[str]
    batches: Iterable[DescribedBatch]


def replace_stand(
    database: Storage,
    collection_id: str,
    described: DescribedStand,
    check: Callable[[WriteTransaction, CollectionRecord], object] = lambda tx, collection: None,
    finish: Callable[[WriteTransaction, CollectionRecord], object] = lambda tx, collection: None,
) -> ReplacementReport:
    """Store a stand with its described submaps, and delete its other ones.

    In the transaction, `check` may refuse it before anything is stored, and `finish` sees the stand as it is then.

    Readers see the stand as it was or as it is now, and nothing in between; so does whoever opens the database after a
    kill. A stand owns what it stored before, and submaps that look exactly like its discs and belong to no stand.

    Raises:
        StandError: another's submap has one of the ids, or no submap is left of a stand that had some.
        NotFound, Conflict, StorageError: as `write_in` and the database do. Nothing is changed.
    """
    done = ReplacementReport()
    record, ids = described.record, described.ids
    with database.write() as tx:
        collection = get_collection(tx, collection_id)
        check(tx, collection)
        collection_key = collection.key
        stands = tx.stands(collection_key)
        there = stands.get(record.name)
        done.before = None if there is None else (there.radius, there.spacing)
        stand_key = stands.put(record)
        strays = stands.strays(record.name, record.frame_id)
        had = stands.members(stand_key) | strays
        _check_ids(tx.submaps(collection_key).keys(ids), had, record.name)
        stored: set[str] = set()
        for batch in described.batches:
            batch.records = [(position, replace(one, stand_key=stand_key)) for position, one in batch.records]
            done.count(write_in(tx, collection_id, batch, "replace"))
            stored.update(one.id for _, one in batch.records)
        if had and not stored:
            raise StandError(
                f"none of the {len(done.refused)} submaps can be used. The first one: {done.refused[0].error} The "
                f"stand {record.name!r} keeps the submaps it had"
            )
        stands.adopt(stand_key, [key for submap_id, key in strays.items() if submap_id in stored])
        gone = [key for submap_id, key in had.items() if submap_id not in stored]
        stands.remove(gone)
        done.removed, done.adopted = len(gone), len(strays)
        done.alike = [name for name in stands.with_trees(record.trees_hash) if name != record.name]
        finish(tx, collection)
    return done


def _check_ids(taken: dict[str, int], had: dict[str, int], name: str) -> None:
    foreign = sorted(submap_id for submap_id, key in taken.items() if had.get(submap_id) != key)
    if foreign:
        raise StandError(
            f"{len(foreign)} submaps with ids of this stand, the first {foreign[0]!r}, do not belong to the stand "
            f"{name!r}: rename the file, or delete them first"
        )
