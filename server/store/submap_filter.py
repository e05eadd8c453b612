"""Which submaps a listing or a search is about."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import ColumnElement

from server.store.tables import SubmapRow


@dataclass(frozen=True, slots=True)
class SubmapFilter:
    """Which submaps of a collection: all that is given must hold."""

    session: str | None = None
    bbox: tuple[float, float, float, float] | None = None
    map_frame_id: str | None = None
    since: datetime | None = None
    until: datetime | None = None


def conditions_of(chosen: SubmapFilter) -> list[ColumnElement[bool]]:
    """The same as conditions on rows of submaps."""
    conditions: list[ColumnElement[bool]] = []
    if chosen.session is not None:
        conditions.append(SubmapRow.session == chosen.session)
    if chosen.map_frame_id is not None:
        conditions.append(SubmapRow.map_frame_id == chosen.map_frame_id)
    if chosen.bbox is not None:
        min_x, min_y, max_x, max_y = chosen.bbox
        conditions += [
            SubmapRow.map_min_x <= max_x,
            SubmapRow.map_max_x >= min_x,
            SubmapRow.map_min_y <= max_y,
            SubmapRow.map_max_y >= min_y,
        ]
    if chosen.since is not None:
        conditions.append(SubmapRow.stamp >= chosen.since)
    if chosen.until is not None:
        conditions.append(SubmapRow.stamp <= chosen.until)
    return conditions
