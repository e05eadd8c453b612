"""The index on disk: which segment files hold what of each collection, and which deletions are forgotten."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the list of segments, empty: they are made of the submaps that are there."""
    op.create_table(
        "segments",
        sa.Column("key", sa.Integer(), nullable=False),
        sa.Column("collection_key", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("since", sa.Integer(), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("submaps", sa.Integer(), nullable=False),
        sa.Column("bytes", sa.Integer(), nullable=False),
        sa.Column("created", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["collection_key"],
            ["collections.key"],
            name="fk_segments_collection_key_collections",
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("key", name="pk_segments"),
        sa.UniqueConstraint("name", name="uq_segments_name"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_segments_collection_key_since", "segments", ["collection_key", "since"])
    op.add_column("collections", sa.Column("pruned_revision", sa.Integer(), nullable=False, server_default="0"))


def downgrade() -> None:
    """Forget the segments: an index is then made of all submaps, and needs no deletion of before."""
    op.drop_column("collections", "pruned_revision")
    op.drop_index("ix_segments_collection_key_since", "segments")
    op.drop_table("segments")
