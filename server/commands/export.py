"""`urquhart export`: write what a collection holds as a file that a GIS opens, also while a service runs."""

from pathlib import Path
from typing import Annotated

import typer

from server.commands.support.database import upgraded_database
from server.commands.support.failure import CommandError
from server.commands.support.options import DatabaseOption
from server.errors import InvalidField, NotAcceptable
from server.exports.layers import LayerName, export_of
from server.exports.selection import DEGREES, ExportChoice
from server.outputs.files import format_of, write_table
from server.outputs.tables import OutputLayer
from server.submaps.reader import submap_filter


def export(
    *,
    table: Annotated[
        LayerName,
        typer.Argument(
            metavar="TABLE",
            help="landmarks (trees), submaps, matches (stored queries), or pairs (of trees in these matches).",
        ),
    ],
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="File to write: .csv, .geojson, .gpkg or .parquet. It is replaced.")
    ],
    collection: Annotated[str, typer.Option(help="Collection to export.")],
    frame: Annotated[
        str | None,
        typer.Option(help="Only what is in this map frame. Needed if map frames have several coordinate systems."),
    ] = None,
    session: Annotated[str | None, typer.Option(help="Only landmarks or submaps of this session.")] = None,
    bbox: Annotated[
        str | None,
        typer.Option(
            metavar="MIN_X,MIN_Y,MAX_X,MAX_Y",
            help="Only submaps whose footprint overlaps this box, and their landmarks. Metres, map frame.",
        ),
    ] = None,
    every: Annotated[
        bool,
        typer.Option("--every", help="One row for each submap that has a tree, if overlapping submaps share it."),
    ] = False,
    database: DatabaseOption = None,
) -> None:
    """Write landmarks, submaps, matches or pairs as CSV, GeoJSON, GeoPackage or GeoParquet.

    Positions are full coordinates of the map frame's coordinate reference system. A frame without one is written as a
    local system with its name. GeoJSON is in longitude and latitude. What is stored meanwhile may be missing.
    """
    if not file.parent.is_dir():
        raise CommandError(f"{file.parent}: no such directory: make it, or choose another")
    try:
        form = format_of(file)
        chosen = submap_filter(session=session, bbox=bbox, frame_id=frame, datetime_range=None)
        choice = ExportChoice(chosen, every=every, in_degrees=form.name == "geojson")
        with upgraded_database(database) as store:
            made = export_of(store, collection, table, choice)
            count = write_table(file, made.layer, made.rows)
    except NotAcceptable as error:
        raise CommandError(str(error)) from error
    except InvalidField as error:
        option = {"frame_id": "--frame", "bbox": "--bbox"}.get(error.parameter or "", error.parameter)
        raise CommandError(f"{option} {error}") from error
    typer.echo(f"{file}: {count} {table}, {_system(made.layer)}")


def _system(layer: OutputLayer) -> str:
    system = layer.system
    if system is DEGREES:
        return "in longitude and latitude"
    return f"in {system.name}" if system.crs is not None else f"in metres of the local frame {system.frame_id!r}"
