"""Jobs without the columns that nobody reads: a lock tells who is at one."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Drop them; they never held anything."""
    op.drop_column("jobs", "worker")
    op.drop_column("jobs", "heartbeat")


def downgrade() -> None:
    """Add them again, empty."""
    op.add_column("jobs", sa.Column("worker", sa.Text(), nullable=True))
    op.add_column("jobs", sa.Column("heartbeat", sa.BigInteger(), nullable=True))
