"""Stands: which submaps were stored as one thing, and are replaced as one."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the table of stands, and to each submap the stand that stored it; nobody knows that of older ones."""
    op.create_table(
        "stands",
        sa.Column("key", sa.Integer(), nullable=False),
        sa.Column("collection_key", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("frame_id", sa.Text(), nullable=False),
        sa.Column("source_hash", sa.Text(), nullable=False),
        sa.Column("trees_hash", sa.Text(), nullable=False),
        sa.Column("tree_count", sa.Integer(), nullable=False),
        sa.Column("radius", sa.Float(), nullable=False),
        sa.Column("spacing", sa.Float(), nullable=False),
        sa.Column("created", sa.BigInteger(), nullable=False),
        sa.Column("updated", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_stands"),
        sa.ForeignKeyConstraint(
            ["collection_key"], ["collections.key"], name="fk_stands_collection_key_collections", ondelete="CASCADE"
        ),
        sa.UniqueConstraint("collection_key", "name", name="uq_stands_collection_key_name"),
        sqlite_autoincrement=True,
    )
    op.add_column("submaps", sa.Column("stand_key", sa.Integer(), nullable=True))
    op.create_index("ix_submaps_stand_key", "submaps", ["stand_key"], sqlite_where=sa.text("stand_key IS NOT NULL"))


def downgrade() -> None:
    """Without them: the submaps stay."""
    op.drop_index("ix_submaps_stand_key", "submaps")
    op.drop_column("submaps", "stand_key")
    op.drop_table("stands")
