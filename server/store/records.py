"""What the repositories take and give: rows as frozen dataclasses, without SQL. Collections and what they own.

A record does not change when its row does; read it again for that. `submap_records` has those of submaps,
`service_records` those of keys, jobs and responses.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final, NamedTuple


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
class CollectionSize:
    """How much is in a collection."""

    id: str
    submaps: int
    landmarks: int
    revision: int


@dataclass(frozen=True, slots=True)
class FrameExtent:
    """What a collection covers in one map frame: metres, footprints of the submaps' landmarks."""

    frame_id: str
    min_x: float
    min_y: float
    max_x: float
    max_y: float


DEFAULT_FRAME: Final = "map"
"""The map frame of poses that name none; the collection's own crs and origin are this frame's."""


@dataclass(frozen=True, slots=True)
class FrameReference:
    """The system of a map frame's coordinates, and its origin there: easting and northing, metres; None for (0, 0)."""

    crs: str
    origin: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class SegmentRecord:
    """A segment as it is listed.

    Attributes:
        name: of the file, without its ending; never used twice.
        since, revision: it holds the submaps whose landmarks last changed after the one and up to the other.
        submaps: how many are in the file, those that are gone since included.
        size: of the file, in bytes.
    """

    name: str
    since: int
    revision: int
    submaps: int
    size: int


def trusted(chain: Sequence[SegmentRecord]) -> int:
    """How many segments, from the first one on, make a chain without a gap."""
    end = 0
    for i, segment in enumerate(chain):
        if segment.since != end or segment.revision <= segment.since:
            return i
        end = segment.revision
    return len(chain)


@dataclass(frozen=True, slots=True)
class StandRecord:
    """A stand as it is to be stored.

    Attributes:
        frame_id: the map frame of its submaps.
        source_hash: of the file as it was read; trees_hash: of the trees' positions, whatever their order.
        radius, spacing: of the grid of discs, metres.
        crs: coordinate reference system of the positions, as the file names it; None if that is not known.
    """

    name: str
    frame_id: str
    source_hash: str
    trees_hash: str
    tree_count: int
    radius: float
    spacing: float
    crs: str | None


@dataclass(frozen=True, slots=True)
class StoredStand(StandRecord):
    """A stand as it is stored; its submaps refer to its `key`.

    Attributes:
        created, updated: when it was stored first, and last.
    """

    key: int
    created: datetime
    updated: datetime


@dataclass(frozen=True, slots=True)
class CountedStand(StoredStand):
    """A stand with the number of its submaps now: a PUT takes a submap out of its stand."""

    submap_count: int


@dataclass(frozen=True, slots=True)
class StandTotals:
    """The stands of a collection together: their number, the trees of their files, and the coordinate reference systems
    of these and of the collection's map frames, by code or name."""

    stands: int
    trees: int
    systems: tuple[str, ...]


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


class SessionMember(NamedTuple):
    """A submap of a session: its key, its id, and the revision of the collection when its landmarks were stored."""

    key: int
    id: str
    content_revision: int


@dataclass(frozen=True, slots=True)
class SessionRecord:
    """A session of a collection; `first` and `last` stamp are None where none of its submaps has one."""

    session: str
    submaps: int
    landmarks: int
    first: datetime | None
    last: datetime | None
