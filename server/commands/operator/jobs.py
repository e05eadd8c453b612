"""`urquhart jobs`: list and cancel the jobs of a database, also while a service runs."""

from typing import Annotated

import typer
from rich.table import Table

from server.commands.support.console import wide_console
from server.commands.support.database import upgraded_database
from server.commands.support.failure import CommandError
from server.commands.support.options import DatabaseOption
from server.jobs import operator_commands

app = typer.Typer(help="List the jobs of a database, and cancel them.")


@app.command("list")
def list_jobs(
    every: Annotated[bool, typer.Option("--all", help="List finished jobs, too.")] = False,
    database: DatabaseOption = None,
) -> None:
    """List unfinished jobs, oldest first, with their collection, key and progress."""
    with upgraded_database(database) as store:
        found = operator_commands.listed(store, finished=every)
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
    with upgraded_database(database) as store:
        ended = operator_commands.cancel(store, ids=ids or (), key=key, every=every)
    for job_id in ended:
        typer.echo(job_id)
    typer.echo(f"{len(ended)} cancelled", err=True)
