"""Stem maps and observations read from files: checked row by row, never mended.

What a column means is what the caller says (`ReadOptions`), or what its well-known name says; docs/files.md lists both.
Rows with the same id at the same place are stems of one tree: the thickest stays. `StemMap.understood` tells in one
line what was read, what was not used, and what was passed over.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.formats.files import FilePart, file_digest, read_table
from server.stem_maps.formats.table import StemMapError, refusal
from server.stem_maps.reading.centres import Centres, check_not_degrees
from server.stem_maps.reading.columns import find_columns, is_header_of
from server.stem_maps.reading.options import ReadOptions, with_columns_file
from server.stem_maps.reading.plausibility import check_plausible
from server.stem_maps.reading.rows import read_rows
from server.stem_maps.reading.system_column import SYSTEM_COLUMN, take_system_column
from server.stem_maps.reading.trees import TreeRows

__all__ = ["StemMap", "StemMapError", "read_stem_map"]

DEFAULTS: Final = ReadOptions()


@dataclass(frozen=True, slots=True, eq=False)
class StemMap:
    """The trees of one file, in its order.

    Attributes:
        name: the file's name without its suffix; the map's `frame_id`.
        ids: N unique tree ids.
        xy: (N, 2) float64, metres, in the file's frame, or in that of each plot.
        dbh_cm: (N,) float64, centimetres, NaN where the file has none; None without the column.
        height_m: (N,) float64, metres, NaN where the file has none; None without the column.
        species: N names, empty where the file has none; None without the column.
        plots: the name of each tree's plot, if each plot is to be a submap of its own; else None.
        own_frames: whether each plot has a frame of its own, because their coordinates overlap.
        centres: (N, 2) float64, metres, frame of `xy`: where each tree was measured from, or None.
        assumed_azimuths: (N,) float64, degrees clockwise from north: azimuths that `xy` were computed from, if they
            were taken for degrees because nobody named their unit; else None.
        crs: the coordinate reference system of `xy`, as a code or a name; None if it is not known.
        source_hash: digest of the file's bytes; empty for a map that came from no file.
        understood: one line: what was read as what, what is not used, and what was passed over.
        assumed: the options that would say what was assumed because nobody named it, such as `angle`.
        further_stems: rows of the file left out because a thicker stem of the same tree is there.
        skipped: rows of the file left out because they cannot be used.
    """

    name: str
    ids: tuple[str, ...]
    xy: NDArray[np.float64]
    dbh_cm: NDArray[np.float64] | None = None
    height_m: NDArray[np.float64] | None = None
    species: tuple[str, ...] | None = None
    plots: tuple[str, ...] | None = None
    own_frames: bool = False
    centres: NDArray[np.float64] | None = None
    assumed_azimuths: NDArray[np.float64] | None = None
    crs: str | None = None
    source_hash: str = ""
    understood: str = ""
    assumed: tuple[str, ...] = ()
    further_stems: int = 0
    skipped: int = 0

    def __len__(self) -> int:
        return len(self.ids)

    def chosen(self, trees: Sequence[int] | NDArray[np.int64]) -> "StemMap":
        """The map with only the trees at these positions."""
        rows = np.asarray(trees, dtype=np.int64)
        return replace(
            self,
            ids=tuple(self.ids[tree] for tree in rows),
            xy=self.xy[rows],
            dbh_cm=None if self.dbh_cm is None else self.dbh_cm[rows],
            height_m=None if self.height_m is None else self.height_m[rows],
            species=None if self.species is None else tuple(self.species[tree] for tree in rows),
            plots=None if self.plots is None else tuple(self.plots[tree] for tree in rows),
            centres=None if self.centres is None else self.centres[rows],
            assumed_azimuths=None if self.assumed_azimuths is None else self.assumed_azimuths[rows],
        )

    def in_gon(self) -> "StemMap | None":
        """The map with its azimuths read in gon; None if they are known to be degrees, or positions are not polar."""
        if self.assumed_azimuths is None or self.centres is None or not len(self):
            return None
        # 1 gon is 0.9 degrees, so each tree turns back, counter-clockwise, by a tenth of its azimuth.
        turn, (x, y) = np.radians(0.1 * self.assumed_azimuths), (self.xy - self.centres).T
        c, s = np.cos(turn), np.sin(turn)
        turned = np.column_stack([c * x - s * y, s * x + c * y])
        return replace(self, xy=self.centres + turned, assumed_azimuths=None)


def read_stem_map(path: Path, options: ReadOptions = DEFAULTS, *, allow_empty: bool = False) -> StemMap:
    """Read the file `path`.

    With `allow_empty`, a file with a header and no trees is valid: an observation may contain nothing. What `options`
    do not say, a `columns.toml` beside the file may.

    Raises:
        StemMapError: naming the file, and the line where there is one; its `bad_rows` are all that cannot be used.
    """
    rows = read_trees(path, options)
    check_plausible(rows)  # first, because a wrong unit is what makes many rows bad
    if rows.bad_rows and not rows.options.skip_bad:
        raise refusal(path, rows.bad_rows)
    if not len(rows) and not allow_empty:
        raise StemMapError(path, "the file has a header but no trees")
    return stem_map_of(rows)


def read_trees(path: Path, options: ReadOptions) -> TreeRows:
    """The trees of a file, with what is known of them, before their plausibility is checked.

    Raises:
        StemMapError: the file as a whole cannot be understood. Rows at fault are in `bad_rows`.
    """
    options = with_columns_file(path, options)
    table = read_table(path, FilePart(options.layer, options.id, is_header_of(options)))
    if SYSTEM_COLUMN not in (name.strip().lower() for name in options.ignore):
        take_system_column(table)
    columns = find_columns(table, options)
    centres = None if options.centres is None else read_centres(options.centres, options)
    return read_rows(table, columns, options, centres)


def read_centres(path: Path, options: ReadOptions, assumed: str | None = None) -> Centres:
    """The positions of plots in a file with the columns plot, x and y.

    Their unit and system are in `options`, or the file names its system as those of trees do. `assumed` is their system
    if neither does.

    Raises:
        StemMapError: the file cannot be used, its positions seem to be in degrees, or a plot has two.
    """
    table = read_table(path, FilePart(None, None, is_header_of(ReadOptions())))
    take_system_column(table)
    crs = options.crs or (assumed if table.crs is None else None)
    is_known, weak = crs is not None or table.crs is not None, options.from_file
    wanted = ReadOptions(
        unit=None if is_known and "unit" in weak else options.unit,
        crs=crs,
        project=None if not is_known and "project" in weak else options.project,
    )
    columns = find_columns(table, wanted)
    if "plot" not in columns.positions and "id" in columns.positions:
        columns.positions["plot"] = columns.positions["id"]
    if "plot" not in columns.positions:
        raise StemMapError(path, "the centres need a column plot, beside x and y", table.header_line)
    names = table.texts(columns.positions["plot"])
    columns.positions = {key: columns.positions[key] for key in ("x", "y") if key in columns.positions}
    rows = read_rows(table, columns, wanted, None)
    if rows.bad_rows:
        raise refusal(path, rows.bad_rows)
    if not rows.positions.unit_named:
        check_not_degrees(path, rows.xy)
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise StemMapError(path, f"the plot {twice!r} has two centres: keep one")
    return Centres(path, dict(zip(names, map(tuple, rows.xy.tolist()), strict=True)), rows.crs)


def stem_map_of(rows: TreeRows) -> StemMap:
    """The stem map of trees that were read."""
    return StemMap(
        name=rows.path.stem,
        ids=tuple(rows.ids),
        xy=rows.xy,
        dbh_cm=rows.dbh_cm,
        height_m=rows.height_m,
        species=None if rows.species is None else tuple(rows.species),
        plots=tuple(rows.plots) if rows.plots is not None and rows.by_plot else None,
        own_frames=rows.own_frames,
        centres=rows.centres,
        assumed_azimuths=rows.assumed_azimuths,
        crs=rows.crs,
        source_hash=file_digest(rows.path),
        understood=rows.told(),
        assumed=rows.assumed,
        further_stems=rows.further_stems,
        skipped=rows.skipped,
    )
