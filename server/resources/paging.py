"""Cursors of pages. They are opaque to the caller and contain the last row of the previous page."""

import base64
import binascii
from dataclasses import dataclass
from typing import Literal, TypeVar

import orjson

from server.config.settings import Limits
from server.errors import InvalidField

_Place = TypeVar("_Place", int, str)
Listing = Literal[
    "collections", "submaps", "sessions", "stands", "jobs", "snapshots", "items", "queries", "constraints"
]


@dataclass(frozen=True, slots=True)
class PageRequest:
    """The requested page of a list: most rows (None: the default), and the cursor."""

    limit: int | None
    cursor: str | None


def write_cursor(listing: Listing, after: int | str) -> str:
    """The cursor of the page that begins after a key or a name."""
    return base64.urlsafe_b64encode(orjson.dumps([listing, after])).rstrip(b"=").decode()


def read_cursor(listing: Listing, cursor: str | None) -> int:
    """The key to begin after, 0 without a cursor. Raises InvalidField if the cursor is not from this list."""
    return 0 if cursor is None else _read(listing, cursor, int)


def read_name_cursor(listing: Listing, cursor: str | None) -> str:
    """The name to begin after, empty without a cursor. Raises InvalidField if the cursor is not from this list."""
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
    """Number of rows on a page. Raises InvalidField beyond the limit."""
    if limit is None:
        return limits.page_default
    if not 1 <= limit <= limits.page_max:
        detail = f"must be from 1 to {limits.page_max}: see `page_max` in GET /v1/limits"
        raise InvalidField(detail, code="out_of_range", parameter="limit")
    return limit
