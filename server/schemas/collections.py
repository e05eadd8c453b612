"""Bodies of the collection routes, and of those of stands."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainSerializer

from server.schemas.common import NEXT, Answer, Body, Counts, DefaultedBody, Free, Label, Metres, Point, write_stamp
from server.schemas.landmarks import ASSUMED, Assumed, FileRows
from server.schemas.poses import Yaw

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
_Title = Annotated[str, Field(min_length=1, max_length=500)]
_Crs = Annotated[str, Field(min_length=1, max_length=500)]
_NAME = "Title of the collection, for people."
_CRS = "Projected coordinate reference system, in metres, of the map frame `map`, such as `EPSG:32633`."
_ORIGIN = (
    "Easting and northing, in metres, of the origin of the map frame `map` in its CRS. Leave it out if poses are in "
    "full coordinates of the CRS."
)
_FRAMES = "CRS and origin of each map frame other than `map`, by the frame's name."
_MOST = 5_000
"""Most frames in one request."""
_CONFIG = "Parameters of the method. Parameters that are left out have their defaults."


class MapFrame(Body):
    """Where a map frame is on Earth."""

    crs: _Crs = Field(
        description="Projected coordinate reference system of the frame, in metres, such as `EPSG:32633`."
    )
    origin: tuple[Metres, Metres] | None = Field(
        None,
        description="Easting and northing, in metres, of the frame's origin in the CRS. Leave it out if poses are in "
        "full coordinates of the CRS.",
    )


class CollectionPut(Body):
    """A collection to create, or to compare with the one that exists. Members left out are not compared."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{}, {"title": "Plots of 2026", "crs": "EPSG:32633", "origin": [412000.0, 5820000.0]}]
        }
    )

    title: _Title | None = Field(None, description=_NAME)
    config: Free | None = Field(None, description=_CONFIG)
    crs: _Crs | None = Field(None, description=_CRS)
    origin: tuple[Metres, Metres] | None = Field(None, description=_ORIGIN)
    frames: Annotated[dict[Label, MapFrame], Field(max_length=_MOST)] | None = Field(None, description=_FRAMES)


