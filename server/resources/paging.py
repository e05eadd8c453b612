"""Cursors: opaque to the caller, to us the last of the page before."""

import base64
import binascii
from dataclasses import dataclass
from typing import Literal, TypeVar

import orjson

from server.config.settings import Limits
from server.errors import InvalidField

_Place = TypeVar("_Place", int, str)
Listing = Literal["collections", "submaps", "sessions", "jobs", "snapshots"]


@dataclass(frozen=True, slots=True)
class PageRequest:
    """Which page of a listing is asked for: rows at most, None for the usual number, and the cursor of the last one."""

    limit: int | None
    cursor: str | None


def write_cursor(listing: Listing, after: int | str) -> str:
    """The cursor of the page that begins after a key or a name."""
    return base64.urlsafe_b64encode(orjson.dumps([listing, after])).rstrip(b"=").decode()


def read_cursor(listing: Listing, cursor: str | None) -> int:
    """The key to begin after, 0 without a cursor. Raises InvalidField for what this listing never gave out."""
    return 0 if cursor is None else _read(listing, cursor, int)


def read_name_cursor(listing: Listing, cursor: str | None) -> str:
    """The name to begin after, empty without a cursor. Raises InvalidField for what this listing never gave out."""
    return "" if cursor is None else _read(listing, cursor, str)


def _read(listing: Listing, cursor: str, kind: type[_Place]) -> _Place:
    try:
        content = orjson.loads(base64.urlsafe_b64decode(cursor.encode("ascii") + b"=" * (-len(cursor) % 4)))
    except (binascii.Error, UnicodeEncodeError, orjson.JSONDecodeError):
        content = None
    match content:
        case [str(name), bool()]:
            pass
        case [str(name), int() | str() as place] if name == listing and isinstance(place, kind):
            if isinstance(place, str) or 0 <= place < 2**63:
                return place
    raise InvalidField(
        f"is not a cursor of this list; use `next` of a page of {listing}, or leave it out to get the first page",
        code="cursor",
        parameter="cursor",
    )


def page_size(limit: int | None, limits: Limits) -> int:
    """How many rows a page has. Raises InvalidField beyond the limit."""
    if limit is None:
        return limits.page_default
    if not 1 <= limit <= limits.page_max:
        detail = f"must be from 1 to {limits.page_max}, the limit page_max"
        raise InvalidField(detail, code="out_of_range", parameter="limit")
    return limit
