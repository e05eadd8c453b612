"""Figures as JSON, short enough to be read in a diff."""

import json
from pathlib import Path
from typing import Any


def write(path: Path, figures: dict[str, Any]) -> None:
    """Write figures with six significant digits: enough for any of them, and a file that a diff can be read in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(_text(_short(figures), 0) + "\n", encoding="utf-8")


def read(path: Path) -> dict[str, Any]:
    """What `write` wrote."""
    figures: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return figures


def _short(value: Any) -> Any:
    if isinstance(value, float):
        # NaN is no JSON: a figure that does not exist is null.
        return float(f"{value:.6g}") if value == value and abs(value) != float("inf") else None
    if isinstance(value, dict):
        return {str(key): _short(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_short(entry) for entry in value]
    return value


def _text(value: Any, depth: int) -> str:
    """JSON with a line for each entry of a dictionary and lists of numbers in one line."""
    if isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        inner = ",\n".join(" " * (depth + 1) + json.dumps(entry) for entry in value)
        return f"[\n{inner}\n{' ' * depth}]"
    if isinstance(value, dict) and value:
        inner = ",\n".join(
            f"{' ' * (depth + 1)}{json.dumps(key)}: {_text(entry, depth + 1)}" for key, entry in value.items()
        )
        return f"{{\n{inner}\n{' ' * depth}}}"
    return json.dumps(value, separators=(",", ":"))
