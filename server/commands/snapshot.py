"""`urquhart snapshot`: create, list, verify, delete and restore copies of the whole database."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Final

import orjson
import typer
from rich.table import Column, Table

from server.commands.operator.db import tell_findings
from server.commands.support.console import wide_console
from server.commands.support.database import existing_database, settings_with
from server.commands.support.failure import CommandError
from server.commands.support.options import DatabaseOption
from server.errors import NotFound
from server.security import api_keys
from server.snapshots import restoring, snapshots
from server.snapshots.snapshot_folder import SnapshotFolder
from server.store.sqlite.upgrade import migrations_runner

app = typer.Typer(help="Create, list, verify, delete and restore snapshots of the whole database.")

Wanted = Annotated[
    str, typer.Argument(metavar="NAME|FILE", help="Name of a snapshot beside the database, or a snapshot's file.")
]
Checksum = Annotated[
    str | None,
    typer.Option("--sha256", help="SHA-256 that the file must have.", show_default="what its manifest says"),
]


_MORE: Final = "; urquhart snapshot list shows which there are, of the database that --database names"


@app.command("create", epilog="Example: `urquhart snapshot create before-season`")
def create(
    name: Annotated[str | None, typer.Argument(help="Name of the snapshot.", show_default="the time")] = None,
    database: DatabaseOption = None,
) -> None:
    """Create a snapshot, also while a service runs. It contains the hashes of API keys."""
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
    as_json: Annotated[bool, typer.Option("--json", help="Print the snapshots as JSON.")] = False,
) -> None:
    """List the snapshots beside the database, oldest first."""
    found = SnapshotFolder(settings_with(database=database).database_path).all()
    if as_json:
        typer.echo(orjson.dumps([orjson.loads(snapshot.document()) for snapshot in found]).decode())
        return
    if not found:
        typer.echo("no snapshots")
        return
    # Never cut short, so that it can be copied.
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
    """Verify that a snapshot has not changed since it was created, is not damaged, and is of this service."""
    source = _find(settings_with(database=database).database_path, wanted, sha256)
    found = restoring.verify(source)
    proof = "as noted" if source.checksum else "which is noted nowhere"
    typer.echo(f"{source.file}: sound; SHA-256 {found}, {proof}")


@app.command("delete")
def delete(
    name: Annotated[str, typer.Argument(help="Name of the snapshot.")],
    database: DatabaseOption = None,
) -> None:
    """Delete a snapshot."""
    folder = SnapshotFolder(settings_with(database=database).database_path)
    try:
        folder.remove(name)
    except NotFound as error:
        raise CommandError(f"there is no snapshot {name!r} in {folder.path}{_MORE}") from error
    typer.echo(f"{name}: deleted")


@app.command("restore", epilog="Example: `urquhart snapshot restore before-season --force`")
def restore(
    wanted: Wanted,
    database: DatabaseOption = None,
    force: Annotated[
        bool,
        typer.Option(
            "--force", help="Restore although there is a database, which is renamed to FILE.before-restore-TIME."
        ),
    ] = False,
    discard: Annotated[
        bool, typer.Option("--discard", help="With --force: delete the present database instead of renaming it.")
    ] = False,
    sha256: Checksum = None,
) -> None:
    """Replace the database by a snapshot, and check the result. Stop the service first.

    The API keys are those of the snapshot: keys that were revoked later are valid again. The exit code is 1 if the
    check finds something.
    """
    settings = settings_with(database=database)
    path = settings.database_path
    restored = restoring.restore(_find(path, wanted, sha256), path, force=force, discard=discard)
    typer.echo(f"{path}: restored from {wanted}")
    if restored.aside is not None:
        typer.echo(f"the former database is now {restored.aside}")
    if restored.jobs_ended:
        typer.echo(f"{restored.jobs_ended} jobs that were not finished were ended")
    store = existing_database(settings)
    try:
        migrations_runner.claim(store)
        lost = restoring.forget_unusable(store)
        if lost:
            typer.echo(f"{lost} segments of the index are missing and will be rebuilt")
        now = datetime.now(UTC)
        usable = sum(key.state(now) == "usable" for key in api_keys.listed(store))
        if usable:
            typer.echo(f"{usable} API keys are valid, as when the snapshot was created: revoke those that must not be")
        if tell_findings(store):
            raise typer.Exit(1)
    finally:
        store.dispose()


def _find(database: Path, wanted: str, checksum: str | None) -> restoring.RestoreSource:
    """The snapshot, by its name or file. Raises CommandError, which says where it was looked for, and StorageError."""
    try:
        return restoring.find(database, wanted, checksum)
    except NotFound as error:
        folder = SnapshotFolder(database).path
        raise CommandError(
            f"there is no snapshot {wanted!r} in {folder}, and no file {Path(wanted).absolute()}{_MORE}"
        ) from error
