"""Ids that the service makes: in the order of time, and not to be guessed."""

import secrets
import time
from typing import Final

_ALPHABET: Final = "0123456789abcdefghjkmnpqrstvwxyz"
"""Crockford's: no letter that is mistaken for a digit."""


def new_id() -> str:
    """26 characters: 48 bits of milliseconds since 1970, then 80 random ones, five bits each."""
    value = time.time_ns() // 1_000_000 << 80 | secrets.randbits(80)
    return "".join(_ALPHABET[(value >> shift) & 31] for shift in range(125, -1, -5))
