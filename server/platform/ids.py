"""Ids and names that the service generates: sorted by time."""

import secrets
import time
from datetime import UTC, datetime
from typing import Final

_ALPHABET: Final = "0123456789abcdefghjkmnpqrstvwxyz"
"""Crockford's base 32, which has no letters that look like digits."""


def new_id() -> str:
    """A new id of 26 characters that nobody can guess: 48 bits of milliseconds since 1970,
    then 80 random bits, five bits in each character.
    """
    value = time.time_ns() // 1_000_000 << 80 | secrets.randbits(80)
    return "".join(_ALPHABET[(value >> shift) & 31] for shift in range(125, -1, -5))


def moment_name(moment: datetime) -> str:
    """A moment as a name: `20260504T093000.000000Z`."""
    return moment.astimezone(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
