"""Filters of a query (`near`, `exclude`), translated to keys of submaps before the search."""

from collections.abc import Sequence
from datetime import datetime, timedelta

from server.errors import InvalidField
from server.schemas.queries import Exclude, Near
from server.store.repositories.submaps import Submaps
from server.store.submap_filter import SubmapFilter


def keys_near(submaps: Submaps, near: Near | None, among: Sequence[int] | None = None) -> set[int] | None:
    """Keys of the submaps with a footprint near that place, of all or `among` some; None without a `near`."""
    if near is None:
        return None
    x, y, r = near.x, near.y, near.radius
    return submaps.matching(SubmapFilter(bbox=(x - r, y - r, x + r, y + r), map_frame_id=near.frame_id), among)


def keys_excluded(
    submaps: Submaps, exclude: Exclude, stamp: datetime | None, among: Sequence[int] | None = None
) -> set[int]:
    """Keys of the submaps that `exclude` leaves out, of all or `among` some.

    Raises InvalidField if a query without a stamp needs one.
    """
    keys = set(submaps.keys(exclude.submap_ids).values()) if exclude.submap_ids else set[int]()
    since = until = None
    if exclude.within_seconds is not None:
        if stamp is None:
            raise InvalidField(
                "needs the query's `stamp`; add it, or leave this out",
                code="no_stamp",
                pointer="/exclude/within_seconds",
            )
        span = timedelta(seconds=exclude.within_seconds)
        since, until = _shifted(stamp, -span), _shifted(stamp, span)
    if exclude.session is not None or exclude.within_seconds is not None:
        keys |= submaps.matching(SubmapFilter(session=exclude.session, since=since, until=until), among)
    return keys


def _shifted(stamp: datetime, span: timedelta) -> datetime:
    """`stamp` moved by `span`, within the range of dates."""
    try:
        return stamp + span
    except OverflowError:
        end = datetime.min if span < timedelta(0) else datetime.max
        return end.replace(tzinfo=stamp.tzinfo)
