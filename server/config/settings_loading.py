"""Load the settings from options, environment and file, and find out where each was set."""

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from server.config.file_and_environment import Misconfigured, config_file, flat, in_environment, read_file, variable
from server.config.settings import Settings
from server.parsing.field_errors import sentence


def load(**given: Any) -> Settings:
    """The settings. Those that are `given` (not None) take precedence over all others.

    Raises:
        Misconfigured: in one sentence, which setting, where it stands and what it may be.
    """
    options: dict[str, Any] = {
        name: str(value) if isinstance(value, Path) else value for name, value in given.items() if value is not None
    }
    try:
        return Settings(**options)
    except ValidationError as error:
        raise Misconfigured(_sentence(error, options)) from error


class Origins:
    """Finds out where a value was set."""

    def __init__(self, model: type[BaseModel], given: dict[str, Any]) -> None:
        self._given = {name for name, value in given.items() if value is not None}
        path = config_file(None if given.get("config") is None else str(given["config"]))
        self._path = path
        self._in_file = set() if path is None else set(flat(read_file(path, model)))

    def of(self, name: str) -> str:
        """`option`, the variable's name, the file's name, or `default`."""
        if name in self._given:
            return "option"
        return in_environment(name) or (str(self._path) if name in self._in_file else "default")


def _sentence(error: ValidationError, options: dict[str, Any]) -> str:
    first = error.errors()[0]
    message = sentence(first)
    name = ".".join(str(part) for part in first["loc"])
    if not name:
        return message
    source = Origins(Settings, options).of(name)
    match source:
        case "option":
            where = f"option --{name}"
        case _ if source.upper() == variable(name) or source == "default":
            where = f"setting {variable(name)}"
        case _:
            where = f"{source}: {name}"
    return f"{where}: {message}"
