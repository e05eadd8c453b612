"""What a file of trees holds, in figures and in a picture, before anything is stored."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.reading.plausibility import neighbour_tree, spread, stems_per_hectare
from server.stem_maps.reading.trees import TreeRows
from server.stem_maps.tiling import MERGE_DISTANCE
from urquhart.report.svg import MOST, Canvas

_LONE: Final = 5.0
"""Times the 95 % quantile of spacing: a tree further than this from its neighbour is no part of the stand."""
_NEAR: Final = 0.3
"""Metres. Trees of a stand are hardly closer, but records of one tree are."""
_SHOWN: Final = 5
_STYLE: Final = ".lone{fill:none;stroke:#b8321f;stroke-width:2}"


@dataclass(frozen=True, slots=True, eq=False)
class FileSurvey:
    """The figures of one file.

    Attributes:
        trees: what was read.
        xy: (N, 2) float64, metres; plots with frames of their own are laid side by side.
        nearest: (N,) float64, metres from each tree to its nearest neighbour; infinite for a single tree.
        lone: positions in `trees` of those that stand far from all others.
        twins: trees within a centimetre of another one, which are merged when stored.
        near: trees within 0.3 m of another one.
    """

    trees: TreeRows
    xy: NDArray[np.float64]
    nearest: NDArray[np.float64]
    lone: NDArray[np.int64]
    twins: int
    near: int

    def lines(self) -> list[tuple[str, str]]:
        """A name and a sentence for each figure."""
        trees, count = self.trees, len(self.trees)
        bad = len({row.line for row in trees.bad_rows})
        found = [("trees", f"{count}{f', and {bad} rows that cannot be used' if bad else ''}")]
        if not count:
            return found
        if trees.plots is not None:
            origin = ", each with its own origin" if trees.own_frames else ""
            found.append(("plots", f"{len(set(trees.plots))}{origin}"))
        low, high = trees.xy.min(axis=0), trees.xy.max(axis=0)
        wide, tall = high - low
        found.append(("box", f"x {low[0]:.2f} to {high[0]:.2f} m, y {low[1]:.2f} to {high[1]:.2f} m: "
                             f"{wide:.1f} x {tall:.1f} m"))  # fmt: skip
        density = stems_per_hectare(neighbour_tree(trees))
        if density is not None:
            found.append(("density", f"{density:.0f} trees on a hectare, by the distances between neighbours"))
        if count > 1:
            low5, middle, high95 = np.quantile(self.nearest, (0.05, 0.5, 0.95))
            found.append(("spacing", f"median {middle:.2f} m to the nearest tree, 5 % below {low5:.2f} m, 5 % above "
                                     f"{high95:.2f} m"))  # fmt: skip
        found += self._measured()
        found.append(("duplicates", f"{self.twins} trees within 1 cm of another one, {self.near} within 0.3 m"))
        found.append(("outliers", self._outliers()))
        found.append(("system", trees.crs or "not known: name it with --crs"))
        return found

    def _measured(self) -> list[tuple[str, str]]:
        found = []
        for name, unit, values in (("dbh", "cm", self.trees.dbh_cm), ("height", "m", self.trees.height_m)):
            if values is not None:
                known = values[np.isfinite(values)]
                span = f"known of {len(known)} of {len(values)} trees"
                if len(known):
                    span += f", median {np.median(known):.1f} {unit}, {known.min():.1f} to {known.max():.1f} {unit}"
                found.append((name, span))
        return found

    def _outliers(self) -> str:
        if not len(self.lone):
            return "none"
        named = [
            f"{self.trees.ids[tree]!r} ({self.trees.path.name}:{self.trees.lines[tree]})" for tree in self.lone[:_SHOWN]
        ]
        more = f" and {len(self.lone) - _SHOWN} more" if len(self.lone) > _SHOWN else ""
        return f"{len(self.lone)} trees stand far from all others: {', '.join(named)}{more}"

    def draw(self) -> str:
        """The trees as SVG, by their diameters; outliers have a circle. At most 5,000 trees are drawn."""
        trees, xy = self.trees, self.xy
        shown = np.arange(len(xy))[:: max(1, -(-len(xy) // MOST))]
        told = f"{len(trees)} trees" if len(shown) == len(xy) else f"{len(shown)} of {len(trees)} trees"
        canvas = Canvas(xy, trees.path.name, told)
        for tree in np.union1d(shown, self.lone).tolist():
            dbh = float("nan") if trees.dbh_cm is None else float(trees.dbh_cm[tree])
            size = 3.0 if np.isnan(dbh) else float(np.clip(dbh / 10.0, 1.5, 8.0))
            label = trees.ids[tree] if np.isnan(dbh) else f"{trees.ids[tree]}: {dbh:.1f} cm"
            canvas.circle(xy[tree], size, "tree", label)
        for tree in self.lone.tolist():
            canvas.circle(xy[tree], 12.0, "lone", trees.ids[tree])
        return canvas.render(_STYLE)


def survey(trees: TreeRows) -> FileSurvey:
    """The figures of trees that were read."""
    xy = spread(trees)
    nearest = np.full(len(xy), np.inf)
    if len(xy) > 1:
        distances, _ = neighbour_tree(trees).query(xy, 2)
        nearest = np.asarray(distances, dtype=np.float64)[:, 1]
    usual = float(np.quantile(nearest, 0.95)) if len(xy) > 1 else np.inf
    return FileSurvey(
        trees=trees,
        xy=xy,
        nearest=nearest,
        lone=np.flatnonzero(nearest > _LONE * usual),
        twins=int((nearest <= MERGE_DISTANCE).sum()),
        near=int((nearest <= _NEAR).sum()),
    )
