"""A season as it was sent: one file, or several in a zip archive, written into a folder under names that are safe.

All files lie in one folder, as `urquhart coregister` reads them. If two have one name, the folders of the archive stay.
"""

import shutil
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Final

from server.coregistration.season import SUFFIXES
from server.errors import InvalidFile, StorageUnavailable
from server.stem_maps.formats.table import StemMapError
from server.stem_maps.reading.options import COLUMNS_FILE, ReadOptions, with_columns_file

ARCHIVE: Final = ".zip"
_MOST_FILES: Final = 10_000
_LONGEST_NAME: Final = 200
_PIECE: Final = 1 << 20
_MOST_OPTIONS: Final = 65_536
"""Bytes of a `columns.toml`, which this process reads."""


def unpack(sent: Path, name: str, folder: Path, most: int) -> None:
    """Write the files of a season into `folder`, in the place of what it holds.

    Args:
        sent: the file as it was sent.
        name: its name, which says whether it is an archive.
        folder: is created.
        most: bytes that the files of an archive may have together.

    Raises:
        InvalidFile: the archive cannot be used, and the sentence says why.
        StorageUnavailable: the file is gone.
        OSError: the folder cannot be written.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if not sent.exists():
        raise StorageUnavailable("The upload is missing from the folder of jobs. Send the files again.")
    if not name.lower().endswith(ARCHIVE):
        shutil.copyfile(sent, folder / name)
        return
    with _opened(sent, name) as archive:
        members = _members(archive, most)
        _write(archive, members, folder, most)
    for parent in dict.fromkeys((folder / one).parent for one in members):
        _check_options(parent, str(parent.relative_to(folder)))


def check(sent: Path, name: str, most: int) -> None:
    """Refuse what `unpack` will refuse, as far as it can be told without unpacking. Arguments are those of `unpack`.

    Raises:
        InvalidFile: the archive cannot be used, or has no file of trees.
    """
    if name.lower().endswith(ARCHIVE):
        with _opened(sent, name) as archive:
            if not any(Path(one).suffix.lower() in SUFFIXES for one in _members(archive, most)):
                raise InvalidFile(f"{name}: has no file of trees: none ends in {', '.join(sorted(SUFFIXES))}.")


@contextmanager
def _opened(sent: Path, name: str) -> Iterator[zipfile.ZipFile]:
    """The archive, whose faults become InvalidFile."""
    try:
        with zipfile.ZipFile(sent) as archive:
            yield archive
    except (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, ValueError) as error:
        raise InvalidFile(
            f"{name}: is no zip archive that can be read: {error}. Pack the files again, without a password."
        ) from error


def _members(archive: zipfile.ZipFile, most: int) -> dict[str, zipfile.ZipInfo]:
    """The files of an archive by where they are written: their names, with their folders if two are the same.

    Raises InvalidFile.
    """
    found: dict[PurePosixPath, zipfile.ZipInfo] = {}
    for one in archive.infolist():
        *folders, name = [part for part in one.filename.replace("\\", "/").split("/") if part not in ("", ".")] or [""]
        if one.is_dir() or name.startswith(".") or "__MACOSX" in folders:
            continue
        for part in (*folders, name):
            if not part or len(part) > _LONGEST_NAME or not part.isprintable() or part == "..":
                raise InvalidFile(f"The archive has a file with a name that cannot be used: {part[:60]!r}. Rename it.")
        path = PurePosixPath(*folders, name)
        if path in found:
            raise InvalidFile(f"The archive has two files {str(path)!r}. Give them different names.")
        found[path] = one
    if not found:
        raise InvalidFile("The archive has no file.")
    if len(found) > _MOST_FILES:
        raise InvalidFile(f"The archive has {len(found)} files, and may have {_MOST_FILES}. Send it in parts.")
    size = sum(one.file_size for one in found.values())
    if size > most:
        raise InvalidFile(f"The archive unpacks to {size} bytes, and may to {most} (`import_bytes`). Send it in parts.")
    if len({path.name for path in found}) == len(found):
        return {path.name: one for path, one in found.items()}
    _check_folders(set(found))
    return {str(path): one for path, one in found.items()}


def _check_folders(paths: set[PurePosixPath]) -> None:
    """Refuse files that stay in folders if one lies where a folder is to be, or if a `columns.toml` would not count.

    Raises InvalidFile.
    """
    folders = {parent for path in paths for parent in path.parents}
    if paths & folders:
        raise InvalidFile(f"The archive has a file and a folder {str(min(paths & folders))!r}. Rename one.")
    for options in (path for path in paths if path.name == COLUMNS_FILE):
        for path in sorted(paths):
            if options.parent in path.parents and path.parent / COLUMNS_FILE not in paths:
                raise InvalidFile(
                    f"The archive has files of one name in different folders, so {COLUMNS_FILE} counts for its own "
                    f"folder only, and {str(path.parent)!r} has none. Put one there, too, or rename the files."
                )


def _write(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], folder: Path, most: int) -> None:
    """Write files, and no more bytes than they may have, whatever the archive says of them."""
    left = most
    for name, one in members.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        with archive.open(one) as source, (folder / name).open("xb") as file:
            while piece := source.read(_PIECE):
                left -= len(piece)
                if left < 0:
                    raise InvalidFile(f"The archive unpacks to more than {most} bytes (`import_bytes`).")
                file.write(piece)


def _check_options(folder: Path, where: str) -> None:
    """Refuse a `columns.toml` that cannot be read, or names a file elsewhere; `where`: the folder's name in the
    archive. Raises InvalidFile."""
    path = folder / COLUMNS_FILE
    if not path.exists():
        return
    if path.stat().st_size > _MOST_OPTIONS:
        raise InvalidFile(f"{COLUMNS_FILE} in {where!r} is too large: it has a line for each option.")
    try:
        centres = with_columns_file(path, ReadOptions()).centres
    except StemMapError as error:
        raise InvalidFile(str(error).replace(f"{folder}/", "")) from error
    if centres is not None and (centres.resolve().parent != folder.resolve()):
        raise InvalidFile(f"{COLUMNS_FILE} names the centres {centres.name!r} in another folder. Put them beside it.")
