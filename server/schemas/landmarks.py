"""Landmarks in the bodies of submaps and queries, and in files of trees that callers send."""

from itertools import chain
from typing import Annotated, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from server.schemas.common import Answer, Body, Label, Number, Points

_XY: Any = [[1.2, 3.4], [4.9, -2.2], [-3.1, 0.7], [2.2, -6.5], [-5.8, -4.1], [7.4, 5.3]]


STEMS_CM: Final = (1.0, 500.0)
"""Centimetres. Plausible diameters at breast height. A value beyond them is in another unit."""
TALLEST_M: Final = 150.0
"""Metres. No tree is taller."""


def _check_diameter(value: float) -> float:
    thinnest, thickest = STEMS_CM
    if not thinnest <= value <= thickest:
        raise PydanticCustomError(
            "diameter_range",
            "dbh_cm is a diameter in centimetres, from {thinnest} to {thickest}, and {value} is not: is it in "
            "{other}? Leave dbh_cm out for trees that are thinner.",
            {
                "thinnest": f"{thinnest:g}",
                "thickest": f"{thickest:g}",
                "value": f"{value:g}",
                "other": "metres" if value < thinnest else "millimetres",
            },
        )
    return value


def _check_height(value: float) -> float:
    if value > TALLEST_M:
        raise PydanticCustomError(
            "height_range",
            "height_m is a height in metres, up to {tallest}, and {value} is not: is it in centimetres or feet?",
            {"tallest": f"{TALLEST_M:g}", "value": f"{value:g}"},
        )
    return value


class Landmark(Body):
    """A tree."""

    id: Label | None = Field(
        None,
        description="Id of the tree, unique in the submap. By default its position in the list as text, counted from "
        "0.",
    )
    x: Number = Field(description="Position along x, in metres, in the frame of the submap or query.")
    y: Number = Field(description="Position along y, in metres, in the frame of the submap or query.")
    dbh_cm: Annotated[Number, Field(gt=0), AfterValidator(_check_diameter)] | None = Field(
        None,
        description="Diameter at breast height, in centimetres, from 1 to 500. It counts as evidence where both sides "
        "have it, and is never required.",
    )
    height_m: Annotated[Number, Field(gt=0), AfterValidator(_check_height)] | None = Field(
        None, description="Height of the tree, in metres, up to 150."
    )
    species: Label | None = Field(None, description="Species of the tree: any name or code.")


def _unique(ids: list[str]) -> list[str]:
    seen: dict[str, int] = {}
    for position, name in enumerate(ids):
        first = seen.setdefault(name, position)
        if first != position:
            raise PydanticCustomError(
                "duplicate_id",
                "landmark ids must be unique in a submap; {name} is at positions {first} and {position}",
                {"name": repr(name), "first": first, "position": position},
            )
    return ids


def _unique_trees(trees: list[Landmark]) -> list[Landmark]:
    _unique(_ids_of(trees))
    return trees


def _ids_of(trees: list[Landmark]) -> list[str]:
    return [str(i) if tree.id is None else tree.id for i, tree in enumerate(trees)]


class LandmarkBody(Body):
    """Landmarks in one of two forms: `xy` with optional `ids`, or `landmarks`."""

    xy: Points | None = Field(
        None, description="Positions of the trees as [x, y], in metres. The alternative to `landmarks`."
    )
    ids: Annotated[list[Label], Field(fail_fast=True), AfterValidator(_unique)] | None = Field(
        None,
        description="Ids of the trees in `xy`, one for each. By default their positions in the list as text, counted "
        "from 0.",
    )
    landmarks: Annotated[list[Landmark], Field(fail_fast=True), AfterValidator(_unique_trees)] | None = Field(
        None, description="The trees, each with its position, attributes and id. The alternative to `xy`."
    )

    @model_validator(mode="after")
    def _one_form(self) -> "LandmarkBody":
        if self.xy is not None and self.landmarks is not None:
            raise PydanticCustomError("two_forms", "give either `xy` or `landmarks`, not both")
        if self.ids is not None and self.xy is None:
            raise PydanticCustomError(
                "ids_without_xy", "`ids` goes with `xy`; in `landmarks` each carries its own `id`"
            )
        if self.ids is not None and self.xy is not None and len(self.ids) != len(self.xy):
            raise PydanticCustomError(
                "ids_length",
                "`ids` has {ids} entries for {xy} points of `xy`; give one each",
                {"ids": len(self.ids), "xy": len(self.xy)},
            )
        return self

    @property
    def landmark_count(self) -> int:
        """Number of landmarks in the body."""
        return len(self.xy if self.xy is not None else self.landmarks or [])

    @property
    def landmark_pointer(self) -> str:
        """JSON pointer to the field that holds the landmarks."""
        return "/landmarks" if self.landmarks is not None else "/xy"

    def positions(self) -> NDArray[np.float64]:
        """Positions (N, 2) float64, metres, as posted."""
        points = self.xy if self.xy is not None else [(tree.x, tree.y) for tree in self.landmarks or []]
        return np.fromiter(chain.from_iterable(points), np.float64, 2 * len(points)).reshape(-1, 2)

    def landmark_ids(self) -> list[str] | None:
        """Ids in order of the landmarks; None if each is the default, the landmark's position."""
        ids = _ids_of(self.landmarks) if self.landmarks is not None else self.ids or []
        return ids if any(name != str(i) for i, name in enumerate(ids)) else None

    def attributes(self) -> dict[str, list[Any]] | None:
        """Diameters, heights and species, a list for each that any tree has; None if no tree has any."""
        columns = {
            name: [getattr(tree, name) for tree in self.landmarks or []] for name in ("dbh_cm", "height_m", "species")
        }
        return {name: values for name, values in columns.items() if any(v is not None for v in values)} or None


