"""A season's plots, read from files that each hold one plot or many. A plot that cannot be read keeps no other back."""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from server.stem_maps.formats.files import CLOUD_SUFFIXES, TEXT_SUFFIXES, WORKBOOK_SUFFIXES
from server.stem_maps.formats.table import BadRow, StemMapError, refusal
from server.stem_maps.formats.vector_files import VECTOR_FORMATS
from server.stem_maps.reader import StemMap, read_trees, stem_map_of
from server.stem_maps.reading.options import ReadOptions, with_columns_file
from server.stem_maps.reading.plausibility import check_plausible
from server.stem_maps.reading.trees import TreeRows
from server.stem_maps.tiling import without_twins

SUFFIXES: Final = frozenset({*TEXT_SUFFIXES, *WORKBOOK_SUFFIXES, *CLOUD_SUFFIXES, *VECTOR_FORMATS})
"""Suffixes of the files that are read from a folder."""
_BESIDE: Final = frozenset({".shx", ".dbf", ".prj", ".cpg", ".sbn", ".sbx", ".qix", ".toml", ".lax"})
"""Suffixes of files that belong to others."""
_SHOWN: Final = 5
_SAME_CENTRE: Final = 0.01
"""Metres: the centres that a plot's trees were measured from may differ by this, by rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class SeasonPlot:
    """One plot of a season.

    Attributes:
        name: of the plot, unique in the season.
        path: its file.
        trees: its trees, stems within 1 cm merged, ids without the plot's name.
        centre: metres, frame of the trees: what they were measured from if they all were measured from one point, else
            the middle of the box around them.
        is_local: whether its coordinates are about a point of its own, so that they say nothing of where it is.
        measured: whether `centre` is what the trees were measured from.
        merged: trees that were merged with a thicker neighbour within 1 cm.
    """

    name: str
    path: Path
    trees: StemMap
    centre: tuple[float, float]
    is_local: bool
    measured: bool
    merged: int


@dataclass(frozen=True, slots=True)
class UnreadPlot:
    """A plot, or a file, that cannot be used, and why: one sentence."""

    name: str
    path: Path
    why: str


@dataclass(frozen=True, slots=True)
class Season:
    """All plots of some files, in their order; `told` says of each file what was read as what."""

    plots: tuple[SeasonPlot, ...]
    unread: tuple[UnreadPlot, ...]
    told: tuple[str, ...]

    def with_told(self, more: Iterable[str]) -> "Season":
        """The same season with more to tell."""
        return replace(self, told=(*self.told, *more))


@dataclass(frozen=True, slots=True)
class PlotFiles:
    """The files of a season, and sentences about what of its folders is not read."""

    paths: tuple[Path, ...]
    passed_over: tuple[str, ...]


def plot_files(paths: Iterable[Path], *, with_folders: bool = False) -> PlotFiles:
    """The files of a season: those named, and of a folder those whose suffixes a format has, by name.

    `with_folders` also reads the folders in a folder.

    Raises:
        StemMapError: a folder has no such file.
    """
    files: list[Path] = []
    told: list[str] = []
    waiting = deque(paths)
    while waiting:
        path = waiting.popleft()
        if not path.is_dir():
            files.append(path)
            continue
        inside = sorted(one for one in path.iterdir() if not one.name.startswith("."))
        trees = [one for one in inside if one.suffix.lower() in SUFFIXES and one.is_file()]
        below = [one for one in inside if one.is_dir()]
        waiting.extendleft(reversed(below) if with_folders else ())
        folders = [] if with_folders else [one.name for one in below]
        if not trees and with_folders and below:
            continue
        if not trees and folders:
            raise StemMapError(path, f"the folder has no file of trees, only folders: name them, such as {folders[0]}")
        if not trees:
            raise StemMapError(path, f"the folder has no file of trees: none ends in {', '.join(sorted(SUFFIXES))}")
        if folders:
            told.append(f"{path.name}: {len(folders)} folders in it are not read: {_few(folders)}; name them, too")
        others = [one.name for one in inside if one.is_file() and one not in trees and one.suffix not in _BESIDE]
        if others:
            told.append(f"{path.name}: {len(others)} files are of no format of trees and not read: {_few(others)}")
        files += trees
    return PlotFiles(tuple(files), tuple(told))


def _few(names: list[str]) -> str:
    return ", ".join(names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")


@dataclass(frozen=True, slots=True)
class FilePlots:
    """The plots of one file, those that cannot be used, and a line of what was read as what; nothing if it has none."""

    plots: tuple[SeasonPlot, ...]
    unread: tuple[UnreadPlot, ...]
    told: tuple[str, ...]


def read_season(
    files: Iterable[Path],
    options: ReadOptions,
    *,
    reading: Callable[[Path], AbstractContextManager[None]] = lambda path: nullcontext(),
) -> Season:
    """Read all plots of some files, each in the context that `reading` makes for it.

    A file with a column of plots is as many plots as that has names, any other file is one plot with the file's name.
    If a plot of one name is in several files, the file's name goes before it. `options.centres` and a `columns.toml`
    are used as for every file.
    """
    parts = []
    for path in files:
        with reading(path):
            parts.append(read_file(path, options))
    return season_of(parts)


def read_file(path: Path, options: ReadOptions) -> FilePlots:
    """The plots of one file; none of the file of their centres."""
    try:
        centres = with_columns_file(path, options).centres
        if centres is not None and centres.exists() and path.exists() and path.samefile(centres):
            return FilePlots((), (), ())
        rows = read_trees(path, replace(options, each_plot=True))
        check_plausible(rows)
    except StemMapError as error:
        return FilePlots((), (UnreadPlot(path.stem, path, str(error)),), ())
    bad = _plots_at_fault(rows)
    unread = tuple(UnreadPlot(name, path, why) for name, why in bad.items())
    return FilePlots(tuple(_plots_of(rows, leave_out=set(bad))), unread, (f"{path.name}: {rows.told()}",))


def season_of(parts: Sequence[FilePlots]) -> Season:
    """The season that files make, in their order."""
    plots = [plot for part in parts for plot in part.plots]
    unread = tuple(one for part in parts for one in part.unread)
    return Season(tuple(_named_apart(plots)), unread, tuple(line for part in parts for line in part.told))


def plot_of(path: Path, trees: StemMap) -> SeasonPlot:
    """A file that was read as one plot; its stems within 1 cm are merged already."""
    centre, measured = _centre(trees)
    return SeasonPlot(trees.name, path, trees, centre, measured and centre == (0.0, 0.0), measured, 0)


def _plots_at_fault(rows: TreeRows) -> dict[str, str]:
    """By the names of plots, why they cannot be used; rows of no plot go by the file's name."""
    if rows.options.skip_bad:
        there = set(rows.plots or (rows.path.stem,) * len(rows))
        return {
            name: f"{rows.path}: none of the {count} rows of the plot {name!r} can be read"
            for name, count in _skipped(rows).items()
            if name not in there
        }
    by_plot: dict[str, list[BadRow]] = {}
    for row in rows.bad_rows:
        by_plot.setdefault(rows.plot_of_line.get(row.line) or rows.path.stem, []).append(row)
    if not len(rows) and not by_plot:
        return {rows.path.stem: f"{rows.path}: the file has a header but no trees"}
    return {name: str(refusal(rows.path, found)) for name, found in by_plot.items()}


