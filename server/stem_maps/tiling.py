"""A stem map cut into overlapping discs, the submaps of a stand."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from server.stem_maps.reader import StemMap
from urquhart.features.landmark_checks import thin

MERGE_DISTANCE: Final = 0.01
"""Metres. Trees closer than this are one tree recorded twice, or two that no sensor can separate."""
MINIMUM_TREES: Final = 10
"""A disc with fewer trees cannot be recognised."""
MAXIMUM_DISCS: Final = 1_000_000


class CuttingError(ValueError):
    """A radius or spacing that does not fit the stem map. The message is one line that says what to change."""


@dataclass(frozen=True, slots=True, eq=False)
class Disc:
    """The trees of a stem map within a radius of `centre`, in a frame with its origin at `centre` and the map's axes.

    Attributes:
        submap_id: `<map>-<column>-<row>`, numbers padded with zeros.
        centre: metres, map frame; with yaw 0 the pose of the disc in the map.
        tree_indices: (N,) int64, positions in the stem map.
        xy: (N, 2) float64, metres, disc frame.
        frame_id: the frame of `centre`, if it is not that of the map: the plot's own.
    """

    submap_id: str
    centre: tuple[float, float]
    tree_indices: NDArray[np.int64]
    xy: NDArray[np.float64]
    frame_id: str | None = None


@dataclass(frozen=True, slots=True)
class Cut:
    """A stem map cut into discs, and the trees that are in none.

    Attributes:
        radius, spacing: metres, as given.
        trees: trees in the file.
        merged: trees left out because another is within `MERGE_DISTANCE`; the thickest stays, or the first.
        uncovered: trees, of those that stay, that are in no disc.
        columns, rows: size of the grid of centres.
        skipped: grid points without a disc, because fewer than the minimum of trees are there.
        discs: the discs, by column, then by row.
        plots: plots that became submaps; 0 for a map that was not cut by its plots.
        small_plots: plots that have too few trees.
    """

    radius: float
    spacing: float
    trees: int
    merged: int
    uncovered: int
    columns: int
    rows: int
    skipped: int
    discs: tuple[Disc, ...]
    plots: int = 0
    small_plots: tuple[str, ...] = ()


def cut(
    stem_map: StemMap, radius: float, spacing: float, *, minimum_trees: int = MINIMUM_TREES, maximum_trees: int = 20_000
) -> Cut:
    """Cut `stem_map` into discs of `radius` metres, centred on a square grid `spacing` metres apart.

    The grid is centred on the map's extent and no centre lies outside it. With `radius >= spacing / sqrt(2)` every tree
    is within reach of at least one grid point.

    Raises:
        CuttingError: radius or spacing is not a positive number, the grid has more than `MAXIMUM_DISCS` points, a disc
            holds more than `maximum_trees`, or none holds `minimum_trees`, perhaps because the map has fewer.
    """
    check_sizes(radius, spacing)
    kept = merge(stem_map.xy, diameters=stem_map.dbh_cm)
    xy = stem_map.xy[kept]
    xs, ys = (_centres(xy[:, axis], spacing) for axis in (0, 1))
    if len(xs) * len(ys) > MAXIMUM_DISCS:
        width, height = np.ptp(xy, axis=0)
        raise CuttingError(
            f"a spacing of {spacing:g} m over {width:.0f} x {height:.0f} m makes {len(xs) * len(ys)} submaps, more "
            f"than {MAXIMUM_DISCS}: make the spacing larger, or look for a tree far outside the stand"
        )
    discs: list[Disc] = []
    covered = np.zeros(len(xy), dtype=bool)
    for column, row, centre, members in _members(xy, xs, ys, radius):
        if len(members) < minimum_trees:
            continue
        if len(members) > maximum_trees:
            raise CuttingError(
                f"{len(members)} trees within {radius:g} m, more than {maximum_trees}: make the radius smaller"
            )
        covered[members] = True
        digits = [len(str(count - 1)) for count in (len(xs), len(ys))]
        discs.append(
            Disc(
                submap_id=f"{stem_map.name}-{column:0{digits[0]}d}-{row:0{digits[1]}d}",
                centre=(float(centre[0]), float(centre[1])),
                tree_indices=kept[members],
                xy=xy[members] - centre,
            )
        )
    if not discs and len(kept) < minimum_trees:
        raise too_few(stem_map, len(kept), minimum_trees)
    if not discs:
        raise CuttingError(f"no circle of {radius:g} m contains {minimum_trees} trees: make the radius larger")
    return Cut(
        radius=radius,
        spacing=spacing,
        trees=len(stem_map),
        merged=len(stem_map) - len(kept),
        uncovered=int((~covered).sum()),
        columns=len(xs),
        rows=len(ys),
        skipped=len(xs) * len(ys) - len(discs),
        discs=tuple(discs),
    )


def left_out(stand: Cut) -> list[str]:
    """What became of the trees and grid points that are in no submap, a phrase for each kind."""
    parts = [
        f"{stand.skipped} grid points skipped (fewer than {MINIMUM_TREES} trees)",
        merged_phrase(stand.merged),
    ]
    if stand.plots:
        parts.append(f"{stand.plots} plots, each a place of its own")
    if stand.small_plots:
        few = len(stand.small_plots)
        parts.append(f"{few} plots left out with fewer than {MINIMUM_TREES} trees, the first {stand.small_plots[0]!r}")
    if stand.uncovered:
        parts.append(f"{stand.uncovered} trees in no submap")
    return parts


def merged_phrase(count: int) -> str:
    """How many trees were left out because a thicker one is within `MERGE_DISTANCE`."""
    return f"{count} trees merged with a thicker neighbour within 1 cm"


def check_sizes(radius: float, spacing: float) -> None:
    """Raise CuttingError unless both are positive numbers of metres."""
    for name, value in (("radius", radius), ("spacing", spacing)):
        if not (np.isfinite(value) and value > 0):
            raise CuttingError(f"the {name} must be a positive number of metres, not {value:g}")


def too_few(stem_map: StemMap, count: int, minimum_trees: int = MINIMUM_TREES) -> CuttingError:
    """The error of a stem map of which only `count` trees are left, fewer than a submap needs."""
    merged = f" ({len(stem_map)} before stems within 1 cm were merged)" if count < len(stem_map) else ""
    return CuttingError(f"the stem map has {count} trees{merged}, and a submap needs at least {minimum_trees}")


def merge(
    xy: NDArray[np.float64], distance: float = MERGE_DISTANCE, diameters: NDArray[np.float64] | None = None
) -> NDArray[np.int64]:
    """Thin `xy` (N, 2), metres: each tree is removed if a thicker one is within `distance` metres.

    `diameters` (N,) float64 are in any unit, NaN where unknown. Of equally thick trees, and without diameters of all,
    the earlier one stays. Returns the positions of those that stay, (K,) int64, ascending.
    """
    thickness = np.zeros(len(xy)) if diameters is None else np.nan_to_num(diameters)
    order = np.argsort(-thickness, kind="stable")
    return np.sort(order[np.flatnonzero(thin(xy[order], distance) < 0)])


def without_twins(stem_map: StemMap) -> StemMap:
    """The map without trees within `MERGE_DISTANCE` of a thicker one, which are stems of one tree."""
    kept = merge(stem_map.xy, diameters=stem_map.dbh_cm) if len(stem_map) else np.zeros(0, dtype=np.int64)
    if len(kept) == len(stem_map):
        return stem_map
    return stem_map.chosen(kept)


def _centres(coordinates: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    low, extent = coordinates.min(), np.ptp(coordinates)
    count = int(extent // spacing) + 1
    if count > MAXIMUM_DISCS:  # not even the numbers, which may not fit in memory
        return np.broadcast_to(np.float64(low), (count,))
    margin = (extent - (count - 1) * spacing) / 2
    return np.asarray(low + margin + spacing * np.arange(count), dtype=np.float64)


def _members(
    xy: NDArray[np.float64], xs: NDArray[np.float64], ys: NDArray[np.float64], radius: float
) -> Iterator[tuple[int, int, NDArray[np.float64], NDArray[np.int64]]]:
    tree = cKDTree(xy)
    for column, x in enumerate(xs):
        centres = np.column_stack([np.full(len(ys), x), ys])
        for row, members in enumerate(tree.query_ball_point(centres, radius, return_sorted=True)):
            yield column, row, centres[row], np.asarray(members, dtype=np.int64)
