"""The settings as a whole: put together, told with where each comes from, and written down for people."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal, get_args, get_origin

from pydantic import BaseModel, SecretStr, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from server.settings import Settings
from server.sources import Misconfigured, config_file, fields, flat, groups, in_environment, read_file, variable

HIDDEN: Final = "(hidden)"
_BOUNDS: Final = {"ge": "at least", "gt": "more than", "le": "at most", "lt": "less than"}
_HEAD: Final = """\
# Settings

Written by `urquhart config --markdown`.

Each setting stands in a file, in the environment, or on the command line where a verb has an option for it. An option
goes before the environment, the environment before the file. The file is TOML: `urquhart.toml` in the working folder,
or the one that `--config` or `URQUHART_CONFIG` names. What is no setting is refused, in the file and in the environment
(whatever begins with `URQUHART_`, but for the client's `URQUHART_URL` and `URQUHART_API_KEY`), with the nearest name
that there is. `urquhart config` prints what is in force and where it comes from.

```toml
database = "/var/lib/urquhart/urquhart.db"

[limits]
requests_per_second = 20

[log]
format = "json"
```
"""


@dataclass(frozen=True, slots=True)
class Told:
    """A setting as it is told.

    Attributes:
        name, variable: in the file (dotted), and in the environment.
        value, default: as they are; a secret is hidden.
        source: `default`, the file's name, the variable's name, or `option`.
        about: a sentence.
    """

    name: str
    variable: str
    value: Any
    default: Any
    source: str
    about: str


def load(**given: Any) -> Settings:
    """The settings, with those that are `given` (not None) before all others.

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


def told(settings: Settings, **given: Any) -> list[Told]:
    """Every setting, in the order in which the model has them; `given` are those that were options."""
    sources = _Sources(Settings, given)
    values = flat(settings.model_dump())
    return [
        Told(
            name,
            variable(name),
            HIDDEN if is_secret(field) and values[name] else values[name],
            default_of(field),
            sources.of(name),
            field.description or "",
        )
        for name, field in fields(Settings)
    ]


def as_json(settings: list[Told]) -> str:
    """A JSON array of them."""
    return json.dumps([asdict(one) for one in settings], indent=2, default=str)


def as_text(settings: list[Told]) -> str:
    """A table in plain text."""
    rows = [("setting", "value", "default", "from")]
    rows += [(one.name, _shown(one.value), _shown(one.default), one.source) for one in settings]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def as_markdown(model: type[BaseModel] = Settings) -> str:
    """The documentation of every setting."""
    parts = [_HEAD]
    for group in ["", *groups(model)]:
        rows = [(name, field) for name, field in fields(model) if name.rpartition(".")[0] == group]
        if group:
            about = model.model_fields[group].description
            parts.append(f"\n## `[{group}]`\n\n{about}\n")
        parts.append("\n| setting | variable | default | allowed | what it does |\n| --- | --- | --- | --- | --- |\n")
        parts += [
            f"| `{name.rpartition('.')[2]}` | `{variable(name)}` | {_code(default_of(field))} | {allowed(field)} "
            f"| {field.description} |\n"
            for name, field in rows
        ]
    return "".join(parts)


def allowed(field: FieldInfo) -> str:
    """Which values a setting may have, in words."""
    if get_origin(field.annotation) is Literal:
        return ", ".join(f"`{choice}`" for choice in get_args(field.annotation))
    words = [
        f"{word} {getattr(bound, name):,}"
        for bound in field.metadata
        for name, word in _BOUNDS.items()
        if getattr(bound, name, None) is not None
    ]
    if words:
        return ", ".join(words)
    return "`true`, `false`" if field.annotation is bool else "text"


def default_of(field: FieldInfo) -> Any:
    """What a setting is where nobody says anything; a secret's is hidden, too."""
    if is_secret(field):
        return None
    value = field.get_default(call_default_factory=True, validated_data={})
    return None if value is PydanticUndefined else value


def is_secret(field: FieldInfo) -> bool:
    """Whether the value must never be shown."""
    return field.annotation is SecretStr or SecretStr in get_args(field.annotation)


class _Sources:
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
    message = first["msg"].removeprefix("Value error, ")
    name = ".".join(str(part) for part in first["loc"])
    if not name:
        return message
    source = _Sources(Settings, options).of(name)
    match source:
        case "option":
            where = f"option --{name}"
        case _ if source.upper() == variable(name) or source == "default":
            where = f"setting {variable(name)}"
        case _:
            where = f"{source}: {name}"
    return f"{where}: {message}"


def _shown(value: Any) -> str:
    return "" if value is None else json.dumps(value, default=str) if isinstance(value, str | bool) else str(value)


def _code(value: Any) -> str:
    return "" if value is None or value == "" else f"`{_shown(value)}`"
