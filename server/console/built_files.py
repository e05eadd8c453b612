"""The files of the console as `make ui` built them, held in memory.

They are committed, so `make demo`, `make serve` and an installation from the wheel need no node. `build.json` beside
them has a hash of their sources; a test compares it.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

FOLDER: Final = Path(__file__).parent / "assets"
PAGE: Final = "index.html"
_TYPES: Final[Mapping[str, str]] = {
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True, slots=True)
class BuiltFile:
    """A file of the console: its bytes and media type, and an entity tag, which changes with the bytes."""

    content: bytes
    media_type: str
    etag: str


@dataclass(frozen=True, slots=True)
class BuiltFiles:
    """The console: the one page, and the files it loads, by name. A file's name holds a hash of its contents."""

    page: BuiltFile
    files: Mapping[str, BuiltFile]


def read_built_files(folder: Path = FOLDER) -> BuiltFiles:
    """Read all files of a build. Raises OSError if there is none."""
    files = {
        path.name: _read(path, _TYPES[path.suffix])
        for path in sorted((folder / "files").iterdir())
        if path.suffix in _TYPES
    }
    return BuiltFiles(_read(folder / PAGE, "text/html; charset=utf-8"), MappingProxyType(files))


def _read(path: Path, media_type: str) -> BuiltFile:
    content = path.read_bytes()
    return BuiltFile(content, media_type, hashlib.sha256(content).hexdigest()[:32])
