"""The tables of collections and what is in them. Migrations are written by hand; a test holds them to the tables.

Every table is STRICT, and its rules say what a row cannot be: SQLite refuses other rows, whoever writes them.
`service_tables` has the other tables.
"""

from datetime import datetime
from typing import Any

from sqlalchemy import (
    REAL,
    Computed,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    Integer,
    LargeBinary,
    Text,
    UniqueConstraint,
    text,
)
from sqlalchemy.orm import Mapped, mapped_column

from server.store.columns import (
    KEYS_ONCE,
    STRICT,
    BaseRow,
    Instant,
    Json,
    are_moments,
    holds_json,
    holds_packed_json,
    rule,
)

_WHOLE_POSE = (
    "(map_frame_id IS NULL) + (map_x IS NULL) + (map_y IS NULL) + (map_yaw IS NULL) + (map_min_x IS NULL) "
    "+ (map_min_y IS NULL) + (map_max_x IS NULL) + (map_max_y IS NULL) IN (0, 8) "
    "AND (map_covariance IS NULL OR map_frame_id IS NOT NULL)"
)


class CollectionRow(BaseRow):
    """Submaps that share a configuration. Counts live here so that reading them never scans."""

    __tablename__ = "collections"
    # Live indexes are known by the collection's key, which is not given out again.
    __table_args__ = (
        rule(
            "counts_from_zero",
            "min(revision, submap_count, landmark_count, polygon_count, query_sequence, pruned_revision) >= 0",
        ),
        rule("pruned_up_to_its_revision", "pruned_revision <= revision"),
        rule("whole_origin", "(origin_x IS NULL) = (origin_y IS NULL)"),
        holds_json("config", "object"),
        are_moments("created", "updated"),
        KEYS_ONCE,
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    id: Mapped[str] = mapped_column(Text, unique=True)
    title: Mapped[str | None] = mapped_column(Text)
    config: Mapped[dict[str, Any]] = mapped_column(Json)
    fingerprint: Mapped[str] = mapped_column(Text)
    crs: Mapped[str | None] = mapped_column(Text)
    origin_x: Mapped[float | None] = mapped_column(REAL)
    origin_y: Mapped[float | None] = mapped_column(REAL)
    revision: Mapped[int] = mapped_column(Integer)
    submap_count: Mapped[int] = mapped_column(Integer)
    landmark_count: Mapped[int] = mapped_column(Integer)
    polygon_count: Mapped[int] = mapped_column(Integer)
    query_sequence: Mapped[int] = mapped_column(Integer)
    # Deletions up to here are forgotten; see DeletionRow.
    pruned_revision: Mapped[int] = mapped_column(Integer)
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
        Index(None, "collection_key", "stand_key", sqlite_where=text("stand_key IS NOT NULL")),
        # A stand of its own collection.
        ForeignKeyConstraint(["collection_key", "stand_key"], ["stands.collection_key", "stands.key"]),
        rule("whole_map_pose", _WHOLE_POSE),
        rule("map_box_in_order", "map_min_x <= map_max_x AND map_min_y <= map_max_y"),
        rule("counts_from_zero", "polygon_count >= 0"),
        rule("positions_of_every_landmark", "length(landmarks) = 16 * landmark_count"),
        rule("revisions_in_order", "0 < content_revision AND content_revision <= revision"),
        holds_json("counts", "object"),
        holds_json("map_covariance", "array", optional=True),
        holds_json("properties", "object", optional=True),
        holds_packed_json("landmark_ids", optional=True),
        holds_packed_json("attributes", optional=True),
        are_moments("stamp", "created", "updated"),
        KEYS_ONCE,
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    id: Mapped[str] = mapped_column(Text)
    frame_id: Mapped[str | None] = mapped_column(Text)
    session: Mapped[str | None] = mapped_column(Text)
    stamp: Mapped[datetime | None] = mapped_column(Instant)
    landmark_count: Mapped[int] = mapped_column(Integer)
    polygon_count: Mapped[int] = mapped_column(Integer)
    counts: Mapped[dict[str, int]] = mapped_column(Json)
    map_frame_id: Mapped[str | None] = mapped_column(Text)
    map_x: Mapped[float | None] = mapped_column(REAL)
    map_y: Mapped[float | None] = mapped_column(REAL)
    map_yaw: Mapped[float | None] = mapped_column(REAL)
    map_covariance: Mapped[list[float] | None] = mapped_column(Json)
    map_min_x: Mapped[float | None] = mapped_column(REAL)
    map_min_y: Mapped[float | None] = mapped_column(REAL)
    map_max_x: Mapped[float | None] = mapped_column(REAL)
    map_max_y: Mapped[float | None] = mapped_column(REAL)
    map_width: Mapped[float | None] = mapped_column(REAL, Computed("map_max_x - map_min_x", persisted=False))
    properties: Mapped[dict[str, Any] | None] = mapped_column(Json)
    # The stand that stored it as one of its discs.
    stand_key: Mapped[int | None] = mapped_column(Integer)
    landmarks_hash: Mapped[str] = mapped_column(Text)
    etag: Mapped[str] = mapped_column(Text)
    revision: Mapped[int] = mapped_column(Integer)
    content_revision: Mapped[int] = mapped_column(Integer)
    created: Mapped[datetime] = mapped_column(Instant)
    updated: Mapped[datetime] = mapped_column(Instant)
    # Large columns last: SQLite then reads the small ones without following overflow pages.
    landmarks: Mapped[bytes] = mapped_column(LargeBinary)
    landmark_ids: Mapped[bytes | None] = mapped_column(LargeBinary)
    attributes: Mapped[bytes | None] = mapped_column(LargeBinary)
    features: Mapped[bytes] = mapped_column(LargeBinary)


class StandRow(BaseRow):
    """What was stored as one thing, such as the discs of one stem map; it is replaced as a whole.

    `frame_id` is the map frame of its submaps, `source_hash` the digest of the file as it was read, `trees_hash` that
    of the trees' positions whatever their order; radius and spacing are those of the grid of discs, metres. `crs` is
    the coordinate reference system of the positions, as the file names it, NULL if that is not known.
    """

    __tablename__ = "stands"
    __table_args__ = (
        UniqueConstraint("collection_key", "name"),
        UniqueConstraint("collection_key", "key"),  # what submaps refer to
        rule("sizes_of_a_grid", "tree_count >= 0 AND radius > 0 AND spacing > 0"),
        are_moments("created", "updated"),
        KEYS_ONCE,
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    name: Mapped[str] = mapped_column(Text)
    frame_id: Mapped[str] = mapped_column(Text)
    source_hash: Mapped[str] = mapped_column(Text)
    trees_hash: Mapped[str] = mapped_column(Text)
    tree_count: Mapped[int] = mapped_column(Integer)
    radius: Mapped[float] = mapped_column(REAL)
    spacing: Mapped[float] = mapped_column(REAL)
    created: Mapped[datetime] = mapped_column(Instant)
    updated: Mapped[datetime] = mapped_column(Instant)
    crs: Mapped[str | None] = mapped_column(Text)


class MapFrameRow(BaseRow):
    """Where a map frame other than the default one is on Earth: its system, and its origin there in metres."""

    __tablename__ = "map_frames"
    __table_args__ = (rule("whole_origin", "(origin_x IS NULL) = (origin_y IS NULL)"), STRICT)

    collection_key: Mapped[int] = mapped_column(
        ForeignKey("collections.key", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    frame_id: Mapped[str] = mapped_column(Text, primary_key=True)
    crs: Mapped[str] = mapped_column(Text)
    origin_x: Mapped[float | None] = mapped_column(REAL)
    origin_y: Mapped[float | None] = mapped_column(REAL)


class DeletionRow(BaseRow):
    """A submap that is gone, so that the live index of every process can drop it too.

    Forgotten once no segment can hold the submap any more: when the collection's first one was made later.
    """

    __tablename__ = "deletions"
    __table_args__ = (Index(None, "collection_key", "revision"), rule("revision_from_one", "revision > 0"), STRICT)

    submap_key: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    revision: Mapped[int] = mapped_column(Integer)


class SegmentRow(BaseRow):
    """A file of the index: the submaps whose `content_revision` is after `since` and up to `revision`.

    Rows of a collection make a chain: the first begins at 0, and each of the others where the one before it ends. What
    was changed or deleted after the file was written is still in it; whoever reads it leaves that out.
    """

    __tablename__ = "segments"
    __table_args__ = (
        Index(None, "collection_key", "since"),
        rule("revisions_in_order", "0 <= since AND since < revision"),
        rule("counts_from_zero", "submaps >= 0 AND bytes >= 0"),
        are_moments("created"),
        KEYS_ONCE,
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    name: Mapped[str] = mapped_column(Text, unique=True)
    since: Mapped[int] = mapped_column(Integer)
    revision: Mapped[int] = mapped_column(Integer)
    submaps: Mapped[int] = mapped_column(Integer)
    size: Mapped[int] = mapped_column("bytes", Integer, key="size")
    created: Mapped[datetime] = mapped_column(Instant)


class QueryRow(BaseRow):
    """A stored query. `number` counts up within its collection: one that was given out but has no row is gone."""

    __tablename__ = "queries"
    __table_args__ = (
        UniqueConstraint("collection_key", "number"),
        rule("number_from_one", "number > 0"),
        rule("whole_positions", "length(landmarks) % 16 = 0"),
        holds_json("candidates", "array"),
        holds_packed_json("landmark_ids", optional=True),
        holds_packed_json("answer"),
        are_moments("created"),
        KEYS_ONCE,
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    number: Mapped[int] = mapped_column(Integer)
    created: Mapped[datetime] = mapped_column(Instant)
    candidates: Mapped[list[dict[str, Any]]] = mapped_column(Json)
    landmarks: Mapped[bytes] = mapped_column(LargeBinary)
    landmark_ids: Mapped[bytes | None] = mapped_column(LargeBinary)
    answer: Mapped[bytes] = mapped_column(LargeBinary)
