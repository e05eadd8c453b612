"""Files of a season made one upload: a single file as it is, several as a zip archive."""

import shutil
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

_OPTIONS: Final = "columns.toml"
_LONG_AGO: Final = (1980, 1, 1, 0, 0, 0)
"""The time of all files in an archive, so that the same files make the same archive."""


@contextmanager
def one_upload(paths: Sequence[Path], positions: Path | None) -> Iterator[Path]:
    """The file to send, which exists within the block.

    A folder stands for the files in it. The parts of a Shapefile, and a `columns.toml` beside the files, are sent, too.
    If two files have one name, all have the names of their folders before theirs.

    Raises:
        ValueError: there is no file, or two of them have one name in folders of one name.
        OSError: a file cannot be read.
    """
    files = _files(paths, positions)
    if len(files) == 1 and positions is None:
        yield files[0]
        return
    with TemporaryDirectory(prefix="urquhart-") as folder:
        packed = Path(folder) / "season.zip"
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, path in _names(files).items():
                about = zipfile.ZipInfo(name, _LONG_AGO)
                about.compress_type = zipfile.ZIP_DEFLATED
                with path.open("rb") as source, archive.open(about, "w", force_zip64=True) as target:
                    shutil.copyfileobj(source, target)
        yield packed


def _files(paths: Sequence[Path], positions: Path | None) -> list[Path]:
    found: dict[Path, None] = {}
    for path in paths:
        inside = sorted(path.iterdir()) if path.is_dir() else _with_parts(path)
        found |= dict.fromkeys(one for one in inside if one.is_file() and not one.name.startswith("."))
        if not path.is_dir():
            path.stat()  # raises if it is not there
    if positions is not None:
        positions.stat()
        found.setdefault(positions)
    if not found:
        raise ValueError("there is no file of plots to send")
    found |= dict.fromkeys(one for path in list(found) if (one := path.with_name(_OPTIONS)).is_file())
    return list(found)


def _names(files: Sequence[Path]) -> dict[str, Path]:
    """The files by their names in the archive. Raises ValueError."""
    plain = {path.name: path for path in files}
    if len(plain) == len(files):
        return plain
    names: dict[str, Path] = {}
    for path in files:
        name = f"{path.resolve().parent.name}/{path.name}"
        other = names.setdefault(name, path)
        if other != path:
            raise ValueError(f"two files have the name {name}: {other} and {path}; rename one, or send them apart")
    return names


def _with_parts(path: Path) -> list[Path]:
    """The file, and with a Shapefile the other files that belong to it."""
    return sorted(path.parent.glob(f"{path.stem}.*")) if path.suffix.lower() == ".shp" else [path]
