"""`urquhart db`: upgrade and check the database file, and rebuild its index."""

from collections.abc import Iterator
from typing import Annotated

import orjson
import typer
from rich.console import Console

from server.checks.all_checks import inspect
from server.checks.database import Discrepancy
from server.collections.crud import known_collections, read
from server.commands.support.database import (
    _database,
    existing_database,
    settings_with,
    unchanged_database,
)
from server.commands.support.options import DatabaseOption
from server.commands.support.progress import ProgressReport
from server.errors import StorageDamaged
from server.index.flushing import rebuild
from server.index.live_indexes import LiveIndexes
from server.index.maintenance import Maintenance
from server.observability.metrics import Metrics
from server.store.schema_version import expected_revision
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade.feature_backfill import backfill, bring_up_to_date
from server.store.sqlite.upgrade.migrations_runner import upgrade

app = typer.Typer(help="Upgrade and check the database file, and rebuild its index.")


@app.command("upgrade")
def upgrade_database(database: DatabaseOption = None) -> None:
    """Create the database, or upgrade it to the schema and features of this version. Nothing is lost.

    If the upgrade is interrupted, the next one continues it.
    """
    store = _database(settings_with(database=database))
    try:
        changed, renewed = upgrade(store), 0
        with ProgressReport(Console(stderr=True), "submaps") as progress:
            advance, done = None, 0
            for step in backfill(store, all_rows=True):
                renewed = step.made
                advance = advance or progress.task("features rebuilt", step.total)
                advance(step.done - done)
                done = step.done
    finally:
        store.dispose()
    features = f", features of {renewed} submaps rebuilt" if renewed else ""
    typer.echo(f"{store.path}: schema {expected_revision()}{features or ('' if changed else ', nothing to do')}")


@app.command("check")
def check_database(
    database: DatabaseOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Prove that file, schema, rows, features and index agree. Exit code 1 if they do not. Nothing is changed."""
    store = unchanged_database(settings_with(database=database))
    try:
        if tell_findings(store, as_json=as_json):
            raise typer.Exit(1)
    finally:
        store.dispose()


def tell_findings(store: Database, *, as_json: bool = False) -> int:
    """Inspect a database and print the findings. Returns their number. Raises StorageError."""
    found = []
    for finding in _findings(store):
        found.append({"where": finding.where, "what": finding.what})
        if not as_json:
            typer.echo(f"{finding.where}: {finding.what}" if finding.where else finding.what)
    if as_json:
        typer.echo(orjson.dumps({"database": str(store.path), "clean": not found, "findings": found}).decode())
    else:
        typer.echo(f"{store.path}: {len(found)} findings" if found else f"{store.path}: clean")
    return len(found)


def _findings(store: Database) -> Iterator[Discrepancy]:
    try:
        yield from inspect(store)
    except StorageDamaged:
        yield Discrepancy("", "the file is damaged, and SQLite cannot read it: restore a snapshot or a backup")


@app.command("reindex")
def reindex_database(
    collections: Annotated[
        list[str] | None, typer.Argument(metavar="[COLLECTION]...", help="Collections to reindex. (default: all)")
    ] = None,
    database: DatabaseOption = None,
) -> None:
    """Rebuild the index of collections from the stored landmarks. A running service continues to answer."""
    settings = settings_with(database=database)
    store = existing_database(settings)
    try:
        bring_up_to_date(store)
        indexes, metrics = LiveIndexes(store, Metrics(), settings.index), Metrics()
        for collection_id in collections or known_collections(store):
            with ProgressReport(Console(stderr=True), "submaps") as progress:
                total = read(store, collection_id)[0].counts.submaps
                advance = progress.task(collection_id, total)
                written = rebuild(indexes.flush_context, collection_id, progress=advance)
            Maintenance(store, indexes, metrics).merge_all(collection_id)
            typer.echo(f"{collection_id}: {written} submaps reindexed")
    finally:
        store.dispose()
