"""What all tables share: their base, the types of their columns, and the rules that several of them have."""

from dataclasses import fields
from datetime import UTC, datetime, timedelta
from typing import Any, Final

import orjson
from sqlalchemy import CheckConstraint, Dialect, Integer, MetaData, Text, types
from sqlalchemy.orm import DeclarativeBase

from server.store.instants import EPOCH, read_instant, write_instant

STRICT: Final = {"sqlite_strict": True}
"""Options of a table: each column holds values of its type alone."""
KEYS_ONCE: Final = {**STRICT, "sqlite_autoincrement": True}
"""Options of a table whose keys are not given out again after their rows are gone."""
_FIRST, _LAST = (
    (moment.replace(tzinfo=UTC) - EPOCH) // timedelta(microseconds=1) for moment in (datetime.min, datetime.max)
)


class Instant(types.TypeDecorator[datetime]):
    """A moment as whole microseconds since 1970 UTC: sorts, compares and indexes as an integer."""

    impl = Integer
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> int | None:
        return None if value is None else write_instant(value)

    def process_result_value(self, value: Any, dialect: Dialect) -> datetime | None:
        return read_instant(value)


class Json(types.TypeDecorator[Any]):
    """JSON as text. None is NULL; a strict table knows no type JSON."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Dialect) -> str | None:
        return None if value is None else orjson.dumps(value).decode()

    def process_result_value(self, value: Any, dialect: Dialect) -> Any:
        return None if value is None else orjson.loads(value)


class Flag(types.TypeDecorator[bool]):
    """True or false, as 1 or 0. A strict table knows no type BOOLEAN."""

    impl = Integer
    cache_ok = True

    def process_bind_param(self, value: bool | None, dialect: Dialect) -> int | None:
        return None if value is None else int(value)

    def process_result_value(self, value: Any, dialect: Dialect) -> bool | None:
        return None if value is None else bool(value)


class BaseRow(DeclarativeBase):
    """Base of all tables."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
            "pk": "pk_%(table_name)s",
        }
    )


def rule(name: str, condition: str) -> CheckConstraint:
    """A condition that every row of a table meets. The name says what the row has, because errors show just that."""
    return CheckConstraint(condition, name=name)


def holds_json(column: str, kind: str, *, optional: bool = False) -> CheckConstraint:
    """The rule that a column holds JSON of a kind (`object` or `array`), or NULL if it is `optional`."""
    # `iif`, not AND: json_type raises an error for what is not JSON, and a check of the whole file would end with that.
    condition = f"iif(json_valid({column}), json_type({column}) = '{kind}', 0)"
    return rule(f"{column}_is_json", f"{column} IS NULL OR {condition}" if optional else condition)


def holds_packed_json(column: str, *, optional: bool = False) -> CheckConstraint:
    """The rule that a column of bytes holds JSON, or NULL if it is `optional`."""
    # The cast: newer versions of SQLite take bytes for their own binary form of JSON.
    condition = f"json_valid(CAST({column} AS TEXT))"
    return rule(f"{column}_is_json", f"{column} IS NULL OR {condition}" if optional else condition)


def are_moments(*columns: str) -> CheckConstraint:
    """The rule that columns hold moments of the years 1 to 9999, as all that Python can represent, or NULL."""
    return rule("moments_in_range", " AND ".join(f"{column} BETWEEN {_FIRST} AND {_LAST}" for column in columns))


def values_of(record: Any) -> dict[str, Any]:
    """The fields of a record by name, which is that of the column."""
    return {one.name: getattr(record, one.name) for one in fields(record)}


def columns_of(record: type[Any], table: type[BaseRow]) -> tuple[Any, ...]:
    """The columns of a table that have the names of a record's fields, in the order of the fields."""
    return tuple(getattr(table, one.name) for one in fields(record))
