"""Expressions that databases write differently. The room of a database says how it writes them.

Repositories use these and no SQL of one database alone.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any, Final, TypeVar

import orjson
from sqlalchemy import Boolean, ColumnElement, Connection, Dialect, Integer, Select, bindparam, false, or_, select
from sqlalchemy.orm import InstrumentedAttribute
from sqlalchemy.sql.dml import ReturningUpdate
from sqlalchemy.sql.functions import FunctionElement

from server.store.tables import SubmapRow

_T = TypeVar("_T")
_VARIABLES: Final = 500
"""Well below SQLite's limit on bound values."""


class Unindexed(FunctionElement[int]):
    """A column of integers as a value without an index, so that the planner takes the index of another condition."""

    type = Integer()
    inherit_cache = True


class MatchesPattern(FunctionElement[bool]):
    """Whether a text matches a shell pattern of letters, `*` and `?`."""

    type = Boolean()
    inherit_cache = True


class JsonValues(FunctionElement[Any]):
    """The values of a JSON array of integers, as rows."""

    inherit_cache = True


def batches(values: Iterable[_T]) -> Iterator[list[_T]]:
    """The values in lists, each short enough to be bound one by one in a statement."""
    every = list(values)
    for start in range(0, len(every), _VARIABLES):
        yield every[start : start + _VARIABLES]


def beside_key(collection_key: Any) -> ColumnElement[bool]:
    """Whether a submap is of a collection, in a statement that names submaps by their keys.

    SQLite takes a list of keys for more work than an index that begins with the collection, and would read all of that.
    """
    same: ColumnElement[bool] = Unindexed(SubmapRow.collection_key) == collection_key
    return same


def matches(column: InstrumentedAttribute[str], patterns: Sequence[str]) -> ColumnElement[bool]:
    """Whether an id matches one of some shell patterns, as `Principal.sees` has it."""
    return or_(false(), *(MatchesPattern(column, pattern) for pattern in patterns))


def listed(name: str) -> Select[Any]:
    """The values of a JSON array that is bound to `name`, for lists longer than a statement may bind one by one."""
    return select(JsonValues(bindparam(name)).table_valued("value").c.value)


class DirectStatement:
    """A statement for the driver itself: it is put together once, and nothing lies between it and the driver.

    For what every look-up and every write does; there, the layers between cost more than SQLite does. It returns rows.
    """

    def __init__(self, statement: Select[*tuple[Any, ...]] | ReturningUpdate[*tuple[Any, ...]]) -> None:
        self._statement = statement
        self._compiled: dict[str, tuple[str, list[str]]] = {}

    def rows(
        self, connection: Connection, **values: int | str | Collection[int] | Collection[str]
    ) -> list[tuple[Any, ...]]:
        """The rows, in the transaction of the connection; a collection is bound as a JSON array, for `listed`."""
        text, order = self._compiled.get(connection.dialect.name) or self._compile(connection.dialect)
        bound = [values[name] for name in order]
        cursor = connection.connection.cursor()
        cursor.execute(text, [one if isinstance(one, int | str) else orjson.dumps([*one]).decode() for one in bound])
        return list(cursor.fetchall())

    def _compile(self, dialect: Dialect) -> tuple[str, list[str]]:
        compiled = self._statement.compile(dialect=dialect)
        made = str(compiled), list(compiled.positiontup or ())
        self._compiled[dialect.name] = made
        return made
