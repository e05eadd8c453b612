"""What the repositories take and give: the rows of the database as frozen dataclasses, without SQL.

A record is a snapshot. It does not change when its row does; read it again for that.
"""

from dataclasses import asdict, dataclass, field
from datetime import datetime
from typing import Any

from server.store.codec import members_of, unpack_attributes


@dataclass(frozen=True, slots=True)
class CollectionRecord:
    """A collection.

    Attributes:
        key: never given to another collection, even after this one is gone.
        config: the method's configuration, as far as it was chosen.
        fingerprint: of the configuration; features with another one are not compared.
        crs, origin_x, origin_y: where the default map frame is on Earth; easting and northing in metres.
        revision: raised by every write.
        query_sequence: the number of the last stored query.
        pruned_revision: deletions up to this revision are forgotten.
    """

    key: int
    id: str
    title: str | None
    config: dict[str, Any]
    fingerprint: str
    crs: str | None
    origin_x: float | None
    origin_y: float | None
    revision: int
    submap_count: int
    landmark_count: int
    polygon_count: int
    query_sequence: int
    pruned_revision: int
    created: datetime
    updated: datetime

    @property
    def origin(self) -> tuple[float, float] | None:
        """Easting and northing, metres; None for (0, 0)."""
        return None if self.origin_x is None or self.origin_y is None else (self.origin_x, self.origin_y)


@dataclass(frozen=True, slots=True)
class ApiKeyRecord:
    """An API key. `digest` is the SHA-256 of its secret, which is stored nowhere; `id` is the part that may be shown.

    `expires` and `revoked` are None for a key that never expires or was not revoked.
    """

    id: str
    name: str
    digest: bytes = field(repr=False)
    scopes: tuple[str, ...]
    patterns: tuple[str, ...]
    created: datetime
    expires: datetime | None
    revoked: datetime | None

    def state(self, now: datetime) -> str:
        """`usable`, `expired` or `revoked`."""
        if self.revoked is not None:
            return "revoked"
        return "expired" if self.expires is not None and self.expires <= now else "usable"


@dataclass(frozen=True, slots=True)
class ResponseRecord:
    """The response to a write with an Idempotency-Key, to be sent again to whoever repeats the write.

    Attributes:
        caller: id of the API key, empty without one.
        operation: what was done to what, such as `deleteSubmap plots/p7`.
        name: the Idempotency-Key.
        digest: hex SHA-256 of everything that was sent.
        status, headers, body: the response.
    """

    caller: str
    operation: str
    name: str
    digest: str
    status: int
    headers: dict[str, str]
    body: bytes


@dataclass(frozen=True, slots=True)
class JobRecord:
    """Long work, as it is stored. `counts` and `progress` belong to the type of job; do not change them in place.

    Attributes:
        key: in the order in which jobs came.
        kind: the type of job.
        collection_id: the name of its collection, which may be another collection's by now.
        collection_key: the collection itself, which may be gone.
        caller: id of the API key that began it, empty without one.
        state: accepted, running, successful, failed or dismissed.
        total: steps in all, None if that is not known.
        progress: where a restart goes on.
        problem: why it failed or was dismissed, as a problem document.
        dismissed: whether somebody wants it ended.
    """

    key: int
    id: str
    kind: str
    collection_id: str
    collection_key: int
    caller: str
    state: str
    parameters: dict[str, Any]
    total: int | None
    done: int
    counts: dict[str, int]
    progress: dict[str, Any]
    problem: dict[str, Any] | None
    dismissed: bool
    created: datetime
    started: datetime | None
    finished: datetime | None


@dataclass(frozen=True, slots=True)
class QueryRecord:
    """A stored query.

    Attributes:
        number: counts up within the collection.
        candidates: the method's own, as JSON, by landmark positions, which no later renaming of landmarks touches.
        landmarks: positions, float64 (N, 2), metres, query frame, packed by `codec`.
        landmark_ids: as packed JSON; None if they are the positions in the list.
        answer: as it was given, JSON.
    """

    number: int
    candidates: list[dict[str, Any]]
    landmarks: bytes
    landmark_ids: bytes | None
    answer: bytes


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


_NO_PLACE: dict[str, Any] = dict.fromkeys(Place.__slots__)


@dataclass(frozen=True, slots=True)
class SubmapMetadata:
    """A stored submap without its landmarks.

    Attributes:
        key: never given to another submap.
        place: where it is in a map, None if that is not known.
        stand_key: the stand that stored it, None for a submap of none.
        landmarks_hash: of the positions; etag: of the whole content.
        revision: the collection's at the last write; content_revision: at the last write of positions or diameters.
    """

    key: int
    id: str
    frame_id: str | None
    session: str | None
    stamp: datetime | None
    landmark_count: int
    polygon_count: int
    counts: dict[str, int]
    place: Place | None
    properties: dict[str, Any] | None
    stand_key: int | None
    landmarks_hash: str
    etag: str
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
class SubmapRecord:
    """A submap as it is to be stored; the blobs are little-endian float64 (N, 2), JSON, JSON and packed features.

    `features` is None where landmarks and diameters, and with them the features, are those that are stored already.
    `stand_key` names the stand that stores it, None for a submap that belongs to none.
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
        values = {name: getattr(self, name) for name in self.__slots__ if name != "place"}
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
