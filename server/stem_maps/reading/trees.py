"""The trees of a file as they were read, with what was understood of it; rows of one tree joined."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from server.stem_maps.formats.table import BadRow
from server.stem_maps.reading.columns import Columns
from server.stem_maps.reading.options import COLUMNS_FILE, ReadOptions
from server.stem_maps.reading.positions import Positions

SAME_PLACE: Final = 0.01
"""Metres. Stems of one tree that are closer than this have one position."""


@dataclass(slots=True, eq=False)
class TreeRows:
    """The trees of a file, and what was understood of it.

    Attributes:
        path: the file.
        columns: the meaning of its columns.
        options: what the caller said.
        lines: (N,) int64, where each tree is in the file.
        ids: N unique ids.
        xy: (N, 2) float64, metres.
        positions: where `xy` come from, and their system.
        dbh_cm, height_m: (N,) float64, centimetres and metres, NaN where unknown; None without the column.
        species: N names; None without the column.
        plots: the name of each tree's plot; None without the column.
        by_plot: whether each plot is to be a submap of its own.
        own_frames: whether each plot has coordinates of its own.
        notes: what else is told.
        bad_rows: rows that cannot be used.
        centres: (N, 2) float64, metres, the centre that each tree was measured from; None if there is none.
        assumed_azimuths: (N,) float64, degrees, azimuths that were taken for degrees because nobody named their unit.
        plot_of_line: the plots of `bad_rows`, as far as they are known, by line.
        ids_have_plots: whether the plot's name was put before each id, because ids repeat between plots.
        neighbours: a tree for the search of neighbours, built once and kept; see `plausibility.neighbour_tree`.
        further_stems: rows left out because a thicker stem of the same tree is there.
        skipped: rows left out because they cannot be used.
        whole: whether all positions were written without decimals, in text whose columns commas separate.
    """

    path: Path
    columns: Columns
    options: ReadOptions
    lines: NDArray[np.int64]
    ids: list[str]
    xy: NDArray[np.float64]
    positions: Positions
    dbh_cm: NDArray[np.float64] | None = None
    height_m: NDArray[np.float64] | None = None
    species: list[str] | None = None
    plots: list[str] | None = None
    by_plot: bool = False
    own_frames: bool = False
    unused: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)
    bad_rows: list[BadRow] = field(default_factory=list)
    centres: NDArray[np.float64] | None = None
    assumed_azimuths: NDArray[np.float64] | None = None
    plot_of_line: dict[int, str] = field(default_factory=dict)
    ids_have_plots: bool = False
    neighbours: cKDTree | None = field(default=None, repr=False)
    further_stems: int = 0
    skipped: int = 0
    whole: bool = False

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def crs(self) -> str | None:
        """The system of `xy`; None if it is not known."""
        return self.positions.crs

    @property
    def assumed(self) -> tuple[str, ...]:
        """The options that say what was assumed, because nobody named it: units of angles, feet, diameters, heights."""
        units = self.columns.units
        return (
            *(("unit",) if self.positions.assumed_feet else ()),
            *(("angle",) if self.assumed_azimuths is not None else ()),
            *(("dbh_unit",) if self.dbh_cm is not None and "dbh" not in units else ()),
            *(("height_unit",) if self.height_m is not None and "height" not in units else ()),
        )

    def told(self) -> str:
        """What was understood, in one line."""
        names, units = self.columns.names, self.columns.units
        read = [f"tree_id from {names['id']!r}"] if "id" in names else []
        read.append(self.positions.told)
        if self.dbh_cm is not None:
            family = f", as {self.columns.family} writes them" if self.columns.family_unit else ""
            guessed = "" if "dbh" in units else ", which names no unit"
            what = "radii" if names["dbh"].lower() == "radius" else "diameters"
            read.append(f"{what} in {units.get('dbh', 'cm')} from {names['dbh']!r}{family}{guessed}")
        if self.height_m is not None:
            guessed = "" if "height" in units else ", which names no unit"
            read.append(f"heights in {units.get('height', 'm')} from {names['height']!r}{guessed}")
        if self.species is not None:
            read.append(f"species from {names['species']!r}")
        unused = f"; not used: {', '.join(map(repr, self.unused))}" if self.unused else ""
        source = f"{COLUMNS_FILE} says {', '.join(self.options.from_file)}; " if self.options.from_file else ""
        return "; ".join([f"{source}read {', '.join(read)}{unused}", *self.notes])


def join_stems(trees: TreeRows) -> None:
    """Drop rows at fault, and make rows with one id at one place the thickest stem of one tree."""
    bad = {row.line for row in trees.bad_rows}
    first: dict[tuple[str, str], int] = {}
    kept: dict[int, int] = {}  # the first row of a tree, and the row of its thickest stem
    for row, (line, tree_id) in enumerate(zip(trees.lines.tolist(), trees.ids, strict=True)):
        if line in bad:
            continue
        known = first.setdefault((trees.plots[row] if trees.plots else "", tree_id), row)
        if known == row:
            kept[row] = row
            continue
        apart = float(np.hypot(*(trees.xy[row] - trees.xy[known])))
        if apart > SAME_PLACE:
            what = f"tree id {tree_id[:40]!r} is used before, on line {trees.lines[known]}, {apart:.3g} m away"
            trees.bad_rows.append(BadRow(line, "", what))
        elif trees.dbh_cm is not None and np.nan_to_num(trees.dbh_cm[row]) > np.nan_to_num(trees.dbh_cm[kept[known]]):
            kept[known] = row
        # Otherwise a thinner stem of a tree that is there.
    if trees.plots is not None:
        at_fault = {row.line for row in trees.bad_rows}
        of_rows = zip(trees.lines.tolist(), trees.plots, strict=True)
        trees.plot_of_line = {line: plot for line, plot in of_rows if line in at_fault}
    stems = len(trees.ids) - len(kept) - len({row.line for row in trees.bad_rows} & set(trees.lines.tolist()))
    trees.further_stems = stems
    if stems:
        trees.notes.append(f"{stems} rows are further stems of a tree: the thickest stays")
    _choose(trees, list(kept), list(kept.values()))
    if trees.options.skip_bad and trees.bad_rows:
        trees.skipped = len({row.line for row in trees.bad_rows})
        trees.notes.append(f"left out {trees.skipped} rows that cannot be used")
    if trees.plots is not None and len(set(trees.ids)) < len(trees.ids):
        trees.ids = [f"{plot}-{tree_id}" for plot, tree_id in zip(trees.plots, trees.ids, strict=True)]
        trees.ids_have_plots = True
        trees.notes.append(f"ids repeat between plots, so each begins with its {trees.columns.names['plot']!r}")


def _choose(trees: TreeRows, rows: list[int], thickest: list[int]) -> None:
    """Keep `rows`, with the numbers of the stems `thickest`."""
    stems = np.asarray(thickest, dtype=np.int64)
    trees.lines = trees.lines[np.asarray(rows, dtype=np.int64)]
    trees.ids = [trees.ids[row] for row in rows]
    trees.xy = trees.xy[stems]
    trees.centres = None if trees.centres is None else trees.centres[stems]
    trees.assumed_azimuths = None if trees.assumed_azimuths is None else trees.assumed_azimuths[stems]
    trees.dbh_cm = None if trees.dbh_cm is None else trees.dbh_cm[stems]
    trees.height_m = None if trees.height_m is None else trees.height_m[stems]
    trees.species = None if trees.species is None else [trees.species[row] for row in rows]
    trees.plots = None if trees.plots is None else [trees.plots[row] for row in rows]