class CollectionPatch(Body):
    """Members of a collection to change. Null removes a member; a member left out stays."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"title": "Plots of 2026, north"},
                {"frames": {"stand-7": {"crs": "EPSG:32633", "origin": [415200.0, 5821500.0]}, "stand-8": None}},
            ]
        }
    )

    title: _Title | None = Field(None, description=_NAME)
    config: Free | None = Field(
        None, description="Parameters of the method. They cannot be changed: send those that the collection has."
    )
    crs: _Crs | None = Field(None, description=_CRS)
    origin: tuple[Metres, Metres] | None = Field(None, description=_ORIGIN)
    frames: Annotated[dict[Label, MapFrame | None], Field(max_length=_MOST)] | None = Field(
        None, description=f"{_FRAMES} A frame that is left out stays; null removes its CRS and origin."
    )


class SpatialExtent(Answer):
    """The area that the submaps cover in one map frame."""

    frame_id: Label = Field(description="Name of the map frame.")
    bbox: tuple[float, float, float, float] = Field(
        description="Bounding box of the footprints as [min x, min y, max x, max y], in metres in the map frame."
    )


class Extent(Answer):
    """The area and the time that a collection covers."""

    spatial: list[SpatialExtent] = Field(
        description="The area covered, one entry for each map frame. Empty if no submap has a `map_pose`."
    )
    temporal: tuple[_Written, _Written] | None = Field(
        description="Earliest and latest `stamp` of the submaps. Null if no submap has one."
    )


class CollectionLinks(Answer):
    """Paths of the collection and its parts."""

    self: str = Field(description="Path of the collection.")
    submaps: str = Field(description="Path of the collection's submaps.")
    queries: str = Field(description="Path to POST queries to.")


class StandCounts(Answer):
    """The stands of a collection together."""

    stands: int = Field(description="Number of stands.")
    trees: int = Field(
        description="Number of trees in the files of the stands, each once. Submaps of a stand overlap, so `landmarks` "
        "counts many of them several times."
    )


class CollectionSummary(Answer):
    """A collection, as in a list."""

    id: str = Field(description="Id of the collection.")
    title: str | None = Field(description=_NAME)
    crs: str | None = Field(description=_CRS)
    origin: Point | None = Field(
        description="Easting and northing, in metres, of the origin of the map frame `map` in its CRS."
    )
    fingerprint: str = Field(description="Hash of the parameters that features are computed with.")
    revision: int = Field(description="Counter of the writes to the collection.")
    counts: Counts = Field(description="How much the collection contains.")
    stands: StandCounts = Field(description="How much the stands contain, which were stored from files.")
    systems: list[str] = Field(
        description="Coordinate reference systems of the map frames and of the stands, each once, as codes or names."
    )
    created: _Written = Field(description="When the collection was created.")
    updated: _Written = Field(description="When the collection was last written to.")
    links: CollectionLinks = Field(description="Paths of the collection and its parts.")


class Collection(CollectionSummary):
    """A collection, with its configuration and extent."""

    frames: dict[str, MapFrame] = Field(description=_FRAMES)
    config: dict[str, Any] = Field(description="All parameters of the method, including those with default values.")
    extent: Extent = Field(description="The area and the time that the submaps cover.")


class CollectionPage(Answer):
    """A page of collections."""

    collections: list[CollectionSummary] = Field(description="The collections of the page, oldest first.")
    next: str | None = Field(None, description=NEXT)


COLLECTION_EXAMPLE: dict[str, Any] = {
    "id": "plots",
    "title": "Plots of 2026",
    "crs": "EPSG:32633",
    "origin": [412000.0, 5820000.0],
    "fingerprint": "5e2f0c9a41d7",
    "revision": 12,
    "counts": {"submaps": 12, "landmarks": 1034, "polygons": 251},
    "stands": {"stands": 1, "trees": 584},
    "systems": ["EPSG:32633"],
    "created": "2026-05-04T09:30:00Z",
    "updated": "2026-05-04T11:02:13Z",
    "links": {
        "self": "/v1/collections/plots",
        "submaps": "/v1/collections/plots/submaps",
        "queries": "/v1/collections/plots/queries",
    },
    "frames": {"stand-7": {"crs": "EPSG:32633", "origin": [415200.0, 5821500.0]}},
    "config": {},
    "extent": {
        "spatial": [{"frame_id": "map", "bbox": [-40.2, -38.9, 161.0, 140.4]}],
        "temporal": ["2026-05-04T09:30:00Z", "2026-05-04T11:00:00Z"],
    },
}


class StandLinks(Answer):
    """Paths of a stand and its collection."""

    self: str = Field(description="Path of the stand.")
    collection: str = Field(description="Path of the stand's collection.")


class Stand(Answer):
    """What was stored from one stem map, and is replaced and deleted as a whole."""

    name: str = Field(description="Name of the stand: that of the file, without its suffix.")
    frame_id: str = Field(description="Map frame of the stand's submaps.")
    crs: str | None = Field(description="Coordinate reference system of that map frame. Null if it has none.")
    origin: Point | None = Field(
        description="Easting and northing, in metres, of the map frame's origin in the CRS. Null if it has none."
    )
    trees: int = Field(description="Number of trees in the file.")
    submaps: int = Field(
        description="Number of the stand's submaps. A PUT of a submap takes it out of its stand, a DELETE removes it."
    )
    radius: float = Field(description="Radius of a submap, in metres.")
    spacing: float = Field(description="Distance between the centres of neighbouring submaps, in metres.")
    source_hash: str | None = Field(description="BLAKE2b digest of the file, 12 bytes in hexadecimal. Null if unknown.")
    source_crs: str | None = Field(
        description="Coordinate reference system of the trees' positions, as the file or `--crs` names it. Null if "
        "unknown. To show the stand on a map, give it to the map frame: PATCH the collection's `frames`."
    )
    trees_hash: str = Field(
        description="Digest of the trees' positions, whatever their order. Stands with equal digests have equal trees."
    )
    created: _Written = Field(description="When a stand of this name was first stored.")
    updated: _Written = Field(description="When the stand was last stored.")
    etag: str = Field(description="Entity tag of the stand.")
    links: StandLinks = Field(description="Paths of the stand and its collection.")


class StandMove(DefaultedBody):
    """How all submaps of a stand move together in their map frame: turned about a point, then shifted."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"shift": [-4.2, 2.71], "yaw": -0.026}]})

    shift: tuple[Metres, Metres] = Field(
        (0.0, 0.0), description="How far to shift along x (east) and y (north) of the map frame, in metres."
    )
    yaw: Yaw = Field(0.0, description="How far to turn, in radians, counter-clockwise.")
    about: Point | None = Field(
        None,
        description="Point of the map frame that the stand turns about, in metres. Default: the middle of the box "
        "around its submaps.",
    )


class StandReceipt(Stand):
    """A stand that was stored from a file, and how the file was understood."""

    understood: str = Field(
        description="What was read as what, such as units, what is not used, and what is in no submap and why."
    )
    assumed: list[Assumed] = Field(default_factory=list, description=ASSUMED)
    rows: FileRows = Field(description="How many rows of the file were read, and how many were left out and why.")


class StandPage(Answer):
    """A page of stands."""

    stands: list[Stand] = Field(description="The stands of the page, in the order they were first stored.")
    next: str | None = Field(None, description=NEXT)


STAND_EXAMPLE: dict[str, Any] = {
    "name": "stand-7",
    "frame_id": "stand-7",
    "crs": "EPSG:32633",
    "origin": [415200.0, 5821500.0],
    "trees": 584,
    "submaps": 30,
    "radius": 30.0,
    "spacing": 20.0,
    "source_hash": "9f1c02b7a3d85e6471c0aa52",
    "source_crs": None,
    "trees_hash": "4be0617f3c9d2a85e1f06b37",
    "created": "2026-05-04T09:30:00Z",
    "updated": "2026-05-11T08:12:45Z",
    "etag": "c81d4e2ea0b1f5d6937a2c40",
    "links": {"self": "/v1/collections/plots/stands/stand-7", "collection": "/v1/collections/plots"},
}
STAND_RECEIPT_EXAMPLE: dict[str, Any] = STAND_EXAMPLE | {
    "understood": "read tree_id from 'tag', x_m from 'x', y_m from 'y'; 2 grid points skipped (fewer than 10 trees); "
    "3 trees merged with a thicker neighbour within 1 cm",
    "assumed": [],
    "rows": {"read": 584, "skipped": 0, "further_stems": 0, "merged": 3},
}
