"""`urquhart jobs`: list and cancel the jobs of a database, also while a service runs."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from server.commands.support.console import wide_console
from server.commands.support.database import check_there, open_database, settings_with
from server.commands.support.failure import CommandError
from server.commands.support.options import DatabaseOption
from server.jobs import operator_commands
from server.store.sqlite.database import Database

app = typer.Typer(help="List the jobs of a database, and cancel them.")


@app.command("list")
def list_jobs(
    every: Annotated[bool, typer.Option("--all", help="List finished jobs, too.")] = False,
    database: DatabaseOption = None,
) -> None:
    """List unfinished jobs, oldest first, with their collection, key and progress."""
    store = _existing(database)
    try:
        found = operator_commands.listed(store, finished=every)
    finally:
        store.dispose()
    if not found:
        typer.echo("no jobs" if every else "no unfinished jobs")
        return
    table = Table("id", "type", "collection", "key", "state", "done", "total", "created", box=None)
    for job in found:
        total = "" if job.total is None else str(job.total)
        moment = f"{job.created:%Y-%m-%d %H:%M}"
        table.add_row(job.id, job.kind, job.collection, job.key or "-", job.state, str(job.done), total, moment)
    wide_console().print(table)


@app.command("cancel", epilog="Example: `urquhart jobs cancel --key Ab3dE6gH`")
def cancel(
    ids: Annotated[list[str] | None, typer.Argument(help="Ids of jobs to cancel.", show_default=False)] = None,
    key: Annotated[
        str | None, typer.Option(help="Cancel all unfinished jobs of the key with this id.", show_default=False)
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Cancel all unfinished jobs.")] = False,
    database: DatabaseOption = None,
) -> None:
    """Cancel jobs. A running job stops after the work in progress; what it has stored stays."""
    if sum((bool(ids), key is not None, every)) != 1:
        raise CommandError("no jobs are named: give their ids, --key KEY, or --all")
    store = _existing(database)
    try:
        ended = operator_commands.cancel(store, ids=ids or (), key=key, every=every)
    finally:
        store.dispose()
    for job_id in ended:
        typer.echo(job_id)
    typer.echo(f"{len(ended)} cancelled", err=True)


def _existing(database: Path | None) -> Database:
    settings = settings_with(database=database)
    check_there(settings)
    return open_database(settings)
