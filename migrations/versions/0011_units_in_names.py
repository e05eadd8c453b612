"""Attributes of trees name their unit, and two parameters of configurations say what they are.

`dbh_cm` in centimetres was `dbh` in metres, and `height_m` was `height`. `lead_per_landmark` was `margin`, which also
meant the lead itself, and `exhaustive_submaps` was `sweeps`.
"""

import hashlib
import math
import struct
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import orjson
import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None

_POSE = ("map_frame_id", "map_x", "map_y", "map_yaw", "map_covariance")
_SUBMAPS = sa.table(
    "submaps",
    *(sa.column(name, sa.Integer) for name in ("key", "stamp")),
    *(sa.column(name, sa.Text) for name in ("frame_id", "session", "landmarks_hash", "etag", "map_frame_id")),
    *(sa.column(name, sa.Float) for name in ("map_x", "map_y", "map_yaw")),
    *(sa.column(name, sa.JSON) for name in ("map_covariance", "properties")),
    *(sa.column(name, sa.LargeBinary) for name in ("landmark_ids", "attributes")),
)
_COLLECTIONS = sa.table("collections", sa.column("key", sa.Integer), sa.column("config", sa.JSON))
_PARAMETERS = {"margin": "lead_per_landmark", "sweeps": "exhaustive_submaps"}
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_BATCH = 500


def upgrade() -> None:
    """Diameters in centimetres, such that metres made of them are the float32 that the features hold."""
    _rewrite({"dbh": "dbh_cm", "height": "height_m"}, _centimetres)
    _rename_parameters(_PARAMETERS)


def downgrade() -> None:
    """Diameters in metres again."""
    _rewrite({"dbh_cm": "dbh", "height_m": "height"}, lambda value: value / 100.0)
    _rename_parameters({new: old for old, new in _PARAMETERS.items()})


def _rename_parameters(names: dict[str, str]) -> None:
    connection = op.get_bind()
    for key, config in connection.execute(sa.select(_COLLECTIONS.c.key, _COLLECTIONS.c.config)).all():
        renamed = {names.get(name, name): value for name, value in config.items()}
        if renamed != config:
            connection.execute(sa.update(_COLLECTIONS).where(_COLLECTIONS.c.key == key).values(config=renamed))


def _centimetres(metres: float) -> float:
    exact = metres * 100.0
    round_number = float(f"{exact:.15g}")  # 0.29 * 100 is a little less than 29
    return round_number if _single(round_number / 100.0) == _single(metres) else exact


def _single(value: float) -> bytes:
    try:
        return struct.pack("<f", value)
    except OverflowError:  # beyond float32, as an early version let it in: no diameter
        return b""


def _rewrite(names: dict[str, str], convert: Callable[[float], float]) -> None:
    connection, last = op.get_bind(), 0
    while True:
        rows = connection.execute(
            sa.select(_SUBMAPS)
            .where(_SUBMAPS.c.key > last, _SUBMAPS.c.attributes.is_not(None))
            .order_by(_SUBMAPS.c.key)
            .limit(_BATCH)
        ).all()
        if not rows:
            return
        last = rows[-1].key
        for row in rows:
            packed = _renamed(row.attributes, names, convert)
            if packed != row.attributes:
                connection.execute(
                    sa.update(_SUBMAPS)
                    .where(_SUBMAPS.c.key == row.key)
                    .values(attributes=packed, etag=_etag(row, packed))
                )


def _renamed(attributes: bytes, names: dict[str, str], convert: Callable[[float], float]) -> bytes:
    try:
        columns: dict[str, list[Any]] = orjson.loads(attributes)
    except ValueError:  # damaged: left for `db check` to name
        return attributes
    renamed = {names.get(name, name): values for name, values in columns.items()}
    for name in ("dbh", "dbh_cm"):
        if name in renamed and name in names.values():
            renamed[name] = [None if value is None else _known(convert(value)) for value in renamed[name]]
    return orjson.dumps(renamed)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _etag(row: Any, attributes: bytes) -> str:
    """The entity tag of the row's content with other attributes."""
    stamp = None if row.stamp is None else _EPOCH + timedelta(microseconds=row.stamp)
    pose = None if row.map_frame_id is None else [getattr(row, name) for name in _POSE]
    rest = orjson.dumps(
        [row.frame_id, row.session, stamp, pose, row.properties], option=orjson.OPT_SORT_KEYS | orjson.OPT_UTC_Z
    )
    hasher = hashlib.blake2b(digest_size=12)
    for part in (row.landmarks_hash.encode(), row.landmark_ids, attributes, rest):
        hasher.update(b"-" if part is None else len(part).to_bytes(8, "little") + part)
    return hasher.hexdigest()
