"""The tables. Migrations are written by hand; a test holds them to what stands here."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import (
    JSON,
    Boolean,
    ColumnElement,
    Computed,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    Text,
    UniqueConstraint,
    false,
    literal_column,
    or_,
    text,
)
from sqlalchemy.orm import InstrumentedAttribute, Mapped, mapped_column

from server.store.columns import BaseRow, Instant


class CollectionRow(BaseRow):
    """Submaps that share a configuration. Counts live here so that reading them never scans."""

    __tablename__ = "collections"
    # AUTOINCREMENT: the key of a dropped collection must not come back, live indexes are known by it.
    __table_args__ = {"sqlite_autoincrement": True}  # noqa: RUF012

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    id: Mapped[str] = mapped_column(Text, unique=True)
    title: Mapped[str | None] = mapped_column(Text)
    config: Mapped[dict[str, Any]] = mapped_column(JSON)
    fingerprint: Mapped[str] = mapped_column(Text)
    crs: Mapped[str | None] = mapped_column(Text)
    origin_x: Mapped[float | None] = mapped_column(Float)
    origin_y: Mapped[float | None] = mapped_column(Float)
    revision: Mapped[int] = mapped_column(Integer)
    submap_count: Mapped[int] = mapped_column(Integer)
    landmark_count: Mapped[int] = mapped_column(Integer)
    polygon_count: Mapped[int] = mapped_column(Integer)
    query_sequence: Mapped[int] = mapped_column(Integer)
    # Deletions up to here are forgotten; see DeletionRow.
    pruned_revision: Mapped[int] = mapped_column(Integer, server_default="0")
    created: Mapped[datetime] = mapped_column(Instant)
    updated: Mapped[datetime] = mapped_column(Instant)


class SubmapRow(BaseRow):
    """Landmarks in one rigid frame, with the features made of them.

    `revision` is the collection's at the last write of any kind, `content_revision` at the last one that
    changed landmark positions or diameters: only those concern the live index.
    """

    __tablename__ = "submaps"
    __table_args__ = (
        UniqueConstraint("collection_key", "id"),
        Index(None, "collection_key", "content_revision"),
        # In the order of the keys, for pages.
        Index(None, "collection_key"),
        # With stamp and count, to tell when a session was and what it saw without reading its rows.
        Index(None, "collection_key", "session", "stamp", "landmark_count"),
        Index(None, "collection_key", "stamp"),
        # Covers the extent and the bbox filter.
        Index(
            "ix_submaps_footprint",
            "collection_key",
            "map_frame_id",
            "map_min_x",
            "map_min_y",
            "map_max_x",
            "map_max_y",
        ),
        # Its end is the widest footprint, which bounds how far a search by `map_min_x` goes.
        Index("ix_submaps_width", "collection_key", "map_frame_id", "map_width"),
        Index(None, "stand_key", sqlite_where=text("stand_key IS NOT NULL")),
        {"sqlite_autoincrement": True},
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    id: Mapped[str] = mapped_column(Text)
    frame_id: Mapped[str | None] = mapped_column(Text)
    session: Mapped[str | None] = mapped_column(Text)
    stamp: Mapped[datetime | None] = mapped_column(Instant)
    landmark_count: Mapped[int] = mapped_column(Integer)
    polygon_count: Mapped[int] = mapped_column(Integer)
    counts: Mapped[dict[str, int]] = mapped_column(JSON)
    map_frame_id: Mapped[str | None] = mapped_column(Text)
    map_x: Mapped[float | None] = mapped_column(Float)
    map_y: Mapped[float | None] = mapped_column(Float)
    map_yaw: Mapped[float | None] = mapped_column(Float)
    map_covariance: Mapped[list[float] | None] = mapped_column(JSON(none_as_null=True))
    map_min_x: Mapped[float | None] = mapped_column(Float)
    map_min_y: Mapped[float | None] = mapped_column(Float)
    map_max_x: Mapped[float | None] = mapped_column(Float)
    map_max_y: Mapped[float | None] = mapped_column(Float)
    map_width: Mapped[float | None] = mapped_column(
        Float, Computed("map_max_x - map_min_x", persisted=False), deferred=True
    )
    properties: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    landmarks_hash: Mapped[str] = mapped_column(Text)
    etag: Mapped[str] = mapped_column(Text)
    revision: Mapped[int] = mapped_column(Integer)
    content_revision: Mapped[int] = mapped_column(Integer)
    created: Mapped[datetime] = mapped_column(Instant)
    updated: Mapped[datetime] = mapped_column(Instant)
    # Large columns last: SQLite then reads the small ones without following overflow pages.
    landmarks: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    landmark_ids: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    attributes: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    features: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    # The stand that stored it as one of its discs. It stands behind the large columns, and without a constraint of its
    # own, because SQLite adds a column to a table only so; `db check` proves what a constraint would.
    stand_key: Mapped[int | None] = mapped_column(Integer, deferred=True)


class StandRow(BaseRow):
    """What was stored as one thing, such as the discs of one stem map; it is replaced as a whole.

    `frame_id` is the map frame of its submaps, `source_hash` the digest of the file as it was read, `trees_hash` that
    of the trees' positions whatever their order; radius and spacing are those of the grid of discs, metres.
    """

    __tablename__ = "stands"
    __table_args__ = (UniqueConstraint("collection_key", "name"), {"sqlite_autoincrement": True})

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    name: Mapped[str] = mapped_column(Text)
    frame_id: Mapped[str] = mapped_column(Text)
    source_hash: Mapped[str] = mapped_column(Text)
    trees_hash: Mapped[str] = mapped_column(Text)
    tree_count: Mapped[int] = mapped_column(Integer)
    radius: Mapped[float] = mapped_column(Float)
    spacing: Mapped[float] = mapped_column(Float)
    created: Mapped[datetime] = mapped_column(Instant)
    updated: Mapped[datetime] = mapped_column(Instant)


class MapFrameRow(BaseRow):
    """Where a map frame other than the default one is on Earth: its system, and its origin there in metres."""

    __tablename__ = "map_frames"

    collection_key: Mapped[int] = mapped_column(
        ForeignKey("collections.key", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    frame_id: Mapped[str] = mapped_column(Text, primary_key=True)
    crs: Mapped[str] = mapped_column(Text)
    origin_x: Mapped[float | None] = mapped_column(Float)
    origin_y: Mapped[float | None] = mapped_column(Float)


def beside_key(collection_key: Any) -> ColumnElement[bool]:
    """Whether a submap is of a collection, in a statement that names submaps by their keys.

    SQLite takes a list of keys for more work than an index that begins with the collection, and would read all of that.
    The plus keeps it from doing so.
    """
    same: ColumnElement[bool] = literal_column("+submaps.collection_key", Integer) == collection_key
    return same


class DeletionRow(BaseRow):
    """A submap that is gone, so that the live index of every process can drop it too.

    Forgotten once no segment can hold the submap any more: when the collection's first one was made later.
    """

    __tablename__ = "deletions"
    __table_args__ = (Index(None, "collection_key", "revision"),)

    submap_key: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    revision: Mapped[int] = mapped_column(Integer)


class SegmentRow(BaseRow):
    """A file of the index: the submaps whose `content_revision` is after `since` and up to `revision`.

    Rows of a collection make a chain: the first begins at 0, and each of the others where the one before it ends. What
    was changed or deleted after the file was written is still in it; whoever reads it leaves that out.
    """

    __tablename__ = "segments"
    __table_args__ = (Index(None, "collection_key", "since"), {"sqlite_autoincrement": True})

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    name: Mapped[str] = mapped_column(Text, unique=True)
    since: Mapped[int] = mapped_column(Integer)
    revision: Mapped[int] = mapped_column(Integer)
    submaps: Mapped[int] = mapped_column(Integer)
    size: Mapped[int] = mapped_column("bytes", Integer)
    created: Mapped[datetime] = mapped_column(Instant)


def matches(column: InstrumentedAttribute[str], patterns: Sequence[str]) -> ColumnElement[bool]:
    """Whether an id matches one of some shell patterns, as `Caller.sees` has it."""
    return or_(false(), *(column.op("GLOB")(pattern) for pattern in patterns))


class KeyRow(BaseRow):
    """An API key: its secret is not here, only the SHA-256 of it. `id` is the part of the key that may be shown."""

    __tablename__ = "api_keys"

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    id: Mapped[str] = mapped_column(Text, unique=True)
    name: Mapped[str] = mapped_column(Text)
    digest: Mapped[bytes] = mapped_column(LargeBinary)
    scopes: Mapped[list[str]] = mapped_column(JSON)
    patterns: Mapped[list[str]] = mapped_column(JSON)
    created: Mapped[datetime] = mapped_column(Instant)
    expires: Mapped[datetime | None] = mapped_column(Instant)
    revoked: Mapped[datetime | None] = mapped_column(Instant)


class JobRow(BaseRow):
    """Long work. It outlives the process that took it; a lock on a file tells whether somebody is at it.

    `collection_id` is a name, not a reference: the job is still listed when the collection is gone.
    """

    __tablename__ = "jobs"
    __table_args__ = (
        Index(None, "state", "key"),
        Index(None, "collection_id", "key"),
        {"sqlite_autoincrement": True},
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    id: Mapped[str] = mapped_column(Text, unique=True)
    kind: Mapped[str] = mapped_column(Text)
    collection_id: Mapped[str] = mapped_column(Text)
    collection_key: Mapped[int] = mapped_column(Integer)
    caller: Mapped[str] = mapped_column(Text)
    state: Mapped[str] = mapped_column(Text)
    parameters: Mapped[dict[str, Any]] = mapped_column(JSON)
    total: Mapped[int | None] = mapped_column(Integer)
    done: Mapped[int] = mapped_column(Integer)
    counts: Mapped[dict[str, int]] = mapped_column(JSON)
    # Where a restart goes on: what of the input is done, and how much of the results is written.
    progress: Mapped[dict[str, Any]] = mapped_column(JSON)
    problem: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    dismissed: Mapped[bool] = mapped_column(Boolean)
    created: Mapped[datetime] = mapped_column(Instant)
    started: Mapped[datetime | None] = mapped_column(Instant)
    finished: Mapped[datetime | None] = mapped_column(Instant)


class IdempotencyRow(BaseRow):
    """The answer to a POST that carried an Idempotency-Key, written with what the POST did, to be given again."""

    __tablename__ = "idempotency"
    __table_args__ = (UniqueConstraint("caller", "operation", "name"), Index(None, "created"))

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    caller: Mapped[str] = mapped_column(Text)
    operation: Mapped[str] = mapped_column(Text)
    name: Mapped[str] = mapped_column(Text)
    digest: Mapped[str] = mapped_column(Text)
    status: Mapped[int] = mapped_column(Integer)
    headers: Mapped[dict[str, str]] = mapped_column(JSON)
    body: Mapped[bytes] = mapped_column(LargeBinary)
    created: Mapped[datetime] = mapped_column(Instant)


class QueryRow(BaseRow):
    """A stored query. `number` counts up within its collection: one that was given out but has no row is gone."""

    __tablename__ = "queries"
    __table_args__ = (UniqueConstraint("collection_key", "number"), {"sqlite_autoincrement": True})

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    number: Mapped[int] = mapped_column(Integer)
    created: Mapped[datetime] = mapped_column(Instant)
    candidates: Mapped[list[dict[str, Any]]] = mapped_column(JSON)
    landmarks: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    landmark_ids: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    answer: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
