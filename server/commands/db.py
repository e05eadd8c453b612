"""`urquhart db`: the database file, apart from the service."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from server.catalog import Catalog
from server.commands.failure import Failure
from server.commands.index import progress_bar
from server.commands.serve import settings_with
from server.metrics import Metrics
from server.settings import Settings
from server.store.database import Database
from server.store.integrity import Finding, findings
from server.store.renewal import renew
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
def check_database(database: DatabaseOption = None) -> None:
    """Prove that file, schema, counts, features and index agree. Exit code 1 when they do not; nothing is changed."""
    settings = settings_with(database=database)
    store = existing_database(settings)
    count = 0
    try:
        for finding in findings(store):
            count += 1
            typer.echo(f"{finding.where}: {finding.what}" if finding.where else finding.what)
        if not count:
            for finding in _index_findings(store):
                count += 1
                typer.echo(f"{finding.where}: {finding.what}")
    finally:
        store.dispose()
    if count:
        typer.echo(f"{store.path}: {count} findings")
        raise typer.Exit(1)
    typer.echo(f"{store.path}: clean")


def existing_database(settings: Settings) -> Database:
    """The database of `settings`, as it is.

    Raises:
        Failure: there is no such file.
    """
    if not settings.database_path.is_file():
        raise Failure(f"{settings.database_path}: no such database; make one with urquhart index or urquhart serve")
    return _database(settings)


def _database(settings: Settings) -> Database:
    return Database(settings.database_path, busy_timeout=settings.busy_timeout, read_only=settings.database_read_only)


def _index_findings(store: Database) -> list[Finding]:
    """Build every index, as the service does at its start, and compare what it holds with what is stored."""
    catalog = Catalog(store, Metrics())
    found = []
    for collection_id, _, _ in catalog.warm_up():
        with catalog.view(collection_id) as view:
            held, stored = len(view.recognizer), view.collection.submap_count
            if held != stored:
                found.append(Finding(collection_id, f"the index holds {held} submaps of {stored}"))
    return found
