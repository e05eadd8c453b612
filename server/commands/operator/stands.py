"""`urquhart stands`: list, show and remove what stem maps were stored in a collection, also while a service runs."""

from typing import Annotated

import typer
from rich.table import Table

from server.commands.support.console import wide_console
from server.commands.support.database import upgraded_database
from server.commands.support.options import DatabaseOption
from server.stem_maps import stored_stands

app = typer.Typer(help="List and show what stem maps were stored in a collection, and remove them.")

CollectionArgument = Annotated[str, typer.Argument(metavar="COLLECTION", help="Id of the collection.")]
NameArgument = Annotated[
    str, typer.Argument(metavar="NAME", help="Name of the stand: the file's name without its suffix.")
]


@app.command("list", epilog="Example: `urquhart stands list season-2026`")
def list_stands(collection: CollectionArgument, database: DatabaseOption = None) -> None:
    """List the stands of a collection, in the order they were first stored."""
    with upgraded_database(database) as store:
        found = stored_stands.listed(store, collection)
    if not found:
        typer.echo(f"no stands in {collection}: urquhart index stores some")
        return
    table = Table("name", "trees", "submaps", "radius", "spacing", "stored", box=None)
    for stand in found:
        sizes = (f"{stand.radius:g} m", f"{stand.spacing:g} m")
        stored = f"{stand.updated:%Y-%m-%d %H:%M}"
        table.add_row(stand.name, str(stand.trees), str(stand.submaps), *sizes, stored)
    wide_console().print(table)


@app.command("show", epilog="Example: `urquhart stands show season-2026 plot-7`")
def show(collection: CollectionArgument, name: NameArgument, database: DatabaseOption = None) -> None:
    """Show what is known of a stand."""
    with upgraded_database(database) as store:
        stand = stored_stands.read(store, collection, name)
    for label, value in (
        ("name", stand.name),
        ("frame", stand.frame_id),
        ("crs", stand.source_crs or "not known"),
        ("trees", str(stand.trees)),
        ("submaps", str(stand.submaps)),
        ("radius", f"{stand.radius:g} m"),
        ("spacing", f"{stand.spacing:g} m"),
        ("first", f"{stand.created:%Y-%m-%d %H:%M:%S} UTC"),
        ("stored", f"{stand.updated:%Y-%m-%d %H:%M:%S} UTC"),
        ("file", stand.source_hash or "not stored from a file"),
    ):
        typer.echo(f"{label:<9}{value}")


@app.command("remove", epilog="Example: `urquhart stands remove season-2026 plot-7`")
def remove(collection: CollectionArgument, name: NameArgument, database: DatabaseOption = None) -> None:
    """Remove a stand with all its submaps, in one transaction. Running services search without them at once."""
    with upgraded_database(database) as store:
        submaps = stored_stands.remove(store, collection, name)
    typer.echo(f"{name}: removed with {submaps} submaps")
