"""Ids that the service generates: sorted by time, and impossible to guess."""

import secrets
import time
from typing import Final

_ALPHABET: Final = "0123456789abcdefghjkmnpqrstvwxyz"
"""Crockford's base 32, which has no letters that look like digits."""


def new_id() -> str:
    """A new id of 26 characters: 48 bits of milliseconds since 1970, then 80 random bits, five bits in each
    character.
    """
    value = time.time_ns() // 1_000_000 << 80 | secrets.randbits(80)
    return "".join(_ALPHABET[(value >> shift) & 31] for shift in range(125, -1, -5))
