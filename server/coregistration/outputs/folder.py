"""All files of a season's results, written into one folder."""

import json
import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from server.collections.frame_systems import metres_per_unit_of
from server.coregistration.outputs.attention import Attention, needs_attention
from server.coregistration.outputs.layers import MISSING, can_write_layers, write_layers
from server.coregistration.outputs.picture import draw_plot
from server.coregistration.outputs.report import ReportHead, write_report
from server.coregistration.outputs.tables import pairs_table, plots_table, trees_table
from server.coregistration.results import PlotPose, PlotResult, in_unit

REPORT: Final = "report.html"
_UNFIT: Final = re.compile(r"[^\w.-]+")


def write_folder(
    folder: Path,
    collection: str,
    results: Sequence[PlotResult],
    told: Sequence[str],
    *,
    writing: Callable[[str], object] = lambda name: None,
) -> list[Attention]:
    """Write tables, layers, transforms, pictures and the report; the plots that need eyes, the most urgent first.

    Args:
        folder: an existing folder, whose files of an earlier run are replaced.
        collection: its id.
        results: of all plots.
        told: what was read as what, a line for each file.
        writing: called with the name of each part before it is written.

    Raises:
        OSError: a file cannot be written.
    """
    attention = needs_attention(results)
    writing("tables")
    plots, pairs = plots_table(results, attention), pairs_table(results)
    plots.write_csv(folder / "plots.csv")
    trees_table(results).write_csv(folder / "trees.csv")
    pairs.write_csv(folder / "pairs.csv")
    notes = [] if can_write_layers() else [MISSING]
    if not notes:
        placed = trees_table(results, placed=lambda tree: tree.e is not None)
        of_tree = [one.pose for one in results for tree in one.trees if tree.e is not None]
        write_layers(folder / "plots.gpkg", "plots", plots, [one.pose for one in results])
        write_layers(folder / "trees.gpkg", "trees", placed, of_tree)
    _write_transforms(folder, results)
    writing("pictures")
    pictures = _write_pictures(folder / "pictures", collection, results)
    writing("report")
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    write_report(folder / REPORT, ReportHead(collection, made, told, notes), results, attention, pictures)
    return attention


def file_names(results: Sequence[PlotResult]) -> dict[str, str]:
    """By the names of plots, names for their files, no two of which differ only in case."""
    names: dict[str, str] = {}
    taken: set[str] = set()
    for one in results:
        plain = _UNFIT.sub("_", one.name).strip("._") or "plot"
        name, number = plain, 2
        while name.lower() in taken:
            name, number = f"{plain}_{number}", number + 1
        taken.add(name.lower())
        names[one.name] = name
    return names


def _write_transforms(folder: Path, results: Sequence[PlotResult]) -> None:
    """The 4x4 matrices: all in one JSON file, and one text file for each plot, as CloudCompare reads them."""
    inside = folder / "transforms"
    inside.mkdir(exist_ok=True)
    for old in inside.glob("*.txt"):
        old.unlink()
    names = file_names(results)
    transforms = {}
    for one in results:
        pose = one.pose
        if pose is None:
            continue
        matrix = _in_units(pose, one.system)
        centre = None if one.centre is None else in_unit(one.centre, one.system)
        transforms[one.name] = {
            "matrix": matrix,
            "from": {"file": one.file, "crs": one.system},
            "to": {"map": pose.frame_id, "crs": pose.crs},
            "centre": {"from": centre, "to": pose.in_system, "turn_cw_deg": pose.turn_cw},
        }
        rows = (" ".join(f"{value:.17g}" for value in row) for row in matrix)
        (inside / f"{names[one.name]}.txt").write_text("".join(f"{row}\n" for row in rows), encoding="utf-8")
    text = json.dumps({"transforms": transforms}, indent=1, ensure_ascii=False)
    (folder / "transforms.json").write_text(f"{text}\n", encoding="utf-8")


def _in_units(pose: PlotPose, system: str | None) -> list[list[float]]:
    """The matrix (4, 4) from the unit of the plot's `system` to that of the map's; heights stay."""
    of_plot, of_map = metres_per_unit_of(system), metres_per_unit_of(pose.crs)
    rows = [list(row) for row in pose.matrix]
    for row in rows[:2]:
        row[:] = [row[0] * of_plot / of_map, row[1] * of_plot / of_map, row[2], row[3] / of_map]
    return rows


def _write_pictures(folder: Path, collection: str, results: Sequence[PlotResult]) -> dict[str, str]:
    """A picture for each plot that was read; they by the plots' names."""
    folder.mkdir(exist_ok=True)
    for old in folder.glob("*.svg"):
        old.unlink()
    names, pictures = file_names(results), {}
    for one in results:
        if one.trees:
            pictures[one.name] = draw_plot(one, collection)
            (folder / f"{names[one.name]}.svg").write_text(pictures[one.name], encoding="utf-8")
    return pictures
