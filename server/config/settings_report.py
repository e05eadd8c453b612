"""The settings in force, each with its default and where it was set; and the documentation of all of them."""

import json
from dataclasses import asdict, dataclass
from typing import Any, Final, Literal, get_args, get_origin

from pydantic import BaseModel, SecretStr
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from server.config.settings import Settings
from server.config.settings_loading import Origins
from server.config.settings_sources import (
    fields,
    flat,
    groups,
    variable,
)

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
class SettingReport:
    """A setting as it is reported.

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


def describe(settings: Settings, **given: Any) -> list[SettingReport]:
    """Every setting, in the order in which the model has them; `given` are those that were options."""
    sources = Origins(Settings, given)
    values = flat(settings.model_dump())
    return [
        SettingReport(
            name,
            variable(name),
            HIDDEN if is_secret(field) and values[name] else values[name],
            default_of(field),
            sources.of(name),
            field.description or "",
        )
        for name, field in fields(Settings)
    ]


def as_json(settings: list[SettingReport]) -> str:
    """A JSON array of them."""
    return json.dumps([asdict(one) for one in settings], indent=2, default=str)


def as_text(settings: list[SettingReport]) -> str:
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


def _shown(value: Any) -> str:
    return "" if value is None else json.dumps(value, default=str) if isinstance(value, str | bool) else str(value)


def _code(value: Any) -> str:
    return "" if value is None or value == "" else f"`{_shown(value)}`"
