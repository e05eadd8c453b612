"""Indexes that tell how far a search about a place has to look, and how many trees a session saw."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the width of footprints, which is computed and takes no room but in its index; count trees by session."""
    op.add_column(
        "submaps",
        sa.Column("map_width", sa.Float(), sa.Computed("map_max_x - map_min_x", persisted=False), nullable=True),
    )
    op.create_index("ix_submaps_width", "submaps", ["collection_key", "map_frame_id", "map_width"])
    op.create_index(
        "ix_submaps_collection_key_session_stamp_landmark_count",
        "submaps",
        ["collection_key", "session", "stamp", "landmark_count"],
    )
    op.drop_index("ix_submaps_collection_key_session_stamp", "submaps")


def downgrade() -> None:
    """Without them."""
    op.create_index("ix_submaps_collection_key_session_stamp", "submaps", ["collection_key", "session", "stamp"])
    op.drop_index("ix_submaps_collection_key_session_stamp_landmark_count", "submaps")
    op.drop_index("ix_submaps_width", "submaps")
    op.drop_column("submaps", "map_width")
