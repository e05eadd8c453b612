"""Bytes to text: UTF-8, UTF-16 and UTF-32 with or without a byte order mark, and Windows-1252 as the last resort."""

from pathlib import Path
from typing import Final

from server.stem_maps.formats.table import StemMapError

_MARKS: Final = (
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
    (b"\xef\xbb\xbf", "utf-8-sig"),
)
_SAMPLE: Final = 4096
"""Bytes from which UTF-16 without a byte order mark is told."""
_FORMATS: Final = {
    b"\xd0\xcf\x11\xe0": "an old Excel file, or one with a password: save it as xlsx without a password",
    b"PK\x03\x04": "a zip archive: unpack it, or give it the suffix xlsx if it is a spreadsheet",
    b"\x1f\x8b": "compressed: unpack it",
    b"SQLite format 3": "a SQLite file: give it the suffix gpkg if it is a GeoPackage",
    b"LASF": "a point cloud: give it the suffix las or laz",
    b"%PDF": "a PDF: export the table as CSV",
    b"PAR1": "a Parquet file: give it the suffix parquet",
    b"RDX": "R's own format: write the table with write.csv or sf::st_write",
    b"BZh": "compressed: unpack it",
}


def decode(path: Path, data: bytes) -> tuple[str, str]:
    """The text of `data` without a byte order mark, and the encoding's name, empty for UTF-8.

    Raises:
        StemMapError: it is no text.
    """
    for magic, kind in _FORMATS.items():
        if data.startswith(magic):
            raise StemMapError(path, f"is no text but {kind}")
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), None) or _unmarked(data)
    if encoding is not None:
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError as error:
            raise StemMapError(path, f"is not {encoding} text: save the file as CSV in UTF-8") from error
        told = "" if encoding == "utf-8-sig" else encoding.upper().removesuffix("-LE").removesuffix("-BE")
    else:
        try:
            text, told = data.decode("utf-8"), ""
        except UnicodeDecodeError:
            # Every byte is a character in Latin-1; where Windows-1252 has one, it is the one that was meant.
            text, told = data.decode("cp1252", errors="replace"), "Windows-1252 (Latin-1)"
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise StemMapError(path, "is no text: it holds NUL characters; save the file as CSV in UTF-8", line)
    return text, told


def _unmarked(data: bytes) -> str | None:
    """UTF-16 without a byte order mark: every other byte of Latin letters and digits is NUL."""
    sample = data[:_SAMPLE]
    half = len(sample) // 2
    if half < 4:
        return None
    if sample[1::2].count(0) > 0.9 * half and sample[::2].count(0) < 0.1 * half:
        return "utf-16-le"
    if sample[::2].count(0) > 0.9 * half and sample[1::2].count(0) < 0.1 * half:
        return "utf-16-be"
    return None