_LENGTHS = Literal["m", "ft", "us-ft", "cm", "km"]


def _check_file_name(value: str) -> str:
    if "/" in value or "\\" in value or "\0" in value or value.startswith("."):
        raise PydanticCustomError("file_name", "must be the name of a file, without folders, such as plots.xlsx")
    return value


FileName = Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_check_file_name)]


def _column(what: str) -> Any:
    return Field(None, max_length=200, description=f"Name of the column of {what}, if it has no well-known name.")


class StemMapOptions(Body):
    """What is known of a file beforehand: the options of `urquhart index`, which docs/files.md explains."""

    x: str | None = _column("x, or easting")
    y: str | None = _column("y, or northing")
    id: str | None = _column("the trees' ids or tags; of a point cloud, the dimension that numbers the trees")
    plot: str | None = _column("plots; each plot is a place of its own")
    only: str | None = Field(None, max_length=200, description="Read only this plot.")
    dbh: str | None = _column("diameters at breast height")
    dbh_unit: Literal["cm", "mm", "m", "in"] | None = Field(None, description="Unit of the diameters.")
    height: str | None = _column("heights")
    height_unit: _LENGTHS | None = Field(None, description="Unit of the heights.")
    species: str | None = _column("species")
    unit: _LENGTHS | None = Field(None, description="Unit of the positions. Also says that odd positions are right.")
    crs: str | None = Field(
        None, max_length=2000, description="Coordinate reference system of the positions, such as EPSG:25832."
    )
    project: str | None = Field(None, max_length=2000, description="Convert positions to this projected system.")
    layer: str | None = Field(None, max_length=200, description="Layer of a GIS file, or sheet of a workbook.")
    decimal: Literal["point", "comma"] | None = Field(None, description="The decimal mark.")
    status: str | None = _column("whether a tree is alive")
    keep: str | None = Field(None, max_length=1000, description="Values of `status` of trees to read, with commas.")
    azimuth: str | None = _column("azimuths from the plot's centre, clockwise from north")
    distance: str | None = _column("distances from the plot's centre")
    angle: Literal["deg", "gon", "rad"] | None = Field(None, description="Unit of the azimuths.")
    declination: float | None = Field(None, ge=-360, le=360, description="Degrees to add to azimuths.")
    slope: str | None = _column("slopes of the sight lines")
    slope_unit: Literal["deg", "gon", "rad", "percent"] | None = Field(None, description="Unit of the slopes.")
    centre_x: str | None = _column("x of the plot's centre")
    centre_y: str | None = _column("y of the plot's centre")
    quadrat_size: float | None = Field(None, gt=0, description="Side of the quadrats that lx and ly are measured in.")
    ignore: str | None = Field(None, max_length=1000, description="Names of columns that are not used, with commas.")
    skip_bad: bool = Field(False, description="Whether to leave out rows that cannot be used, and count them.")


Assumed = Literal["unit", "angle", "dbh_unit", "height_unit"]
ASSUMED: Final = (
    "Units that nobody named, by the parameters that name them. Feet were taken for international feet (`unit`), "
    "azimuths for degrees (`angle`), diameters for centimetres (`dbh_unit`), heights for metres (`height_unit`). "
    "Repeat the request with the parameter to be sure: azimuths in gon that are read as degrees misplace trees."
)


class FileRows(Answer):
    """The rows of a file of trees: how many were read, and how many of them gave no tree."""

    read: int = Field(description="Number of rows, without those that options such as `only` and `keep` exclude.")
    skipped: int = Field(description="Number of rows left out because they cannot be used, with `skip_bad`.")
    further_stems: int = Field(description="Number of rows left out because a thicker stem of the same tree is there.")
    merged: int = Field(description="Number of trees left out because a thicker tree is within 1 cm.")


class StemMapPlot(Answer):
    """The trees of one plot, or of a file without plots."""

    name: str | None = Field(description="Name of the plot. Null if the file has no column of plots.")
    landmarks: list[Landmark] = Field(description="The trees, stems within 1 cm merged. Positions in metres.")


class StemMapAnswer(Answer):
    """What a file of trees holds, and how it was understood."""

    name: str = Field(description="Name of the file, without its suffix.")
    understood: str = Field(description="What was read as what, what is not used, and what was passed over.")
    assumed: list[Assumed] = Field(default_factory=list, description=ASSUMED)
    rows: FileRows = Field(description="How many rows were read, and how many were left out and why.")
    crs: str | None = Field(description="Coordinate reference system of the positions. Null if it is not known.")
    own_frames: bool = Field(description="Whether each plot has coordinates of its own, because they overlap.")
    plots: list[StemMapPlot] = Field(description="The trees, by plots.")
