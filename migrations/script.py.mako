"""${message}."""

from alembic import op

revision = ${repr(up_revision)}
down_revision = ${repr(down_revision)}
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Change the tables. There is no way back: restore a snapshot."""
    ${upgrades if upgrades else "op.execute()"}
