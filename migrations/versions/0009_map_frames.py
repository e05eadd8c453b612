"""A coordinate reference system and an origin for each map frame of a collection."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the table. The collection's own crs is that of the frame `map` from now on.

    A collection whose only map frame has another name meant that one, so it keeps its crs there. Where there are
    several, nobody knows which of them the crs was meant for: in all of them at once it was wrong.
    """
    op.create_table(
        "map_frames",
        sa.Column("collection_key", sa.Integer(), nullable=False),
        sa.Column("frame_id", sa.Text(), nullable=False),
        sa.Column("crs", sa.Text(), nullable=False),
        sa.Column("origin_x", sa.Float(), nullable=True),
        sa.Column("origin_y", sa.Float(), nullable=True),
        sa.PrimaryKeyConstraint("collection_key", "frame_id", name="pk_map_frames"),
        sa.ForeignKeyConstraint(
            ["collection_key"], ["collections.key"], name="fk_map_frames_collection_key_collections", ondelete="CASCADE"
        ),
    )
    op.execute(
        "INSERT INTO map_frames (collection_key, frame_id, crs, origin_x, origin_y) "
        "SELECT c.key, min(s.map_frame_id), c.crs, c.origin_x, c.origin_y "
        "FROM collections c JOIN submaps s ON s.collection_key = c.key "
        "WHERE c.crs IS NOT NULL AND s.map_frame_id IS NOT NULL "
        "GROUP BY c.key HAVING min(s.map_frame_id) = max(s.map_frame_id) AND min(s.map_frame_id) <> 'map'"
    )


def downgrade() -> None:
    """Without it: what only the frames knew is lost."""
    op.drop_table("map_frames")
