"""Submaps stored by the library alone, before a service is started on them or beside one."""

import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from benchmarks.scale.tiled_forest import World
from server.collections import crud
from server.schemas.collections import CollectionPut
from server.schemas.submaps import NamedSubmap
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps import bulk_ingest, described_batches


def lines_of(world: World) -> Iterator[bytes]:
    """The submaps of a world as lines of NDJSON, `s0` and on."""
    for index in range(world.submaps):
        yield described_batches.line_of(
            NamedSubmap.model_validate({"id": f"s{index}", "xy": world.submap(index).xy.tolist()})
        )


def store(path: Path, collection: str, lines: Iterable[bytes]) -> tuple[int, float]:
    """Store lines of NDJSON in a collection of a new database; how many are new, and the seconds that took."""
    database = Database(path)
    try:
        migrations_runner.upgrade(database)
        crud.ensure(database, collection, CollectionPut())
        began = time.perf_counter()
        with described_batches.describers() as workers:
            stored = sum(
                batch.created
                for batch in bulk_ingest.ingest_lines(
                    database, collection, lines, bulk_ingest.LineOptions(workers=workers)
                )
            )
        return stored, time.perf_counter() - began
    finally:
        database.dispose()
