"""The tables that a collection is exported as, by name."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, Literal

from server.exports.match_layers import match_layer, match_rows, pair_layer, pair_rows
from server.exports.selection import ExportChoice, ExportPlaces, places_of
from server.exports.submap_layers import landmark_layer, landmark_rows, submap_layer, submap_rows
from server.outputs.tables import OutputLayer, OutputRows
from server.store.storage import Storage
from urquhart import Budget

LayerName = Literal["landmarks", "submaps", "matches", "pairs"]
_Rows = Callable[[Storage, ExportPlaces, ExportChoice, Budget | None], Iterator[OutputRows]]

_LAYERS: Final[dict[LayerName, tuple[Callable[[ExportPlaces], OutputLayer], _Rows]]] = {
    "landmarks": (landmark_layer, landmark_rows),
    "submaps": (submap_layer, submap_rows),
    "matches": (match_layer, match_rows),
    "pairs": (pair_layer, pair_rows),
}
_TOGETHER: Final = 5000
"""Rows that are written at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Export:
    """A table that is ready to be read: its columns and system, and its rows, which are read as they are taken."""

    layer: OutputLayer
    rows: Iterator[OutputRows]


def export_of(
    database: Storage, collection_id: str, name: LayerName, choice: ExportChoice, budget: Budget | None = None
) -> Export:
    """The table `name` of a collection.

    Raises:
        NotFound: there is no such collection.
        InvalidField: its map frames have several coordinate reference systems, and none is chosen.
        NotAcceptable: longitude and latitude are asked for, and no map frame has a CRS.
    """
    places = places_of(database, collection_id, choice)
    layer_of, rows_of = _LAYERS[name]
    return Export(layer_of(places), together(rows_of(database, places, choice, budget)))


def together(batches: Iterator[OutputRows]) -> Iterator[OutputRows]:
    """The same rows in batches of some thousands, because writing a batch costs as much as a few hundred rows."""
    waiting: list[OutputRows] = []
    for rows in batches:
        waiting.append(rows)
        if sum(map(len, waiting)) >= _TOGETHER:
            yield OutputRows.joined(waiting)
            waiting = []
    if waiting:
        yield OutputRows.joined(waiting)
