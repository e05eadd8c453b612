"""Stands say which coordinate reference system their trees' positions are in. Those stored before do not know it."""

from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the column."""
    op.execute("ALTER TABLE stands ADD COLUMN crs TEXT")
