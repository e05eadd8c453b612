"""Indexes from which pages come in order, and sessions come whole."""

from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Index submaps by collection, which is by key, too; and put the stamp beside the session."""
    op.create_index("ix_submaps_collection_key", "submaps", ["collection_key"])
    op.create_index("ix_submaps_collection_key_session_stamp", "submaps", ["collection_key", "session", "stamp"])
    op.drop_index("ix_submaps_collection_key_session", "submaps")


def downgrade() -> None:
    """The index by session alone again."""
    op.create_index("ix_submaps_collection_key_session", "submaps", ["collection_key", "session"])
    op.drop_index("ix_submaps_collection_key_session_stamp", "submaps")
    op.drop_index("ix_submaps_collection_key", "submaps")
