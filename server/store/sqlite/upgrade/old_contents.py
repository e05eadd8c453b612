"""What rows of earlier schemas hold in another form: SQL functions that give the form of now, for a copy of them."""

import hashlib
import math
import sqlite3
import struct
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any, Final

import orjson

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_OLD_MARGIN, _OLD_SWEEPS = 0.35, 16
_PARAMETERS: Final = {"margin": "lead_per_landmark", "sweeps": "exhaustive_submaps"}
_ATTRIBUTES: Final = {"dbh": "dbh_cm", "height": "height_m"}
_NAMED_FRAMES: Final = (
    "INSERT INTO main.map_frames (collection_key, frame_id, crs, origin_x, origin_y) "
    "SELECT c.key, min(s.map_frame_id), c.crs, c.origin_x, c.origin_y "
    "FROM main.collections c JOIN main.submaps s ON s.collection_key = c.key "
    "WHERE c.crs IS NOT NULL AND s.map_frame_id IS NOT NULL "
    "GROUP BY c.key HAVING min(s.map_frame_id) = max(s.map_frame_id) AND min(s.map_frame_id) <> 'map'"
)
"""Until 0009, a collection had one crs for all of its map frames; now it is that of the frame `map`.

A collection whose only map frame has another name meant that one, so it keeps its crs there. Where there are several,
nobody knows which of them the crs was meant for: in all of them at once it was wrong.
"""

Changes = dict[str, dict[str, str]]
"""By table and column, the expression for what takes the place of the column."""


def changes_since(connection: sqlite3.Connection, revision: str) -> tuple[Changes, list[str]]:
    """How columns of a schema are copied, for those that are not copied as they are; and statements to run after.

    Functions in the expressions are made known to the connection.
    """
    changes, after = Changes(collections={}, submaps={}), list[str]()
    if revision < "0003":
        changes["collections"]["pruned_revision"] = "0"  # no deletion was forgotten then
    if revision < "0009":
        after.append(_NAMED_FRAMES)
    if revision < "0011":
        old_defaults = "1" if revision < "0002" else "0"
        changes["collections"]["config"] = f"config_of_now(config, {old_defaults})"
        changes["submaps"]["attributes"] = "attributes_of_now(attributes)"
        changes["submaps"]["etag"] = f"etag_of_now(etag, {', '.join(_CONTENT)})"
    connection.create_function("config_of_now", 2, _config, deterministic=True)
    connection.create_function("attributes_of_now", 1, _attributes, deterministic=True)
    connection.create_function("etag_of_now", 1 + len(_CONTENT), _etag, deterministic=True)
    return changes, after


def _config(text: str, old_defaults: int) -> str:
    """A configuration with the present names of its parameters. What it does not name has its default.

    Before 0002, the margin was a share of the evidence and is now evidence for each landmark; sweeps were the submaps
    that are tried and are now those that are verified. Both are forgotten unless somebody had chosen them.
    """
    try:
        config: dict[str, Any] = orjson.loads(text)
    except ValueError:
        return text  # the rule of the column says what is wrong with it
    if old_defaults:
        gone = {"share", "pairs"} | {
            name for name, old in (("margin", _OLD_MARGIN), ("sweeps", _OLD_SWEEPS)) if config.get(name) == old
        }
        config = {name: value for name, value in config.items() if name not in gone}
    return orjson.dumps(_renamed(config, _PARAMETERS)).decode()


def _attributes(packed: bytes | None) -> bytes | None:
    """Attributes with their units: `dbh_cm` in centimetres was `dbh` in metres, `height_m` was `height`."""
    if packed is None:
        return None
    try:
        columns: dict[str, list[float | None]] = orjson.loads(packed)
    except ValueError:
        return packed  # the rule of the column says what is wrong with it
    metres = columns.get("dbh")
    if metres is not None:
        columns["dbh"] = [None if value is None else _centimetres(value) for value in metres]
    return orjson.dumps(_renamed(columns, _ATTRIBUTES))


def _renamed(values: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    return {names.get(name, name): value for name, value in values.items()}


def _centimetres(metres: float) -> float | None:
    """Centimetres of which metres are made again that are the same float32, as the features hold them."""
    exact = metres * 100.0
    round_number = float(f"{exact:.15g}")  # 0.29 * 100 is a little less than 29
    found = round_number if _single(round_number / 100.0) == _single(metres) else exact
    return found if math.isfinite(found) else None


def _single(value: float) -> bytes:
    try:
        return struct.pack("<f", value)
    except OverflowError:  # beyond float32, as an early version let it in: no diameter
        return b""


_POSE: Final = ("map_frame_id", "map_x", "map_y", "map_yaw", "map_covariance")
_CONTENT: Final = (
    *("attributes", "landmarks_hash", "landmark_ids", "frame_id", "session", "stamp", "properties"),
    *_POSE,
)


def _etag(etag: str, *content: Any) -> str:
    """The entity tag of a submap with the attributes of now: made as `submaps.preparation` made it at 0011."""
    row = dict(zip(_CONTENT, content, strict=True))
    attributes = _attributes(row["attributes"])
    if attributes == row["attributes"]:
        return etag
    stamp = None if row["stamp"] is None else _EPOCH + timedelta(microseconds=row["stamp"])
    *pose, covariance = (row[name] for name in _POSE)
    place = None if row["map_frame_id"] is None else [*pose, _loaded(covariance)]
    rest = orjson.dumps(
        [row["frame_id"], row["session"], stamp, place, _loaded(row["properties"])],
        option=orjson.OPT_SORT_KEYS | orjson.OPT_UTC_Z,
    )
    hasher = hashlib.blake2b(digest_size=12)
    for part in (row["landmarks_hash"].encode(), row["landmark_ids"], attributes, rest):
        hasher.update(b"-" if part is None else len(part).to_bytes(8, "little") + part)
    return hasher.hexdigest()


def _loaded(text: str | None) -> Any:
    return None if text is None else orjson.loads(text)
