"""The database under measurement: filled in one call, opened as the service opens it.

Two functions know what a release may change: `store` how many submaps are stored at once, `index_bytes` what an index
takes on the disk.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import orjson

from benchmarks.scale.observations import Observations
from server.collections import crud
from server.index.live_indexes import LiveIndexes, View
from server.index.maintenance import Maintenance
from server.observability.metrics import Metrics
from server.schemas.collections import CollectionPut
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from server.submaps import bulk_ingest, described_batches

COLLECTION: Final = "scale"
_BATCH: Final = 500
_REFUSED: Final = 0.01
"""Largest share of a batch that may be refused."""


def store(path: Path, submaps: Observations, workers: int, done: Callable[[int], None]) -> int:
    """Store all submaps in a new database, described and durable; how many processes did it.

    Args:
        workers: processes that may take part.
        done: told now and then how many are stored.

    Raises:
        RuntimeError: a submap was refused.
    """

    def lines() -> Iterator[bytes]:
        for i in range(len(submaps)):
            yield orjson.dumps({"id": f"s{i}", "xy": submaps.xy(i)}, option=orjson.OPT_SERIALIZE_NUMPY)

    database = Database(path)
    try:
        migrations_runner.upgrade(database)
        crud.ensure(database, COLLECTION, CollectionPut())
        stored = 0
        with described_batches.describers(workers) as pool:
            for batch in bulk_ingest.ingest_lines(
                database, COLLECTION, lines(), bulk_ingest.LineOptions(batch_size=_BATCH, workers=pool)
            ):
                # Two trees may stand within a millimetre of each other: such a submap is refused, and left out.
                if len(batch.refused) > _REFUSED * batch.submaps:
                    raise RuntimeError(f"submap {batch.refused[0].submap_id} was refused: {batch.refused[0].error}")
                stored += batch.submaps
                done(stored)
    finally:
        database.dispose()
    return workers


def settle(path: Path) -> None:
    """Write the index of what is stored and merge it, as a bulk import ends."""
    database, metrics = Database(path), Metrics()
    try:
        Maintenance(database, LiveIndexes(database, metrics), metrics).flush_and_merge(COLLECTION)
    finally:
        database.dispose()


def index_bytes(path: Path) -> int | None:
    """Bytes of the index beside the database at `path`; None where it lies in memory only."""
    folder = path.with_name(path.name + ".index")
    sizes = [file.stat().st_size for file in folder.glob("*.segment")] if folder.is_dir() else []
    return sum(sizes) if sizes else None


def database_bytes(path: Path) -> int:
    """Bytes of the database file and what SQLite keeps beside it."""
    return sum(file.stat().st_size for file in files_of(path))


def files_of(path: Path) -> list[Path]:
    """The database file, its write-ahead log and that one's index, as far as they are there."""
    beside = (path.with_name(path.name + end) for end in ("", "-wal", "-shm"))
    return [file for file in beside if file.exists()]


@contextmanager
def opened(path: Path) -> Iterator[LiveIndexes]:
    """The indexes of the database at `path`, which is there."""
    database = Database(path)
    try:
        bring_up_to_date(database)
        yield LiveIndexes(database, Metrics())
    finally:
        database.dispose()


def index_of(view: View, key: int) -> int:
    """Which submap of the world a key of the collection is."""
    return int(view.tx.submaps(view.collection.key).ids([key])[key].removeprefix("s"))
