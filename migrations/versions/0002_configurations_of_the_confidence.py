"""Configurations of collections: a verdict now rests on a confidence, which has other parameters."""

from collections.abc import Callable
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

_COLLECTIONS = sa.table("collections", sa.column("key", sa.Integer), sa.column("config", sa.JSON))
_OLD_SHARE, _OLD_MARGIN, _OLD_SWEEPS, _MOST_SWEEPS = 0.4, 0.35, 16, 1000


def upgrade() -> None:
    """Forget what is no parameter any more, and the margin and the sweeps where nobody had chosen them.

    The margin was a share of the evidence and is now evidence for each landmark; sweeps were the submaps that are tried
    and are now those that are verified. What a configuration does not name has its default.
    """

    def renewed(config: dict[str, Any]) -> dict[str, Any]:
        kept = {name: value for name, value in config.items() if name not in ("share", "pairs")}
        for name, old in (("margin", _OLD_MARGIN), ("sweeps", _OLD_SWEEPS)):
            if kept.get(name) == old:
                del kept[name]
        return kept

    _rewrite(renewed)


def downgrade() -> None:
    """Put the old defaults in the place of what meant something else or nothing then."""
    _rewrite(
        lambda config: (
            {name: value for name, value in config.items() if name != "survey"}
            | {"share": _OLD_SHARE, "margin": _OLD_MARGIN}
            | {"sweeps": min(config.get("sweeps", _OLD_SWEEPS), _MOST_SWEEPS)}
        )
    )
    # Features may have been written in another format since: the next upgrade has to look at all of them.
    op.get_bind().exec_driver_sql("PRAGMA user_version = 0")


def _rewrite(change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    connection = op.get_bind()
    for key, config in connection.execute(sa.select(_COLLECTIONS.c.key, _COLLECTIONS.c.config)).all():
        changed = change(config)
        if changed != config:
            connection.execute(sa.update(_COLLECTIONS).where(_COLLECTIONS.c.key == key).values(config=changed))
