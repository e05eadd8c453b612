"""Stands: what stem maps were stored in a collection."""

from datetime import datetime

from urquhart_client.poses import Model
from urquhart_client.stem_maps import FileRows


class Stand(Model):
    """What was stored from one stem map, and is replaced and deleted as a whole.

    `frame_id` is the map frame of its submaps; `crs` and `origin` (easting and northing, metres) say where that is,
    None if that is not known. `trees` are those of the file, `submaps` those stored now. `radius` and `spacing` of
    the submaps are in metres. `source_hash` is a digest of the file and `source_crs` the system of its positions,
    None if unknown; stands with equal `trees_hash` have their trees at the same positions. `etag` names what is
    stored now.
    """

    shown = ("name", "trees", "submaps", "radius", "spacing", "updated")

    name: str
    frame_id: str
    crs: str | None = None
    origin: tuple[float, float] | None = None
    trees: int
    submaps: int
    radius: float
    spacing: float
    source_hash: str | None = None
    source_crs: str | None = None
    trees_hash: str
    created: datetime
    updated: datetime
    etag: str


class StandReceipt(Stand):
    """A stand that was stored from a file.

    `understood` says in one line what was read as what, what was not used, and what is in no submap and why; `rows`
    counts the rows of the file. `assumed` lists the options that name a unit which the file does not name, such as
    `angle` where azimuths were taken for degrees.
    """

    shown = ("name", "trees", "submaps", "understood", "rows", "updated")

    understood: str
    rows: FileRows
    assumed: tuple[str, ...] = ()
