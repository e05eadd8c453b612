"""How SQLite writes the expressions of `store.expressions`."""

from typing import Any

from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.compiler import SQLCompiler

from server.store.expressions import JsonValues, MatchesPattern, Unindexed


def register() -> None:
    """Let SQLAlchemy know. To do so again changes nothing."""
    compiles(Unindexed, "sqlite")(_unindexed)
    compiles(MatchesPattern, "sqlite")(_matches_pattern)
    compiles(JsonValues, "sqlite")(_json_values)


def _unindexed(element: Unindexed, compiler: SQLCompiler, **how: Any) -> str:
    return f"+{compiler.process(element.clauses, **how)}"


def _matches_pattern(element: MatchesPattern, compiler: SQLCompiler, **how: Any) -> str:
    column, pattern = (compiler.process(one, **how) for one in element.clauses)
    return f"({column} GLOB {pattern})"


def _json_values(element: JsonValues, compiler: SQLCompiler, **how: Any) -> str:
    return f"json_each({compiler.process(element.clauses, **how)})"
