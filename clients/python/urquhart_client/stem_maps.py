"""Files of trees, as the service reads them."""

from typing import Any, Literal, TypedDict

from urquhart_client.poses import Model

LengthUnit = Literal["m", "ft", "us-ft", "cm", "km"]


class FileOptions(TypedDict, total=False):
    """What is known of a file beforehand: the options of `urquhart index`, by the same names.

    `x`, `y`, `id`, `plot`, `dbh`, `height`, `species`, `status`, `azimuth`, `distance`, `slope`, `centre_x` and
    `centre_y` name columns. `keep` and `ignore` are several names with commas between them.
    """

    x: str
    y: str
    id: str
    plot: str
    only: str
    dbh: str
    dbh_unit: Literal["cm", "mm", "m", "in"]
    height: str
    height_unit: LengthUnit
    species: str
    unit: LengthUnit
    crs: str
    project: str
    layer: str
    decimal: Literal["point", "comma"]
    status: str
    keep: str
    azimuth: str
    distance: str
    angle: Literal["deg", "gon", "rad"]
    declination: float
    slope: str
    slope_unit: Literal["deg", "gon", "rad", "percent"]
    centre_x: str
    centre_y: str
    quadrat_size: float
    ignore: str
    skip_bad: bool


class FileCutting(TypedDict, total=False):
    """How a stem map becomes submaps: circles of `radius` metres, `spacing` metres apart; or `one_submap` a plot."""

    radius: float
    spacing: float
    one_submap: bool


class FileRows(Model):
    """The rows of a file of trees: how many were read, and how many of them gave no tree.

    `skipped` rows cannot be used (with the option `skip_bad`), `further_stems` are thinner stems of a tree, and
    `merged` are trees within 1 cm of a thicker one.
    """

    shown = ("read", "skipped", "further_stems", "merged")

    read: int
    skipped: int
    further_stems: int
    merged: int


class FilePlot(Model):
    """The trees of one plot, or of a file without plots, whose `name` is None.

    Each of the `landmarks` has `id`, `x` and `y` in metres, and of `dbh_cm`, `height_m` and `species` what is known, as
    `put_submap` and `query` take them.
    """

    shown = ("name",)

    name: str | None
    landmarks: list[dict[str, Any]]


class FileTrees(Model):
    """What a file of trees holds.

    `understood` says in one line what was read as what, what was not used, and what was left out; `rows` counts the
    rows. `assumed` lists the options that name a unit which the file does not name, such as `angle` where azimuths were
    taken for degrees. `crs` is the coordinate reference system of the positions, None if it is not known. `own_frames`
    says whether each plot has coordinates of its own.
    """

    shown = ("name", "understood", "rows")

    name: str
    understood: str
    rows: FileRows
    assumed: tuple[str, ...] = ()
    crs: str | None = None
    own_frames: bool
    plots: list[FilePlot]
