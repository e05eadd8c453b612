"""Inputs for the readers: from a grammar, and from good ones that are damaged, in their bytes or in what they say."""

import random
from collections.abc import Callable
from typing import Any, Final

import orjson

NAMES: Final = (
    "id", "xy", "ids", "landmarks", "x", "y", "yaw", "dbh_cm", "height_m", "species", "frame_id", "stamp", "session",
    "map_pose", "covariance", "properties", "submap_id", "limit", "method", "seed", "store", "exclude", "submap_ids",
    "within_seconds", "near", "radius", "title", "config", "crs", "origin", "gate", "explain", "query", "queries",
    "per_session", "bbox", "datetime", "gates", "confidence", "inlier_count", "rms", "same_session", "per_submap",
)  # fmt: skip
"""Members of bodies, whichever."""
_WORDS: Final = (
    "p", "", ".", "..", "~", "a" * 129, "e\u0301", "\u00e9", "\u202e\u0627", "\U0001f332", "\x00", "\ud7ff", "\ufeff",
    "2026-05-04T09:30:00Z", "9999-12-31T23:59:59-23:59", "0001-01-01T00:00:00+23:59", "2026-02-30T00:00:00Z",
    "2026-05-04T09:30:60Z", "paper", "robust", "EPSG:32633", "EPSG:-1", "+proj=", "../..//etc", "%2e", "NaN", "1e5",
)  # fmt: skip
_NUMBERS: Final = (
    0, -0.0, 1, -1, 3, 2**31, 2**53 + 1, 2**63 - 1, -(2**63), 2**64 - 1, 1e-320, 1e-300, 1e8, -1e8, 1.0000001e8,
    1e15, 1e300, -1.7976931348623157e308, 0.1, 359.99, 1e-9,
)  # fmt: skip
_TOKENS: Final = (
    b"NaN", b"Infinity", b"-", b"1e999", b"-1e999", b"9" * 400, b"0x10", b"01", b"1_000", b".5", b"\\ud800", b"\\u0000",
    b"\xff", b"\xc0\x80", b"\xed\xa0\x80", b"\xef\xbb\xbf", b"\x00", b"\n", b"\r\n", b"\x85", b'"', b"'", b"[" * 40,
    b'{"a":' * 40, b"]", b"}", b",", b",,", b":", b"null", b"true", b"//", b"/**/", b"#", b";", b"\t", b" ",
    b"\xe2\x80\xa8", b"\x1a", b"\\",
)  # fmt: skip


def damaged(rng: random.Random, good: bytes, other: bytes) -> bytes:
    """`good` with one to four wounds in its bytes; `other` is another good one to take pieces from."""
    data = bytearray(good)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 4))):
        rng.choice(_WOUNDS)(rng, data, other)
    return bytes(data)


def changed(rng: random.Random, good: Any) -> Any:
    """A JSON value with one to three of its parts replaced, taken out, doubled or renamed."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        good = _change(rng, good)
    return good


def value(rng: random.Random, depth: int = 0) -> Any:
    """Any JSON value, of members that bodies have and values that are hard to read."""
    kind = rng.randrange(12 if depth < 4 else 8)
    if kind < 3:
        return rng.choice(_NUMBERS)
    if kind == 3:
        return rng.uniform(-60.0, 60.0)
    if kind < 6:
        return rng.choice(_WORDS)
    if kind < 8:
        return rng.choice((None, True, False))
    if kind == 8:
        return [[round(rng.uniform(-50.0, 50.0), 2), rng.choice(_NUMBERS)] for _ in range(rng.randrange(8))]
    if kind == 9:
        return [value(rng, depth + 1) for _ in range(rng.randrange(6))]
    return {rng.choice(NAMES): value(rng, depth + 1) for _ in range(rng.randrange(7))}


def dumped(item: Any) -> bytes:
    """As JSON; what JSON cannot hold as text with replaced characters."""
    try:
        return orjson.dumps(item)
    except TypeError:
        return repr(item).encode(errors="replace")


def _change(rng: random.Random, item: Any) -> Any:
    if isinstance(item, dict) and item and rng.random() < 0.9:
        name = rng.choice(list(item))
        match rng.randrange(16):
            case 0:
                return {key: inner for key, inner in item.items() if key != name}
            case 1:
                return item | {rng.choice(NAMES): value(rng)}
            case 2:
                return {rng.choice(NAMES) if key == name else key: inner for key, inner in item.items()}
            case _:
                return item | {name: _change(rng, item[name])}
    if isinstance(item, list) and item and rng.random() < 0.8:
        place = rng.randrange(len(item))
        match rng.randrange(10):
            case 0:
                return item[:place]
            case 1:
                return item + item[place : place + 1]
            case _:
                return [*item[:place], _change(rng, item[place]), *item[place + 1 :]]
    return _like(rng, item)


def _like(rng: random.Random, item: Any) -> Any:
    """Mostly of the same kind, so that it is read further than to its type."""
    if rng.random() < 0.3:
        return value(rng)
    match item:
        case bool():
            return not item
        case int() | float():
            return rng.choice(_NUMBERS) if rng.random() < 0.4 else round(item + rng.gauss(0.0, 5.0), 3)
        case str():
            return (
                rng.choice(_WORDS) if rng.random() < 0.6 else item[: rng.randrange(len(item) + 1)] + rng.choice(_WORDS)
            )
        case _:
            return value(rng)


def _flip(rng: random.Random, data: bytearray, other: bytes) -> None:
    if data:
        data[rng.randrange(len(data))] = rng.randrange(256)


def _insert(rng: random.Random, data: bytearray, other: bytes) -> None:
    place = rng.randint(0, len(data))
    data[place:place] = rng.choice(_TOKENS)


def _replace(rng: random.Random, data: bytearray, other: bytes) -> None:
    place = rng.randint(0, len(data))
    data[place : place + rng.randint(1, 12)] = rng.choice(_TOKENS)


def _cut(rng: random.Random, data: bytearray, other: bytes) -> None:
    place = rng.randint(0, len(data))
    del data[place : place + rng.randint(1, 1 + len(data) // 4)]


def _end(rng: random.Random, data: bytearray, other: bytes) -> None:
    del data[rng.randint(0, len(data)) :]


def _double(rng: random.Random, data: bytearray, other: bytes) -> None:
    place = rng.randint(0, len(data))
    data[place:place] = data[place : place + rng.randint(1, 64)] * rng.choice((1, 1, 2, 8))


def _splice(rng: random.Random, data: bytearray, other: bytes) -> None:
    place, taken = rng.randint(0, len(data)), rng.randint(0, len(other))
    data[place:] = other[taken:]


_WOUNDS: Final[tuple[Callable[[random.Random, bytearray, bytes], None], ...]] = (
    _flip, _insert, _replace, _cut, _end, _double, _splice,
)  # fmt: skip