def _skipped(rows: TreeRows) -> dict[str, int]:
    """By the names of plots, how many of their rows are left out; rows of no plot count only in a file that is one."""
    if not rows.options.skip_bad:
        return {}
    lines = {row.line for row in rows.bad_rows}
    if rows.plots is None:
        return {rows.path.stem: len(lines)}
    return Counter(plot for line in lines if (plot := rows.plot_of_line.get(line)))


def _plots_of(rows: TreeRows, leave_out: set[str]) -> list[SeasonPlot]:
    """The plots of a file, in their order, without some."""
    whole, skipped = stem_map_of(rows), _skipped(rows)
    of_tree = np.asarray(rows.plots if rows.plots is not None else [rows.path.stem] * len(rows), dtype=object)
    plots: list[SeasonPlot] = []
    for name in dict.fromkeys(of_tree.tolist()):
        if name in leave_out:
            continue
        one = replace(whole.chosen(np.flatnonzero(of_tree == name)), name=name, plots=None)
        one = replace(one, skipped=skipped.get(name, 0))
        if rows.ids_have_plots:
            one = replace(one, ids=tuple(tree.removeprefix(f"{name}-") for tree in one.ids))
        trees = without_twins(one)
        centre, measured = _centre(trees)
        is_local = rows.own_frames or (measured and centre == (0.0, 0.0))
        plots.append(SeasonPlot(name, rows.path, trees, centre, is_local, measured, len(one) - len(trees)))
    return plots


def _centre(trees: StemMap) -> tuple[tuple[float, float], bool]:
    """The centre of a plot, metres, and whether its trees were measured from there."""
    centres = trees.centres
    if centres is not None and float(np.ptp(centres, axis=0).max()) <= _SAME_CENTRE:
        return (float(centres[0, 0]), float(centres[0, 1])), True
    middle = (trees.xy.min(axis=0) + trees.xy.max(axis=0)) / 2.0
    return (float(middle[0]), float(middle[1])), False


def _named_apart(plots: list[SeasonPlot]) -> list[SeasonPlot]:
    """The plots, with the name of the file before those names that several files have; or with that of the folder, if
    the files have one name."""
    files: dict[str, set[Path]] = {}
    for plot in plots:
        files.setdefault(plot.name, set()).add(plot.path)
    taken: set[str] = set()
    apart: list[SeasonPlot] = []
    for plot in plots:
        several = files[plot.name]
        stems, folders = {path.stem for path in several}, {path.parent.name for path in several}
        is_by_folder = len(stems) == 1 and len(folders) == len(several) and "" not in folders
        first = plot.path.parent.name if is_by_folder else plot.path.stem
        plain = f"{first}-{plot.name}" if len(several) > 1 else plot.name
        name, number = plain, 2
        while name in taken:
            name, number = f"{plain} ({number})", number + 1
        taken.add(name)
        apart.append(replace(plot, name=name))
    return apart
