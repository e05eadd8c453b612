"""Seasons of plots that the service places in a map, and the files that it writes."""

from typing import Literal, TypedDict

from urquhart_client.poses import Model


class SeasonOptions(TypedDict, total=False):
    """How plots are searched, as `urquhart coregister` takes it. Lengths in metres, angles in degrees.

    With `at_sigma`, each plot is searched where its own coordinates, or the table of positions, put it, and elsewhere
    only if it is not there. `heading` is the bearing of the plots' y axes.
    """

    effort: Literal["fast", "full"]
    min_confidence: float
    seed: int
    at_sigma: float
    positions_crs: str
    heading: float
    heading_sigma: float
    frame_id: str
    noise: float


class JobFile(Model):
    """A file that a job wrote; `name` may have a folder. `bytes` is its size."""

    shown = ("name", "bytes")

    name: str
    bytes: int
    media_type: str
    href: str


class PlotRow(Model):
    """What was found for one plot. Lengths in metres, but coordinates are in the unit of their system.

    `verdict` is that of a query, or `not_read` or `failed`. `east` and `north` are the plot's centre in the map,
    `shift_east` and `shift_north` how far its own coordinates must be moved, `turn_cw_deg` its turn there, clockwise.
    `look_at` says why somebody should look at it.
    """

    shown = ("plot", "verdict", "east", "north", "turn_cw_deg", "inliers", "look_at")

    plot: str
    verdict: str
    reason: str
    map: str | None = None
    crs: str | None = None
    east: float | None = None
    north: float | None = None
    shift_east: float | None = None
    shift_north: float | None = None
    turn_cw_deg: float | None = None
    sigma_east: float | None = None
    sigma_north: float | None = None
    sigma_turn_deg: float | None = None
    trees: int
    inliers: int | None = None
    share: float | None = None
    rms: float | None = None
    scale: float | None = None
    confidence: float | None = None
    searched: str = ""
    places: int | None = None
    look_at: str = ""
    sentence: str = ""
    file: str
