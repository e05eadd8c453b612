"""Conditions that only SQLite understands, or that are written so that its planner does what is best."""

from collections.abc import Collection, Sequence
from typing import Any

import orjson
from sqlalchemy import ColumnElement, Integer, Select, bindparam, false, func, literal_column, or_, select
from sqlalchemy.dialects import sqlite
from sqlalchemy.orm import InstrumentedAttribute, Session


def beside_key(collection_key: Any) -> ColumnElement[bool]:
    """Whether a submap is of a collection, in a statement that names submaps by their keys.

    SQLite takes a list of keys for more work than an index that begins with the collection, and would read all of that.
    The plus keeps it from doing so.
    """
    same: ColumnElement[bool] = literal_column("+submaps.collection_key", Integer) == collection_key
    return same


def matches(column: InstrumentedAttribute[str], patterns: Sequence[str]) -> ColumnElement[bool]:
    """Whether an id matches one of some shell patterns, as `Caller.sees` has it."""
    return or_(false(), *(column.op("GLOB")(pattern) for pattern in patterns))


def listed(name: str) -> Select[Any]:
    """The values of a JSON array that is bound to `name`, for lists longer than a statement may bind one by one."""
    return select(func.json_each(bindparam(name)).table_valued("value").c.value)


class DirectStatement:
    """A SELECT for the driver itself: it is put together once, and nothing lies between it and SQLite when it runs.

    For what every look-up reads; there, the layers between cost more than SQLite does.
    """

    def __init__(self, statement: Select[*tuple[Any, ...]]) -> None:
        compiled = statement.compile(dialect=sqlite.dialect())
        self._text, self._order = str(compiled), list(compiled.positiontup or ())

    def rows(self, session: Session, **values: int | Collection[int]) -> list[tuple[Any, ...]]:
        """The rows, in the transaction of the session; a collection is bound as a JSON array, for `listed`."""
        bound = [values[name] for name in self._order]
        cursor = session.connection().connection.cursor()
        cursor.execute(self._text, [one if isinstance(one, int) else orjson.dumps([*one]).decode() for one in bound])
        return list(cursor.fetchall())
