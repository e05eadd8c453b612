"""Collections, submaps, deletions and stored queries."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the first tables."""
    op.create_table(
        "collections",
        sa.Column("key", sa.Integer(), nullable=False),
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("title", sa.Text(), nullable=True),
        sa.Column("config", sa.JSON(), nullable=False),
        sa.Column("fingerprint", sa.Text(), nullable=False),
        sa.Column("crs", sa.Text(), nullable=True),
        sa.Column("origin_x", sa.Float(), nullable=True),
        sa.Column("origin_y", sa.Float(), nullable=True),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("submap_count", sa.Integer(), nullable=False),
        sa.Column("landmark_count", sa.Integer(), nullable=False),
        sa.Column("polygon_count", sa.Integer(), nullable=False),
        sa.Column("query_sequence", sa.Integer(), nullable=False),
        sa.Column("created", sa.BigInteger(), nullable=False),
        sa.Column("updated", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_collections"),
        sa.UniqueConstraint("id", name="uq_collections_id"),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "submaps",
        sa.Column("key", sa.Integer(), nullable=False),
        sa.Column("collection_key", sa.Integer(), nullable=False),
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("frame_id", sa.Text(), nullable=True),
        sa.Column("session", sa.Text(), nullable=True),
        sa.Column("stamp", sa.BigInteger(), nullable=True),
        sa.Column("landmark_count", sa.Integer(), nullable=False),
        sa.Column("polygon_count", sa.Integer(), nullable=False),
        sa.Column("counts", sa.JSON(), nullable=False),
        sa.Column("map_frame_id", sa.Text(), nullable=True),
        sa.Column("map_x", sa.Float(), nullable=True),
        sa.Column("map_y", sa.Float(), nullable=True),
        sa.Column("map_yaw", sa.Float(), nullable=True),
        sa.Column("map_covariance", sa.JSON(), nullable=True),
        sa.Column("map_min_x", sa.Float(), nullable=True),
        sa.Column("map_min_y", sa.Float(), nullable=True),
        sa.Column("map_max_x", sa.Float(), nullable=True),
        sa.Column("map_max_y", sa.Float(), nullable=True),
        sa.Column("properties", sa.JSON(), nullable=True),
        sa.Column("landmarks_hash", sa.Text(), nullable=False),
        sa.Column("etag", sa.Text(), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("content_revision", sa.Integer(), nullable=False),
        sa.Column("created", sa.BigInteger(), nullable=False),
        sa.Column("updated", sa.BigInteger(), nullable=False),
        sa.Column("landmarks", sa.LargeBinary(), nullable=False),
        sa.Column("landmark_ids", sa.LargeBinary(), nullable=True),
        sa.Column("attributes", sa.LargeBinary(), nullable=True),
        sa.Column("features", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_submaps"),
        sa.ForeignKeyConstraint(
            ["collection_key"], ["collections.key"], name="fk_submaps_collection_key_collections", ondelete="CASCADE"
        ),
        sa.UniqueConstraint("collection_key", "id", name="uq_submaps_collection_key_id"),
        sqlite_autoincrement=True,
    )
    for column in ("content_revision", "session", "stamp"):
        op.create_index(f"ix_submaps_collection_key_{column}", "submaps", ["collection_key", column])
    op.create_index(
        "ix_submaps_footprint",
        "submaps",
        ["collection_key", "map_frame_id", "map_min_x", "map_min_y", "map_max_x", "map_max_y"],
    )
    op.create_table(
        "deletions",
        sa.Column("submap_key", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("collection_key", sa.Integer(), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("submap_key", name="pk_deletions"),
        sa.ForeignKeyConstraint(
            ["collection_key"], ["collections.key"], name="fk_deletions_collection_key_collections", ondelete="CASCADE"
        ),
    )
    op.create_index("ix_deletions_collection_key_revision", "deletions", ["collection_key", "revision"])
    op.create_table(
        "queries",
        sa.Column("key", sa.Integer(), nullable=False),
        sa.Column("collection_key", sa.Integer(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("created", sa.BigInteger(), nullable=False),
        sa.Column("candidates", sa.JSON(), nullable=False),
        sa.Column("landmarks", sa.LargeBinary(), nullable=False),
        sa.Column("landmark_ids", sa.LargeBinary(), nullable=True),
        sa.Column("answer", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_queries"),
        sa.ForeignKeyConstraint(
            ["collection_key"], ["collections.key"], name="fk_queries_collection_key_collections", ondelete="CASCADE"
        ),
        sa.UniqueConstraint("collection_key", "number", name="uq_queries_collection_key_number"),
        sqlite_autoincrement=True,
    )


def downgrade() -> None:
    """Drop everything."""
    for table in ("queries", "deletions", "submaps", "collections"):
        op.drop_table(table)
