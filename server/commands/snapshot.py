"""`urquhart snapshot`: copies of the whole database made, listed, proven, removed, and put back."""

from datetime import UTC, datetime
from typing import Annotated

import orjson
import typer
from rich.table import Column, Table

from server.commands.db import tell_findings
from server.commands.support.console import wide_console
from server.commands.support.database import existing_database, settings_with
from server.commands.support.options import DatabaseOption
from server.security import api_keys
from server.snapshots import restoring, snapshots
from server.snapshots.snapshot_folder import SnapshotFolder
from server.store import migrations_runner

app = typer.Typer(help="Make, list, prove, remove and restore snapshots of the whole database.")

Wanted = Annotated[
    str, typer.Argument(metavar="NAME|FILE", help="Name of a snapshot beside the database, or a snapshot's file.")
]
Checksum = Annotated[
    str | None,
    typer.Option("--sha256", help="What the file's SHA-256 must be.", show_default="what its manifest says"),
]


@app.command("create")
def create(
    name: Annotated[str | None, typer.Argument(help="Its name.", show_default="the time")] = None,
    database: DatabaseOption = None,
) -> None:
    """Make a snapshot, also while a service is on the database. Hashes of API keys are in it."""
    settings = settings_with(database=database)
    store = existing_database(settings)
    try:
        migrations_runner.claim(store)
        made = snapshots.make(store, SnapshotFolder(store.path), name, settings.snapshots.keep)
    finally:
        store.dispose()
    typer.echo(f"{made.name}: {made.size:,} bytes, SHA-256 {made.sha256}")


@app.command("list")
def list_snapshots(
    database: DatabaseOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Tell it as JSON.")] = False,
) -> None:
    """List the snapshots beside the database, oldest first."""
    found = SnapshotFolder(settings_with(database=database).database_path).all()
    if as_json:
        typer.echo(orjson.dumps([orjson.loads(snapshot.document()) for snapshot in found]).decode())
        return
    if not found:
        typer.echo("no snapshots")
        return
    # Whole, however narrow it is: it is there to be copied.
    table = Table(Column("name", no_wrap=True), "created", "bytes", "schema", "collections", "submaps", box=None)
    for snapshot in found:
        table.add_row(
            snapshot.name,
            f"{snapshot.created.astimezone(UTC):%Y-%m-%d %H:%M:%S}",
            f"{snapshot.size:,}",
            snapshot.schema_,
            str(len(snapshot.collections)),
            str(sum(collection.submaps for collection in snapshot.collections)),
        )
    wide_console().print(table)


@app.command("verify")
def verify(wanted: Wanted, sha256: Checksum = None, database: DatabaseOption = None) -> None:
    """Prove that a snapshot is what it was when it was made, sound, and of this service."""
    source = restoring.find(settings_with(database=database).database_path, wanted, sha256)
    found = restoring.verify(source)
    proof = "as noted" if source.checksum else "which is noted nowhere"
    typer.echo(f"{source.file}: sound; SHA-256 {found}, {proof}")


@app.command("delete")
def delete(
    name: Annotated[str, typer.Argument(help="Its name.")],
    database: DatabaseOption = None,
) -> None:
    """Remove a snapshot, for good."""
    SnapshotFolder(settings_with(database=database).database_path).remove(name)
    typer.echo(f"{name}: deleted")


@app.command("restore")
def restore(
    wanted: Wanted,
    database: DatabaseOption = None,
    force: Annotated[
        bool,
        typer.Option("--force", help="Also where there is a database: it is put aside as FILE.before-restore-TIME."),
    ] = False,
    discard: Annotated[
        bool, typer.Option("--discard", help="With --force: do not keep the database that is there.")
    ] = False,
    sha256: Checksum = None,
) -> None:
    """Put a snapshot in the place of the database, and prove that all of it agrees. Stop the service first.

    API keys are those of the snapshot: what was revoked since can be used again. Exit code 1 when something does not
    agree after all.
    """
    settings = settings_with(database=database)
    path = settings.database_path
    restored = restoring.restore(restoring.find(path, wanted, sha256), path, force=force, discard=discard)
    typer.echo(f"{path}: restored from {wanted}")
    if restored.aside is not None:
        typer.echo(f"the database that was there is {restored.aside}")
    if restored.jobs_ended:
        typer.echo(f"{restored.jobs_ended} jobs that were under way do not go on")
    store = existing_database(settings)
    try:
        migrations_runner.claim(store)
        lost = restoring.forget_unusable(store)
        if lost:
            typer.echo(f"{lost} segments of the index are not here and will be rewritten")
        now = datetime.now(UTC)
        usable = sum(key.state(now) == "usable" for key in api_keys.listed(store))
        if usable:
            typer.echo(f"{usable} API keys can be used, as when the snapshot was made: revoke those that must not")
        if tell_findings(store):
            raise typer.Exit(1)
    finally:
        store.dispose()
