"""`urquhart stands`: what stem maps were stored in a collection, listed, replaced, moved, removed, also while a service
runs.
"""

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from server.collections.crud import get_collection, place_frame
from server.commands.support.console import wide_console
from server.commands.support.database import settings_with, upgraded_database
from server.commands.support.failure import CommandError
from server.commands.support.file_options import reads_files
from server.commands.support.options import DatabaseOption
from server.commands.support.place_options import pair
from server.commands.support.progress import reading
from server.schemas.collections import StandMove
from server.stem_maps import stored_stands
from server.stem_maps.moved_stands import move_stand
from server.stem_maps.reader import read_stem_map
from server.stem_maps.reading.options import ReadOptions
from server.stem_maps.sent_stands import named
from server.stem_maps.stands import StandError, cut_stand, store_stand, whole_stand
from server.stem_maps.tiling import CuttingError
from server.submaps.bulk_ingest import LineOptions

app = typer.Typer(help="List and show what stem maps were stored in a collection; replace, move and remove it.")

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


@app.command("replace", epilog="Example: `urquhart stands replace season-2026 plot-7 plot-7-corrected.csv`")
@reads_files
def replace(
    *,
    collection: CollectionArgument,
    name: NameArgument,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The stem map that takes the place of what is there.")],
    radius: Annotated[
        float | None, typer.Option(help="Radius of a submap, in metres. (default: as before)", show_default=False)
    ] = None,
    spacing: Annotated[
        float | None,
        typer.Option(
            help="Distance between the centres of neighbouring submaps, in metres. (default: as before)",
            show_default=False,
        ),
    ] = None,
    one_submap: Annotated[
        bool, typer.Option("--one-submap", help="Make the file, or each of its plots, one submap. (default: as before)")
    ] = False,
    database: DatabaseOption = None,
    columns: ReadOptions,
) -> None:
    """Store another file as a stand, in the place of all that it has, in one transaction.

    The stand keeps its name, whatever the file's is.
    """
    limits = settings_with(database=database).limits
    with upgraded_database(database) as store:
        before = stored_stands.read(store, collection, name)
        with reading(file):
            stem_map = named(read_stem_map(file, columns), name)
        typer.echo(f"{file.name}: {stem_map.understood}")
        sizes = (radius or before.radius, spacing or before.spacing)
        with store.read() as tx:
            was_whole = stored_stands.stored_whole(tx, get_collection(tx, collection), name)
        if one_submap and (radius, spacing) != (None, None):
            raise CommandError("--one-submap makes the file one submap: leave out --radius and --spacing")
        try:
            is_whole = one_submap or (was_whole and (radius, spacing) == (None, None))
            cut = whole_stand(stem_map, limits) if is_whole else cut_stand(stem_map, *sizes, limits)
            done = store_stand(store, collection, stem_map, cut, LineOptions(limits=limits))
        except (CuttingError, StandError) as error:
            raise CommandError(f"{file}: {error}") from error
    outcome = done.outcome
    typer.echo(
        f"{name}: {done.submaps} submaps ({outcome.created} created, {outcome.replaced} replaced, "
        f"{outcome.unchanged} unchanged, {outcome.removed} removed)"
    )


@app.command("move", epilog="Example: `urquhart stands move season-2026 plot-7 --east -4.2 --north 2.71 --turn 1.49`")
def move(
    collection: CollectionArgument,
    name: NameArgument,
    east: Annotated[float, typer.Option(metavar="M", help="How far to shift east, in metres.")] = 0.0,
    north: Annotated[float, typer.Option(metavar="M", help="How far to shift north, in metres.")] = 0.0,
    turn: Annotated[
        float, typer.Option(min=-360.0, max=360.0, metavar="DEG", help="How far to turn, in degrees clockwise.")
    ] = 0.0,
    about: Annotated[
        str | None,
        typer.Option(
            metavar="E,N",
            help="Point to turn about, in the map, in metres. (default: the middle of the stand)",
            show_default=False,
        ),
    ] = None,
    crs: Annotated[
        str | None,
        typer.Option(
            metavar="CODE",
            help="Instead: the coordinate reference system of the stand's map frame, such as EPSG:25832.",
            show_default=False,
        ),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(
            metavar="E,N",
            help="With --crs: where the frame's origin is there, in metres. (default: 0,0)",
            show_default=False,
        ),
    ] = None,
    database: DatabaseOption = None,
) -> None:
    """Move all submaps of a stand together in the map, or say where its map frame is on Earth.

    The shift and the turn are those that urquhart coregister reports. Trees are not described again. Storing the
    stand's file again puts it where the file says.
    """
    _check_move((east, north, turn), about, crs, origin)
    with upgraded_database(database) as store:
        stand = stored_stands.read(store, collection, name)
        if crs is not None:
            place_frame(store, collection, stand.frame_id, crs, None if origin is None else pair("--origin", origin))
            typer.echo(f"{stand.frame_id}: now in {crs}")
            return
        body: dict[str, Any] = {"shift": (east, north), "yaw": -math.radians(turn)}
        if about is not None:
            e, n = pair("--about", about)
            e0, n0 = stand.origin or (0.0, 0.0)
            body["about"] = (e - e0, n - n0)
        move_stand(store, collection, name, StandMove.model_validate(body))
    side = "clockwise" if turn >= 0.0 else "counter-clockwise"
    typer.echo(
        f"{name}: {stand.submaps} submaps moved {east:+g} m east, {north:+g} m north, turned {abs(turn):g} deg {side}"
    )


def _check_move(motion: tuple[float, float, float], about: str | None, crs: str | None, origin: str | None) -> None:
    """Raise CommandError unless the options say one thing to do; `motion`: east, north and turn."""
    if crs is not None and (*motion, about) != (0.0, 0.0, 0.0, None):
        raise CommandError("--crs says where the map frame is, and moves no stand in it: give one of both")
    if crs is None and origin is not None:
        raise CommandError("--origin needs --crs: the system that it is in")
    if crs is None and motion == (0.0, 0.0, 0.0):
        raise CommandError("nothing would move: give --east, --north or --turn, or --crs")
