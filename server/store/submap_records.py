"""Records of submaps: as they are stored, as they are to be stored, and the parts that searches and answers read."""

from dataclasses import asdict, dataclass, fields
from datetime import datetime
from typing import Any

from server.store.codec import members_of, unpack_attributes


@dataclass(frozen=True, slots=True)
class Place:
    """A submap's pose in a map and its footprint there, metres and radians."""

    map_frame_id: str
    map_x: float
    map_y: float
    map_yaw: float
    map_covariance: list[float] | None
    map_min_x: float
    map_min_y: float
    map_max_x: float
    map_max_y: float


@dataclass(frozen=True, slots=True)
class SubmapFields:
    """What a submap has beside its landmarks, stored or not.

    Attributes:
        place: where it is in a map, None if that is not known.
        landmarks_hash: of the positions; etag: of the whole content.
    """

    id: str
    frame_id: str | None
    session: str | None
    stamp: datetime | None
    landmark_count: int
    polygon_count: int
    counts: dict[str, int]
    place: Place | None
    properties: dict[str, Any] | None
    landmarks_hash: str
    etag: str


@dataclass(frozen=True, slots=True)
class SubmapMetadata(SubmapFields):
    """A stored submap without its landmarks.

    Attributes:
        key: never given to another submap.
        stand_key: the stand that stored it, None for a submap of none.
        revision: the collection's at the last write; content_revision: at the last write of positions or diameters.
    """

    key: int
    stand_key: int | None
    revision: int
    content_revision: int
    created: datetime
    updated: datetime


@dataclass(frozen=True, slots=True)
class SubmapContent(SubmapMetadata):
    """A stored submap with its landmarks, packed by `codec`; ids and attributes are None where there are none."""

    landmarks: bytes
    landmark_ids: bytes | None
    attributes: bytes | None


@dataclass(frozen=True, slots=True)
class SubmapWhole(SubmapContent):
    """A stored submap with its landmarks and its packed features."""

    features: bytes


@dataclass(frozen=True, slots=True)
class SubmapRecord(SubmapFields):
    """A submap as it is to be stored; the blobs are little-endian float64 (N, 2), JSON, JSON and packed features.

    `features` is None where landmarks and diameters, and with them the features, are those that are stored already.
    `stand_key` names the stand that stores it, None for a submap that belongs to none.
    """

    landmarks: bytes
    landmark_ids: bytes | None
    attributes: bytes | None
    features: bytes | None
    stand_key: int | None = None

    def members(self) -> frozenset[str]:
        """The optional members that it has, by their names in the API."""
        return members_of(self.frame_id, self.session, self.stamp, self.place, self.properties, self.landmark_ids) | (
            unpack_attributes(self.attributes).keys()
        )

    def columns(self) -> dict[str, Any]:
        """Values by column name."""
        values = {name: getattr(self, name) for name in _COLUMNS}
        return values | (asdict(self.place) if self.place is not None else _NO_PLACE)


@dataclass(frozen=True, slots=True)
class Identity:
    """What a write has to know about the submap it may replace."""

    key: int
    etag: str
    landmarks_hash: str
    landmark_count: int
    polygon_count: int
    revision: int
    counts: dict[str, int]
    attributes: bytes | None


@dataclass(frozen=True, slots=True)
class StoredFeatures:
    """A submap's packed features, with the landmarks and attributes that they were made of.

    `content_revision` is the collection's at the last change of these.
    """

    key: int
    content_revision: int
    features: bytes
    landmarks: bytes
    attributes: bytes | None


@dataclass(frozen=True, slots=True)
class FoundSubmap:
    """A submap as a candidate's answer needs it; `landmarks` are empty where they were not read."""

    key: int
    id: str
    session: str | None
    stamp: datetime | None
    frame_id: str | None
    landmark_count: int
    content_revision: int
    landmark_ids: bytes | None
    place: Place | None
    landmarks: bytes


@dataclass(frozen=True, slots=True)
class SubmapFilter:
    """Which submaps of a collection: all that is given must hold."""

    session: str | None = None
    bbox: tuple[float, float, float, float] | None = None
    map_frame_id: str | None = None
    since: datetime | None = None
    until: datetime | None = None


_NO_PLACE: dict[str, Any] = dict.fromkeys(Place.__slots__)
_COLUMNS = tuple(one.name for one in fields(SubmapRecord) if one.name != "place")
