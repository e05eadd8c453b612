"""A season as it was sent: one file, or several in a zip archive, written into a folder under names that are safe."""

import shutil
import zipfile
import zlib
from pathlib import Path
from typing import Final

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

    Folders of an archive are passed over: all its files lie in one folder, as `urquhart coregister` reads them.

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
    try:
        with zipfile.ZipFile(sent) as archive:
            _write(archive, _members(archive, most), folder, most)
    except (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, ValueError) as error:
        raise InvalidFile(
            f"{name}: is no zip archive that can be read: {error}. Pack the files again, without a password."
        ) from error
    _check_options(folder)


def _members(archive: zipfile.ZipFile, most: int) -> dict[str, zipfile.ZipInfo]:
    """The files of an archive by their names without folders. Raises InvalidFile."""
    found: dict[str, zipfile.ZipInfo] = {}
    for one in archive.infolist():
        *folders, name = one.filename.replace("\\", "/").split("/")
        if one.is_dir() or name.startswith(".") or "__MACOSX" in folders:
            continue
        if not name or len(name) > _LONGEST_NAME or not name.isprintable():
            raise InvalidFile(f"The archive has a file with a name that cannot be used: {name[:60]!r}. Rename it.")
        if name in found:
            raise InvalidFile(f"The archive has two files {name!r}, in different folders. Give them different names.")
        found[name] = one
    if not found:
        raise InvalidFile("The archive has no file.")
    if len(found) > _MOST_FILES:
        raise InvalidFile(f"The archive has {len(found)} files, and may have {_MOST_FILES}. Send it in parts.")
    size = sum(one.file_size for one in found.values())
    if size > most:
        raise InvalidFile(f"The archive unpacks to {size} bytes, and may to {most} (`import_bytes`). Send it in parts.")
    return found


def _write(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], folder: Path, most: int) -> None:
    """Write files, and no more bytes than they may have, whatever the archive says of them."""
    left = most
    for name, one in members.items():
        with archive.open(one) as source, (folder / name).open("xb") as file:
            while piece := source.read(_PIECE):
                left -= len(piece)
                if left < 0:
                    raise InvalidFile(f"The archive unpacks to more than {most} bytes (`import_bytes`).")
                file.write(piece)


def _check_options(folder: Path) -> None:
    """Refuse a `columns.toml` that cannot be read, or names a file elsewhere. Raises InvalidFile."""
    path = folder / COLUMNS_FILE
    if not path.exists():
        return
    if path.stat().st_size > _MOST_OPTIONS:
        raise InvalidFile(f"{COLUMNS_FILE} is too large: it has a line for each option.")
    try:
        centres = with_columns_file(path, ReadOptions()).centres
    except StemMapError as error:
        raise InvalidFile(str(error).replace(f"{folder}/", "")) from error
    if centres is not None and (centres.resolve().parent != folder.resolve()):
        raise InvalidFile(f"{COLUMNS_FILE} names the centres {centres.name!r} in another folder. Put them beside it.")
