"""Configurations of collections have a floor and a scale of covariances: what does not know them must not meet them."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

_COLLECTIONS = sa.table("collections", sa.column("key", sa.Integer), sa.column("config", sa.JSON))
_NEW = ("covariance_scale", "covariance_floor", "covariance_floor_yaw")


def upgrade() -> None:
    """Nothing: what a configuration does not name has its default."""


def downgrade() -> None:
    """Forget the parameters."""
    connection = op.get_bind()
    for key, config in connection.execute(sa.select(_COLLECTIONS.c.key, _COLLECTIONS.c.config)).all():
        kept = {name: value for name, value in config.items() if name not in _NEW}
        if kept != config:
            connection.execute(sa.update(_COLLECTIONS).where(_COLLECTIONS.c.key == key).values(config=kept))
