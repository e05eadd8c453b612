"""Cursors: opaque to the caller, a key to us."""

import base64
import binascii
from typing import Literal

import orjson

from server.errors import InvalidField
from server.settings import Limits

Listing = Literal["collections", "submaps"]


def write_cursor(listing: Listing, after_key: int) -> str:
    """The cursor of the page that begins after a key."""
    return base64.urlsafe_b64encode(orjson.dumps([listing, after_key])).rstrip(b"=").decode()


def read_cursor(listing: Listing, cursor: str | None) -> int:
    """The key to begin after, 0 without a cursor. Raises InvalidField for what this listing never gave out."""
    if cursor is None:
        return 0
    try:
        content = orjson.loads(base64.urlsafe_b64decode(cursor.encode("ascii") + b"=" * (-len(cursor) % 4)))
    except (binascii.Error, UnicodeEncodeError, orjson.JSONDecodeError):
        content = None
    match content:
        case [str(name), int(key)] if name == listing and 0 <= key < 2**63:
            return key
    raise InvalidField(
        f"is not a cursor of this listing; take `next` of a page of {listing}, or leave it out for the first page",
        code="cursor",
        parameter="cursor",
    )


def page_size(limit: int | None, limits: Limits) -> int:
    """How many rows a page has. Raises InvalidField beyond the limit."""
    if limit is None:
        return limits.page
    if not 1 <= limit <= limits.page_max:
        raise InvalidField(f"must be from 1 to {limits.page_max}", code="out_of_range", parameter="limit")
    return limit
