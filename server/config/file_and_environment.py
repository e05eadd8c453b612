"""The sources of settings: a TOML file and the environment. Both may contain only known names."""

import difflib
import os
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel
from pydantic.fields import FieldInfo

PREFIX: Final = "URQUHART_"
DEFAULT_FILE: Final = "urquhart.toml"
NESTED: Final = "__"
CLIENTS: Final = frozenset({"URQUHART_URL", "URQUHART_API_KEY"})
"""Variables of the client, which has the same prefix."""


class Misconfigured(Exception):
    """The settings cannot be used. `str(error)` says which one, and where it is set."""


def fields(model: type[BaseModel], above: tuple[str, ...] = ()) -> Iterator[tuple[str, FieldInfo]]:
    """Every setting of a model that is not itself a group of settings, by dotted name: `limits.page_default`."""
    for name, field in model.model_fields.items():
        group = field.annotation
        if isinstance(group, type) and issubclass(group, BaseModel):
            yield from fields(group, (*above, name))
        else:
            yield ".".join((*above, name)), field


def groups(model: type[BaseModel]) -> list[str]:
    """Names of the groups of settings."""
    return sorted({name.partition(".")[0] for name, _ in fields(model) if "." in name})


def variable(name: str) -> str:
    """The environment variable of a setting: `limits.page_default` -> `URQUHART_LIMITS__PAGE_DEFAULT`."""
    return PREFIX + name.replace(".", NESTED).upper()


def config_file(given: str | None, environ: Mapping[str, str] = os.environ) -> Path | None:
    """The settings file: the given one, the one in the environment, or `urquhart.toml` if it exists.

    Raises:
        Misconfigured: the one that is asked for is not there.
    """
    asked = given or next((value for key, value in environ.items() if key.upper() == f"{PREFIX}CONFIG"), "")
    path = Path(asked or DEFAULT_FILE)
    if path.is_file():
        return path
    if asked:
        raise Misconfigured(f"{path}: no such settings file")
    return None


def read_file(path: Path, model: type[BaseModel]) -> dict[str, Any]:
    """The values of a TOML file, in tables by group.

    Raises:
        Misconfigured: it cannot be read, is not TOML, or names something that is no setting.
    """
    try:
        with path.open("rb") as opened:
            values = tomllib.load(opened)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise Misconfigured(f"{path}: not TOML: {error}") from error
    except OSError as error:
        raise Misconfigured(f"{path}: {error.strerror}") from error
    known, tables = [name for name, _ in fields(model)], groups(model)
    for name in flat(values):
        head = name.partition(".")[0]
        if name == "config":
            raise Misconfigured(f"{path}: the setting config names this file and cannot be set in it: remove it")
        if name in tables and "." not in name:
            raise Misconfigured(f"{path}: {name} is a table: write [{name}]")
        if name not in known:
            candidates = known if head in tables else [*known, *tables]
            raise Misconfigured(f"{path}: there is no setting {name}{_nearest(name, candidates)}")
    return values


def check_environment(model: type[BaseModel], environ: Mapping[str, str] = os.environ) -> None:
    """Refuse environment variables with our prefix and an unknown name, so that a misspelt setting is noticed.

    Those of the client are allowed, because it is used on the service's machine as well.

    Raises:
        Misconfigured: with the nearest name that there is.
    """
    known = {variable(name) for name, _ in fields(model)} | {variable(name) for name in groups(model)}
    for name in sorted(environ):
        if name.upper().startswith(PREFIX) and name.upper() not in known | CLIENTS:
            raise Misconfigured(f"environment: there is no setting {name}{_nearest(name.upper(), sorted(known))}")


def flat(values: Mapping[str, Any], above: tuple[str, ...] = ()) -> dict[str, Any]:
    """Nested values by dotted name."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            found |= flat(value, (*above, name))
        else:
            found[".".join((*above, name))] = value
    return found


def in_environment(name: str, environ: Mapping[str, str] = os.environ) -> str | None:
    """The environment variable that sets a setting, as it is written there. Empty variables are ignored."""
    wanted = {variable(name), variable(name.partition(".")[0])}
    return next((key for key, value in environ.items() if value and key.upper() in wanted), None)


def _nearest(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return f"; did you mean {near[0]}?" if near else "; urquhart config lists them"
