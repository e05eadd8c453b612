"""The JSON bodies of requests in files. Other files of trees are read by the service."""

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any


class FileError(ValueError):
    """A file that cannot be read. The message is one line that begins with the file's name."""


def read_body(path: Path, members: Collection[str]) -> dict[str, Any]:
    """The members of a JSON object, which must be among `members`. Raises FileError."""
    try:
        body = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=_once_each, parse_constant=_no_number)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error
    if not isinstance(body, dict):
        raise FileError(f"{path}: not a JSON object")
    unknown = sorted(set(body) - set(members))
    if unknown:
        raise FileError(f"{path}: the member {unknown[0]!r} is not known here; known are {', '.join(sorted(members))}")
    return body


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the member {twice!r} is there twice: keep one")
    return members


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number in JSON: leave such trees out")
