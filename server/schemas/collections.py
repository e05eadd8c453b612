"""Bodies of the collection routes."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainSerializer

from server.schemas.common import Answer, Body, Counts, Free, Label, Metres, Point, write_stamp

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
_Title = Annotated[str, Field(min_length=1, max_length=500)]
_Crs = Annotated[str, Field(min_length=1, max_length=500)]
_CRS = "Projected coordinate reference system in metres of poses in the map frame 'map', such as 'EPSG:32633'."
_ORIGIN = (
    "Easting and northing, metres, of the origin of the map frame 'map' in the CRS: keeps map poses small. "
    "Leave it out where poses are in full coordinates of the CRS."
)
_FRAMES = "CRS and origin of each map frame other than 'map', by the frame's name."
_MOST = 5_000
"""Frames that one request names at most."""
_CONFIG = "Parameters of the method; those left out have their defaults."


class MapFrame(Body):
    """Where a map frame is on Earth."""

    crs: _Crs = Field(description="Projected coordinate reference system in metres, such as 'EPSG:32633'.")
    origin: tuple[Metres, Metres] | None = Field(
        None,
        description="Easting and northing, metres, of the frame's origin in the CRS. Leave it out where poses are in "
        "full coordinates of the CRS.",
    )


class CollectionPut(Body):
    """A collection to make. Fields left out have no opinion on a collection that exists."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{}, {"title": "Plots of 2026", "crs": "EPSG:32633", "origin": [412000.0, 5820000.0]}]
        }
    )

    title: _Title | None = Field(None, description="A name for people.")
    config: Free | None = Field(None, description=_CONFIG)
    crs: _Crs | None = Field(None, description=_CRS)
    origin: tuple[Metres, Metres] | None = Field(None, description=_ORIGIN)
    frames: Annotated[dict[Label, MapFrame], Field(max_length=_MOST)] | None = Field(None, description=_FRAMES)


class CollectionPatch(Body):
    """Fields to change; null clears a field, one left out stays."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"title": "Plots of 2026, north"},
                {"frames": {"stand-7": {"crs": "EPSG:32633", "origin": [415200.0, 5821500.0]}, "stand-8": None}},
            ]
        }
    )

    title: _Title | None = Field(None, description="A name for people.")
    config: Free | None = Field(None, description="Must be what the collection has: it cannot be changed.")
    crs: _Crs | None = Field(None, description=_CRS)
    origin: tuple[Metres, Metres] | None = Field(None, description=_ORIGIN)
    frames: Annotated[dict[Label, MapFrame | None], Field(max_length=_MOST)] | None = Field(
        None, description=f"{_FRAMES} A frame that is not named stays as it is, null takes its CRS away."
    )


class SpatialExtent(Answer):
    """Bounding box of the footprints in one map frame, metres."""

    frame_id: Label
    bbox: tuple[float, float, float, float] = Field(description="The box as min x, min y, max x, max y.")


class Extent(Answer):
    """What a collection covers."""

    spatial: list[SpatialExtent] = Field(description="One entry per map frame; empty when no submap has a map_pose.")
    temporal: tuple[_Written, _Written] | None = Field(description="First and last stamp.")


class CollectionLinks(Answer):
    """Where to go from a collection."""

    self: str
    submaps: str
    queries: str


class CollectionSummary(Answer):
    """A collection, as in a list."""

    id: str
    title: str | None
    crs: str | None
    origin: Point | None
    fingerprint: str = Field(description="Stands for the configuration that features are made with.")
    revision: int = Field(description="Moves on by one with every write.")
    counts: Counts
    created: _Written
    updated: _Written
    links: CollectionLinks


class Collection(CollectionSummary):
    """A collection."""

    frames: dict[str, MapFrame] = Field(description=_FRAMES)
    config: dict[str, Any]
    extent: Extent


class CollectionPage(Answer):
    """A page of collections."""

    collections: list[CollectionSummary]
    next: str | None = Field(None, description="Cursor of the next page; not there on the last.")


COLLECTION_EXAMPLE: dict[str, Any] = {
    "id": "plots",
    "title": "Plots of 2026",
    "crs": "EPSG:32633",
    "origin": [412000.0, 5820000.0],
    "fingerprint": "5e2f0c9a41d7",
    "revision": 12,
    "counts": {"submaps": 12, "landmarks": 1034, "polygons": 251},
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
