"""Moments as they are stored: whole microseconds since 1970 UTC, which sort, compare and index as integers."""

from datetime import UTC, datetime, timedelta
from typing import Final

EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


def write_instant(moment: datetime) -> int:
    """What a moment is stored as."""
    return (moment - EPOCH) // timedelta(microseconds=1)


def read_instant(value: int | None) -> datetime | None:
    """The moment that was stored so; None for none."""
    return None if value is None else EPOCH + timedelta(microseconds=value)
