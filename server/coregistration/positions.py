"""A table of where plots ought to be, such as from GNSS: read, converted to the map's system, compared with the map."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.collections.crud import get_collection
from server.collections.frame_systems import FrameSystem, frame_systems
from server.stem_maps.formats.table import StemMapError
from server.stem_maps.reader import read_centres
from server.stem_maps.reading.centres import Centres
from server.stem_maps.reading.options import ReadOptions
from server.store.storage import Storage

_SIGMAS: Final = 6.0
"""Standard deviations,"""
_BEYOND: Final = 1_000.0
"""and metres beyond the map's edge, from which a position is not in the map."""
_SHOWN: Final = 5


@dataclass(frozen=True, slots=True)
class SeasonPositions:
    """Where plots ought to be, metres, in the system of the map; `told` are sentences about it, for people."""

    places: dict[str, tuple[float, float]]
    told: tuple[str, ...]

    def told_of(self, file: str, plots: set[str]) -> list[str]:
        """What to know: which of the `plots` have no position, and which positions no plot; a misspelt name is both."""
        told = list(self.told)
        for names, what in (
            (plots - self.places.keys(), "have no position and are searched everywhere"),
            (self.places.keys() - plots, "are no plot"),
        ):
            if names:
                told.append(f"{file}: {len(names)} names {what}: {_named(names)}")
        return told


ReadCentres = Callable[[Path, ReadOptions, str | None], Centres]
"""As `read_centres`."""


def read_positions(
    path: Path,
    known_of_it: tuple[ReadOptions, str | None],
    storage: Storage,
    where: tuple[str, str, float],
    read: ReadCentres = read_centres,
) -> SeasonPositions:
    """The positions in `path`, in the system of a map frame.

    Args:
        path: a file with the columns plot, x and y.
        known_of_it: the options of the plots' files, and the positions' system, if the caller gave it. `crs` of the
            options is theirs, too, if neither the caller nor their file says it; without any of these, it is the map's.
        storage: the database.
        where: ids of a collection and of one of its map frames, and the standard deviation of a position, metres.
        read: reads the file.

    Raises:
        NotFound: there is no such collection.
        StemMapError: the file cannot be used, cannot be converted, or no position lies in the map.
    """
    (options, named), (collection_id, frame_id, sigma) = known_of_it, where
    with storage.read() as tx:
        collection = get_collection(tx, collection_id)
        system = frame_systems(tx, collection, [frame_id])[frame_id]
        extent = tx.map_frames(collection).extent(frame_id)
    of_map = system.name if system.crs is not None else None
    unit = None if named is not None or options.crs is not None else options.unit
    asked = ReadOptions(unit=unit, crs=named, project=of_map or options.project, from_file=("unit", "project"))
    known = read(path, asked, options.crs)
    if known.crs is None and unit is None:
        # They are taken for those of the map, in its unit.
        scaled = {
            name: (x * system.metres_per_unit, y * system.metres_per_unit) for name, (x, y) in known.places.items()
        }
        known = Centres(path, scaled, of_map)
    if of_map is None and known.crs is not None and system.name not in (None, known.crs):
        raise StemMapError(
            path, f"is in {known.crs}, which cannot be converted to {system.name!r}, the system of the map: convert it"
        )
    outside = _outside(known, system, extent, _SIGMAS * sigma + _BEYOND)
    told = [f"{path.name}: {len(known.places)} positions in {known.crs or 'metres of the map'}"]
    if outside:
        told.append(f"{path.name}: {len(outside)} positions lie outside of the map: {_named(outside)}")
    return SeasonPositions(known.places, tuple(told))


def _outside(
    known: Centres, system: FrameSystem, extent: tuple[float, float, float, float] | None, beyond: float
) -> set[str]:
    """The plots whose positions lie farther outside of the map's `extent` than `beyond`, metres. Raises if all do."""
    if extent is None or not known.places:
        return set()
    (e0, n0), (west, south, east, north) = system.origin, extent
    outside = {
        name
        for name, (e, n) in known.places.items()
        if not (west - beyond <= e - e0 <= east + beyond and south - beyond <= n - n0 <= north + beyond)
    }
    if len(outside) < len(known.places):
        return outside
    unit = system.metres_per_unit
    e, n = next(iter(known.places.values()))
    low, high = ((west + e0) / unit, (south + n0) / unit), ((east + e0) / unit, (north + n0) / unit)
    raise StemMapError(
        known.path,
        f"no position lies in the map: one is at {e / unit:.0f}, {n / unit:.0f}, and the map reaches from "
        f"{low[0]:.0f}, {low[1]:.0f} to {high[0]:.0f}, {high[1]:.0f} in {system.name or 'metres'}: name the system of "
        "the positions with --positions-crs, and check that x is east and y north",
    )


def _named(names: set[str]) -> str:
    return ", ".join(sorted(names)[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")
