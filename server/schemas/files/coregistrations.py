"""Answers of the routes of coregistrations, and of the files that jobs write."""

from typing import Any, Final, Literal

from pydantic import Field

from server.schemas.common import Answer, Body, Label
from server.schemas.landmarks import FileName
from urquhart import Effort
from urquhart.prior.prior import LEAST_NOISE, MOST_NOISE


class SeasonOptions(Body):
    """How a season's plots are searched: the options of `urquhart coregister`."""

    positions: FileName | None = Field(
        None, description="Name of the file in the archive that says where plots ought to be: plot, x, y."
    )
    positions_crs: str | None = Field(
        None,
        max_length=2000,
        description="Coordinate reference system of `positions`. Default: what the file names, then `crs`, then that "
        "of the map.",
    )
    at_sigma: float | None = Field(
        None,
        ge=0.01,
        le=1e4,
        description="Search each plot where it ought to be first: standard deviation of that, in metres. Default: "
        "search everywhere.",
    )
    heading: float = Field(
        0.0,
        ge=-360,
        le=360,
        description="Bearing of the plots' y axes, in degrees clockwise from grid north of their system, or of the map "
        "if they name none.",
    )
    heading_sigma: float = Field(
        5.0,
        ge=0.01,
        le=180,
        description="Standard deviation of `heading`, in degrees. From 60 on, every heading is searched.",
    )
    frame_id: Label | None = Field(
        None, description="Map frame that plots ought to be in. Default: the only one.", examples=["map"]
    )
    noise: float | None = Field(
        None,
        ge=LEAST_NOISE,
        le=MOST_NOISE,
        description="Roughly how far trees are off in the map along each axis, in metres. Default: 0.3 to 1.",
    )
    effort: Effort = Field("full", description="How far to search if a plot is not found.")
    min_confidence: float | None = Field(
        None, gt=0.5, lt=1, description="Least confidence of a plot that is `matched`."
    )
    seed: int | None = Field(
        None, ge=0, le=2**63 - 1, description="Seed of random choices. The same seed gives the same results."
    )


class JobFile(Answer):
    """A file that a job wrote."""

    name: str = Field(description="Name of the file, with its folder: `plots.csv`, `pictures/P1.svg`.")
    bytes: int = Field(description="Size of the file, in bytes.")
    media_type: str = Field(description="Media type of the file.")
    href: str = Field(description="Path to download the file from.")


class JobFileList(Answer):
    """The files that a job wrote."""

    files: list[JobFile] = Field(description="The files, in the order of their names.")


class PlotRow(Answer):
    """What a coregistration found for one plot, as a line of NDJSON: the row of the plot in `plots.csv`, where `east`
    is `E`, and `shift_east` is `dE`.

    Lengths are in metres, but `east`, `north`, `x` and `y` are in the unit of their coordinate reference system.
    """

    plot: str = Field(description="Name of the plot.")
    verdict: Literal["matched", "ambiguous", "no_match", "not_read", "failed"] = Field(
        description="Verdict of the search. `not_read`: the plot cannot be read. `failed`: it cannot be looked up."
    )
    reason: str = Field(description="Why, as a stable word.")
    map: str | None = Field(description="Map frame that the plot lies in. Null unless it is matched.")
    crs: str | None = Field(description="Coordinate reference system of the map. Null if it is not known.")
    east: float | None = Field(description="Easting of the plot's centre in the map.")
    north: float | None = Field(description="Northing of the plot's centre in the map.")
    shift_east: float | None = Field(description="How far east the plot's own coordinates must be moved, in metres.")
    shift_north: float | None = Field(description="How far north the plot's own coordinates must be moved, in metres.")
    turn_cw_deg: float | None = Field(description="Turn about the plot's centre, in degrees, clockwise.")
    sigma_east: float | None = Field(description="Standard deviation of `east`, in metres.")
    sigma_north: float | None = Field(description="Standard deviation of `north`, in metres.")
    sigma_turn_deg: float | None = Field(description="Standard deviation of the turn, in degrees.")
    trees: int = Field(description="Number of trees of the plot.")
    inliers: int | None = Field(description="Number of these that have a partner in the map.")
    share: float | None = Field(description="`inliers` divided by `trees`.")
    rms: float | None = Field(description="Root mean square of the distances between partners, in metres.")
    scale: float | None = Field(description="Factor by which the map is larger than the plot.")
    confidence: float | None = Field(description="Calibrated probability that the pose is right.")
    searched: Literal["", "near", "everywhere"] = Field(
        description="`near` if the plot was found where it ought to be, `everywhere` if not."
    )
    places: int | None = Field(description="Number of places that an ambiguous plot fits.")
    rival: str | None = Field(description="Submap of the second of these places.")
    rival_east: float | None = Field(description="Easting of that place.")
    rival_north: float | None = Field(description="Northing of that place.")
    rival_turn_cw_deg: float | None = Field(description="Turn at that place, in degrees, clockwise.")
    look_at: str = Field(description="Why somebody should look at the plot. Empty if nobody need.")
    sentence: str = Field(description="What was found, in a sentence for people.")
    x: float | None = Field(description="The plot's centre in its own coordinates.")
    y: float | None = Field(description="The plot's centre in its own coordinates.")
    file: str = Field(description="Name of the file that the plot is from.")


PLOT_ROW_EXAMPLE: Final[dict[str, Any]] = {
    "plot": "P1",
    "verdict": "no_match",
    "reason": "no_votes",
    "map": None,
    "crs": None,
    "east": None,
    "north": None,
    "shift_east": None,
    "shift_north": None,
    "turn_cw_deg": None,
    "sigma_east": None,
    "sigma_north": None,
    "sigma_turn_deg": None,
    "trees": 24,
    "inliers": None,
    "share": None,
    "rms": None,
    "scale": None,
    "confidence": None,
    "searched": "everywhere",
    "places": None,
    "rival": None,
    "rival_east": None,
    "rival_north": None,
    "rival_turn_cw_deg": None,
    "look_at": "not found: no pose was proposed",
    "sentence": "not found: no pose was proposed",
    "x": 448146.7,
    "y": 5411103.1,
    "file": "plots.csv",
}
JOB_FILES_EXAMPLE: Final[dict[str, Any]] = {
    "files": [
        {
            "name": "plots.csv",
            "bytes": 1840,
            "media_type": "text/csv; charset=utf-8",
            "href": "/v1/jobs/01jz9k3v8xq7m2n4p5r6s7t8v9/files/plots.csv",
        }
    ]
}
