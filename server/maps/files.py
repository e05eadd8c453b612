"""The trees of a map as files: one for each part, because parts that nothing connects have no common frame."""

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from server.collections.crud import get_collection
from server.collections.frame_systems import frame_systems
from server.maps.building import BuiltMap
from server.maps.documents import trees_of
from server.outputs.files import write_table
from server.outputs.tables import OutputColumn, OutputLayer, OutputRows
from server.schemas.maps.answers import LandmarkEntry
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction

_COLUMNS: Final = (
    OutputColumn("id", "integer"),
    OutputColumn("sigma_m", "real"),
    OutputColumn("dbh_cm", "real"),
    OutputColumn("height_m", "real"),
    OutputColumn("observed", "integer"),
    OutputColumn("missed", "integer"),
    OutputColumn("first_seen", "time"),
    OutputColumn("last_seen", "time"),
)


def write_trees(tx: ReadTransaction, collection_id: str, built: BuiltMap, path: Path) -> list[tuple[Path, int]]:
    """Write the trees of the parts of a map: the largest to `path`, part 2 to a file with `-2` in its name, and so on.

    Submaps that nothing connects have no frame in the map, and are left out. Returns each file with its number of
    trees. Raises NotFound, NotAcceptable and OSError.
    """
    collection, trees = get_collection(tx, collection_id), list(trees_of(built))
    written: list[tuple[Path, int]] = []
    frame_of = dict(zip(built.part_numbers, built.frames, strict=True))
    for number in sorted(frame_of):
        frame = frame_of[number]
        if frame is not None:
            layer, rows = tree_layer(tx, collection, frame, [tree for tree in trees if tree.part == number])
            file = path.with_stem(f"{path.stem}-{number}") if written else path
            written.append((file, write_table(file, layer, [rows])))
    return written


def tree_layer(
    tx: ReadTransaction, collection: CollectionRecord, frame: str, trees: Sequence[LandmarkEntry]
) -> tuple[OutputLayer, OutputRows]:
    """The table of the trees of one part, in the coordinate reference system of its map frame."""
    system = frame_systems(tx, collection, [frame])[frame]
    xy = np.array([(tree.x, tree.y) for tree in trees], np.float64).reshape(-1, 2)
    values = [[_value(tree, column.name) for tree in trees] for column in _COLUMNS]
    return OutputLayer("trees", _COLUMNS, system), OutputRows(values, system.full(xy))


def _value(tree: LandmarkEntry, name: str) -> Any:
    if name == "sigma_m":
        # The standard deviation of the position along its worst direction.
        return float(np.sqrt(np.linalg.eigvalsh(np.reshape(tree.covariance, (2, 2)))[-1]))
    value = getattr(tree, name)
    return datetime.fromisoformat(value) if name in ("first_seen", "last_seen") and value is not None else value
