"""A column that names the coordinate reference system of the positions, as in CSV that Urquhart wrote."""

from typing import Final

from pyproj import CRS
from pyproj.exceptions import CRSError

from server.stem_maps.formats.table import FileTable, StemMapError

SYSTEM_COLUMN: Final = "crs"


def take_system_column(table: FileTable) -> None:
    """Make the system that a column `crs` names that of the table, and take the column away.

    A column of that name with anything else stays: it is an attribute of the trees.

    Raises:
        StemMapError: rows name different systems.
    """
    found = [position for position, name in enumerate(table.names) if name.strip().lower() == SYSTEM_COLUMN]
    if len(found) != 1 or table.crs is not None:
        return
    systems = {text: line for text, line in zip(table.texts(found[0]), table.lines.tolist(), strict=True) if text}
    if not systems or not all(map(_is_system, systems)):
        return
    if len(systems) > 1:
        first, second = sorted(systems)[:2]
        raise StemMapError(
            table.path,
            f"its column {table.names[found[0]]!r} names {len(systems)} systems, such as {first} and {second}: give "
            "each its own file, or --ignore the column",
            systems[second],
        )
    table.crs = next(iter(systems))
    del table.names[found[0]], table.columns[found[0]]
    table.notes.append(f"system {table.crs} from a column")


def _is_system(text: str) -> bool:
    """Whether a text is the code of a system, such as `EPSG:25832`, or its well-known text."""
    if ":" not in text and "[" not in text:
        return False
    try:
        CRS.from_user_input(text)
    except CRSError:
        return False
    return True
