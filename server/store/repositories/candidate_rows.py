"""What answers tell of the submaps that were found. Every query reads it, so it is read by the shortest way."""

from collections.abc import Collection, Sequence
from typing import Any

import orjson
from sqlalchemy import Connection, bindparam, select

from server.store.expressions import DirectStatement, beside_key, listed
from server.store.instants import read_instant
from server.store.submap_records import FoundSubmap, Place
from server.store.tables import SubmapRow


class CandidateRows:
    """Reads what answers tell of one collection's submaps, in a read transaction of the caller.

    What was read once is remembered, because the search and the answer need the same rows and the read view does not
    change.
    """

    def __init__(self, connection: Connection, collection_key: int) -> None:
        self._connection = connection
        self._collection_key = collection_key
        self._brief: dict[int, FoundSubmap] = {}
        self._whole: dict[int, FoundSubmap] = {}

    def read(self, keys: Collection[int], *, landmarks: bool) -> dict[int, FoundSubmap]:
        """Those of the keys that are submaps of the collection, with their landmarks if asked, by key."""
        statement, known = (_WHOLE, self._whole) if landmarks else (_BRIEF, self._brief)
        missing = [key for key in keys if key not in known]
        if missing:
            rows = statement.rows(self._connection, collection_key=self._collection_key, keys=missing)
            known.update((row[0], _found(row)) for row in rows)
        return {key: known[key] for key in keys if key in known}


_HEAD = tuple(name for name in FoundSubmap.__slots__ if name not in ("place", "landmarks"))
_PLACE = slice(len(_HEAD), len(_HEAD) + len(Place.__slots__))


def _statement(*more: str) -> DirectStatement:
    columns = SubmapRow.__table__.c
    return DirectStatement(
        select(*(columns[name] for name in (*_HEAD, *Place.__slots__, *more))).where(
            beside_key(bindparam("collection_key")), columns.key.in_(listed("keys"))
        )
    )


_BRIEF = _statement()
_WHOLE = _statement("landmarks")


def _found(row: Sequence[Any]) -> FoundSubmap:
    values: dict[str, Any] = dict(zip(_HEAD, row, strict=False))
    values["stamp"] = read_instant(values["stamp"])
    frame_id, x, y, yaw, covariance, *box = row[_PLACE]
    place = None
    if frame_id is not None:
        place = Place(frame_id, x, y, yaw, None if covariance is None else orjson.loads(covariance), *box)
    return FoundSubmap(**values, place=place, landmarks=row[-1] if len(row) > _PLACE.stop else b"")
