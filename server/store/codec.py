"""How landmarks lie in their columns: positions as float64, ids and attributes as JSON, left out when default."""

import hashlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import orjson

if TYPE_CHECKING:  # numpy is loaded by what has arrays: `urquhart keys list` has none
    import numpy as np
    from numpy.typing import NDArray

_STEMS_M: Final = (1e-4, 1e4)
"""Metres. Stems beyond, which an older version let in, count as not known: float32 may not hold them."""

_NAMES: Final = [str(i) for i in range(1000)]
"""Made once: each answer names landmarks of several submaps."""


MEMBERS: Final = ("frame_id", "session", "stamp", "map_pose", "properties", "ids", "dbh_cm", "height_m", "species")
"""What a submap may have or not, as the API names it: the last four of its landmarks."""


def pack_positions(xy: "NDArray[np.float64]") -> bytes:
    """(N, 2) float64, metres, as little-endian bytes, row by row."""
    import numpy as np

    return np.ascontiguousarray(xy, dtype="<f8").tobytes()


def unpack_positions(blob: bytes) -> "NDArray[np.float64]":
    """(N, 2) float64, metres."""
    import numpy as np

    return np.frombuffer(blob, dtype="<f8").reshape(-1, 2).copy()


def pack_json(value: object | None) -> bytes | None:
    """JSON bytes; None stays None."""
    return None if value is None else orjson.dumps(value)


def position_names(count: int) -> list[str]:
    """The default ids of landmarks: their positions."""
    return _NAMES[:count] if count <= len(_NAMES) else [str(i) for i in range(count)]


def unpack_ids(blob: bytes | None, count: int) -> list[str]:
    """Landmark ids by position; without a blob the positions themselves."""
    if blob is None:
        return position_names(count)
    return [str(name) for name in orjson.loads(blob)]


def unpack_attributes(blob: bytes | None) -> dict[str, list[Any]]:
    """Attribute lists by position, by name."""
    return {} if blob is None else dict(orjson.loads(blob))


def diameters_of(attributes: Mapping[str, list[Any]] | None) -> "NDArray[np.float64] | None":
    """Stem diameters (N,) float64, metres, NaN where one is not known; None where none is.

    `attributes` are lists by position, by name. The arrays of diameters inside the service are in metres.
    """
    import numpy as np

    known = (attributes or {}).get("dbh_cm")
    if known is None:
        return None
    diameters = np.array(known, dtype=np.float64) / 100.0  # null becomes NaN
    return np.where((diameters > _STEMS_M[0]) & (diameters < _STEMS_M[1]), diameters, np.nan)


def unpack_diameters(blob: bytes | None) -> "NDArray[np.float64] | None":
    """Stem diameters of packed attributes, as `diameters_of` gives them."""
    return diameters_of(unpack_attributes(blob))


def digest(*parts: bytes | None) -> str:
    """A short hex hash over parts, each with its length, so that no two lists of parts share their bytes."""
    hasher = hashlib.blake2b(digest_size=12)
    for part in parts:
        hasher.update(b"-" if part is None else len(part).to_bytes(8, "little") + part)
    return hasher.hexdigest()


def members_of(*values: object) -> frozenset[str]:
    """The names in `MEMBERS` of the values, given in that order, that are not None."""
    return frozenset(name for name, value in zip(MEMBERS, values, strict=False) if value is not None)
