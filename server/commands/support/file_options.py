"""The options that say what is in a file of trees, the same for every command that reads one."""

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from server.stem_maps.reading.options import (
    AngleUnit,
    DecimalMark,
    LengthUnit,
    ReadOptions,
    SlopeUnit,
    StemUnit,
)

_PANEL: Final = "What is in the file"


def _option(help_text: str, *names: str, metavar: str | None = None) -> Any:
    return typer.Option(*names, help=help_text, metavar=metavar, show_default=False, rich_help_panel=_PANEL)


def _column(help_text: str, *names: str) -> Any:
    return _option(f"Column of {help_text}", *names, metavar="COLUMN")


FILE_OPTIONS: Final[dict[str, Any]] = {
    "x": Annotated[str | None, _column("x, or easting.")],
    "y": Annotated[str | None, _column("y, or northing.")],
    "id": Annotated[
        str | None, _column("the trees' ids or tags; of a point cloud, the dimension that numbers the trees.")
    ],
    "plot": Annotated[str | None, _column("plots. Each plot becomes a submap of its own.")],
    "only": Annotated[str | None, _option("Read only this plot.", metavar="PLOT")],
    "dbh": Annotated[str | None, _column("diameters at breast height.")],
    "dbh_unit": Annotated[
        StemUnit | None, _option("Unit of the diameters. (default: cm, if the median is plausible for a stand)")
    ],
    "height": Annotated[str | None, _column("heights.")],
    "height_unit": Annotated[LengthUnit | None, _option("Unit of the heights. (default: m)")],
    "species": Annotated[str | None, _column("species.")],
    "unit": Annotated[LengthUnit | None, _option("Unit of the positions. (default: m)")],
    "crs": Annotated[
        str | None, _option("Coordinate reference system of the positions, such as EPSG:25832.", metavar="CODE")
    ],
    "project": Annotated[
        str | None, _option("Convert positions to this projected system, for instance from degrees.", metavar="CODE")
    ],
    "layer": Annotated[str | None, _option("Layer of a GIS file, or sheet of a workbook, to read.", metavar="NAME")],
    "decimal": Annotated[DecimalMark | None, _option("The decimal mark. (default: what the numbers show)")],
    "status": Annotated[str | None, _column("whether a tree is alive; needs --keep.")],
    "keep": Annotated[
        list[str] | None,
        _option("A value of --status of trees to read. Repeat the option for several.", metavar="VALUE"),
    ],
    "azimuth": Annotated[str | None, _column("azimuths from the plot's centre, clockwise from north.")],
    "distance": Annotated[str | None, _column("distances from the plot's centre.")],
    "angle": Annotated[AngleUnit | None, _option("Unit of the azimuths. (default: deg, if they can be degrees)")],
    "declination": Annotated[
        float | None,
        _option("Degrees to add to azimuths, positive where magnetic north is east.", metavar="DEGREES"),
    ],
    "slope": Annotated[str | None, _column("slopes of the sight lines, to make distances horizontal.")],
    "slope_unit": Annotated[SlopeUnit | None, _option("Unit of the slopes. (default: deg)")],
    "centre_x": Annotated[str | None, _column("x of the plot's centre.", "--centre-x")],
    "centre_y": Annotated[str | None, _column("y of the plot's centre.", "--centre-y")],
    "centres": Annotated[
        Path | None, _option("A file with the plots' centres: the columns plot, x and y.", metavar="FILE")
    ],
    "quadrat_size": Annotated[
        float | None, _option("Side of the quadrats, in the unit of lx and ly. (default: 20 m)", metavar="LENGTH")
    ],
    "ignore": Annotated[
        list[str] | None,
        _option("A column to ignore. Repeat the option for several.", "--ignore", metavar="COLUMN"),
    ],
    "skip_bad": Annotated[
        bool, _option("Leave out rows that cannot be used, and say how many, instead of stopping.", "--skip-bad")
    ],
}
"""By the members of `ReadOptions`."""


def reads_files(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command all of `FILE_OPTIONS`; it gets them as one `ReadOptions`, its parameter `columns`."""
    signature = inspect.signature(command, eval_str=True)
    own = [one for one in signature.parameters.values() if one.name != "columns"]
    options = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=False if name == "skip_bad" else None,
            annotation=annotation,
        )
        for name, annotation in FILE_OPTIONS.items()
    ]

    @wraps(command)
    def run(**given: Any) -> None:
        members = {name: given.pop(name) for name in FILE_OPTIONS}
        for name in ("keep", "ignore"):
            members[name] = tuple(members[name] or ())
        command(**given, columns=ReadOptions(**members))

    del run.__wrapped__
    run.__signature__ = signature.replace(parameters=[*own, *options])  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in (*own, *options)} | {"return": None}
    return run
