"""`urquhart jobs`: what is under way in a database, and how the operator ends it; also while a service runs."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from server.commands.support.console import wide_console
from server.commands.support.database import check_there, open_database, settings_with
from server.commands.support.failure import CommandError
from server.commands.support.options import DatabaseOption
from server.jobs import operator
from server.store.sqlite.database import Database

app = typer.Typer(help="List the jobs of a database, and cancel them.")


@app.command("list")
def list_jobs(
    every: Annotated[bool, typer.Option("--all", help="Finished ones, too.")] = False,
    database: DatabaseOption = None,
) -> None:
    """List unfinished jobs, oldest first: who began each, where, and how far it is."""
    store = _existing(database)
    try:
        found = operator.listed(store, finished=every)
    finally:
        store.dispose()
    if not found:
        typer.echo("no jobs" if every else "no unfinished jobs")
        return
    table = Table("id", "kind", "collection", "key", "state", "done", "total", "created", box=None)
    for job in found:
        total = "" if job.total is None else str(job.total)
        moment = f"{job.created:%Y-%m-%d %H:%M}"
        table.add_row(job.id, job.kind, job.collection, job.key or "-", job.state, str(job.done), total, moment)
    wide_console().print(table)


@app.command("cancel")
def cancel(
    ids: Annotated[list[str] | None, typer.Argument(help="Ids of jobs.", show_default=False)] = None,
    key: Annotated[str | None, typer.Option(help="All unfinished jobs of this key.", show_default=False)] = None,
    every: Annotated[bool, typer.Option("--all", help="All unfinished jobs.")] = False,
    database: DatabaseOption = None,
) -> None:
    """Cancel jobs: one that is running ends after what is in progress, and what it did stays."""
    if sum((bool(ids), key is not None, every)) != 1:
        raise CommandError("no jobs are named: give their ids, --key KEY, or --all")
    store = _existing(database)
    try:
        ended = operator.cancel(store, ids=ids or (), key=key, every=every)
    finally:
        store.dispose()
    for job_id in ended:
        typer.echo(job_id)
    typer.echo(f"{len(ended)} cancelled", err=True)


def _existing(database: Path | None) -> Database:
    settings = settings_with(database=database)
    check_there(settings)
    return open_database(settings)
