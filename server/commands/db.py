"""`urquhart db`: the database file, apart from the service."""

from functools import partial
from pathlib import Path
from typing import Annotated

import orjson
import typer
from rich.console import Console

from server.checks.inspection import inspect
from server.commands.failure import Failure
from server.commands.index import progress_bar
from server.commands.serve import settings_with
from server.index.catalog import Catalog
from server.index.flushing import rebuild
from server.index.upkeep import Upkeep
from server.metrics.metrics import Metrics
from server.registry import known_collections, read
from server.settings import Settings
from server.store.database import Database
from server.store.renewal import bring_up_to_date, renew
from server.store.schema import expected_revision, upgrade

app = typer.Typer(help="Look after the database file.")

DatabaseOption = Annotated[
    Path | None,
    typer.Option("--database", help="The SQLite file. (default: URQUHART_DATABASE or urquhart.db)", show_default=False),
]


@app.command("upgrade")
def upgrade_database(database: DatabaseOption = None) -> None:
    """Make the database, or bring it to the schema and features of this version. Nothing is lost.

    Ended half-way, it goes on where it was the next time.
    """
    store = _database(settings_with(database=database))
    try:
        changed, renewed = upgrade(store), 0
        with progress_bar(Console(stderr=True)) as progress:
            task = progress.add_task("features made anew", total=None)
            for step in renew(store, all_rows=True):
                renewed = step.made
                progress.update(task, completed=step.done, total=step.total)
    finally:
        store.dispose()
    features = f", features of {renewed} submaps made anew" if renewed else ""
    typer.echo(f"{store.path}: schema {expected_revision()}{features or ('' if changed else ', nothing to do')}")


@app.command("check")
def check_database(
    database: DatabaseOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Tell it as JSON.")] = False,
) -> None:
    """Prove that file, schema, rows, features and index agree. Exit code 1 when they do not; nothing is changed."""
    store = existing_database(settings_with(database=database))
    try:
        if tell_findings(store, as_json=as_json):
            raise typer.Exit(1)
    finally:
        store.dispose()


def tell_findings(store: Database, *, as_json: bool = False) -> int:
    """Inspect a database and print what is found; how much that was. Raises StorageError."""
    found = []
    for finding in inspect(store):
        found.append({"where": finding.where, "what": finding.what})
        if not as_json:
            typer.echo(f"{finding.where}: {finding.what}" if finding.where else finding.what)
    if as_json:
        typer.echo(orjson.dumps({"database": str(store.path), "clean": not found, "findings": found}).decode())
    else:
        typer.echo(f"{store.path}: {len(found)} findings" if found else f"{store.path}: clean")
    return len(found)


@app.command("reindex")
def reindex_database(
    collections: Annotated[
        list[str] | None, typer.Argument(metavar="[COLLECTION]...", help="Collections; all when none is named.")
    ] = None,
    database: DatabaseOption = None,
) -> None:
    """Write the index of collections anew, from what is stored. A service on the database goes on meanwhile."""
    settings = settings_with(database=database)
    store = existing_database(settings)
    try:
        bring_up_to_date(store)
        catalog, metrics = Catalog(store, Metrics(), settings.index), Metrics()
        for collection_id in collections or known_collections(store):
            with progress_bar(Console(stderr=True)) as progress:
                total = read(store, collection_id)[0].counts.submaps
                task = progress.add_task(collection_id, total=total)
                written = rebuild(catalog.shop, collection_id, progress=partial(progress.advance, task))
            Upkeep(store, catalog, metrics).merge_all(collection_id)
            typer.echo(f"{collection_id}: {written} submaps indexed anew")
    finally:
        store.dispose()


def existing_database(settings: Settings) -> Database:
    """The database of `settings`, as it is.

    Raises:
        Failure: there is no such file.
    """
    check_there(settings)
    return _database(settings)


def check_there(settings: Settings) -> None:
    """Who mistypes a path is told so, and does not get an empty database. Raises Failure."""
    if not settings.database_path.is_file():
        raise Failure(f"{settings.database_path}: no such database; make one with urquhart index or urquhart serve")


def _database(settings: Settings) -> Database:
    return Database(settings.database_path, busy_timeout=settings.busy_timeout, read_only=settings.database_read_only)
