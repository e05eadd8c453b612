"""Results as tables: a row for each plot, for each tree, and for each pair of trees."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.coregistration.outputs.attention import Attention
from server.coregistration.results import PlotResult, PlotTree, in_unit
from server.outputs.formulas import guarded

Cell = str | int | float | None


@dataclass(frozen=True, slots=True)
class Table:
    """A table: names of its columns, and its rows."""

    columns: tuple[str, ...]
    rows: list[tuple[Cell, ...]]

    def write_csv(self, path: Path) -> None:
        """Write the table as CSV, UTF-8, with empty cells where nothing is known. A reader never sees half of it.

        Text that a spreadsheet would run as a formula has an apostrophe before it.
        """
        beside = path.with_name(f"{path.name}.part")
        with beside.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(self.columns)
            writer.writerows([guarded(one) if isinstance(one, str) else one for one in row] for row in self.rows)
        beside.replace(path)


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def _point(x: float | None, y: float | None, crs: str | None) -> tuple[float | None, float | None]:
    """A point, metres, in the unit of its system, to the third digit; nothing if it is not known."""
    if x is None or y is None:
        return None, None
    x, y = in_unit((x, y), crs)
    return round(x, 3), round(y, 3)


def _map_crs(result: PlotResult) -> str | None:
    return None if result.pose is None else result.pose.crs


def _pose_cells(result: PlotResult) -> tuple[Cell, ...]:
    pose = result.pose
    if pose is None:
        return (None,) * 10
    return (
        pose.frame_id,
        pose.crs,
        *_point(pose.e, pose.n, pose.crs),
        _rounded(pose.shift_e, 3),
        _rounded(pose.shift_n, 3),
        _rounded(pose.turn_cw, 4),
        _rounded(pose.sigma_e, 4),
        _rounded(pose.sigma_n, 4),
        _rounded(pose.sigma_turn, 4),
    )


PLOT_COLUMNS: Final = (
    *("plot", "verdict", "reason", "map", "crs", "E", "N", "dE", "dN", "turn_cw_deg"),
    *("sigma_E", "sigma_N", "sigma_turn_deg", "trees", "inliers", "share", "rms", "scale", "confidence", "searched"),
    *("places", "rival", "rival_E", "rival_N", "rival_turn_cw_deg", "look_at", "sentence", "x", "y", "file"),
)
"""Columns of the plots' table. Lengths in metres, but E, N, x and y in the unit of their system.

E and N are the plot's centre in the map, x and y that in its own coordinates.
"""


def plots_table(results: Sequence[PlotResult], attention: Sequence[Attention]) -> Table:
    """A row for each plot."""
    why = {id(one.result): " | ".join(one.why) for one in attention}
    rows: list[tuple[Cell, ...]] = []
    for one in results:
        rival = one.places[1] if len(one.places) > 1 else None
        x, y = one.centre or (None, None)
        rows.append(
            (
                *(one.name, one.outcome, one.reason, *_pose_cells(one), len(one.trees)),
                *(one.inliers if one.pose else None, _rounded(one.share, 3), _rounded(one.rms, 3)),
                *(_rounded(one.scale, 5), _rounded(one.confidence, 6), one.searched, len(one.places) or None),
                *(
                    (None,) * 4
                    if rival is None
                    else (rival.submap_id, *_point(rival.e, rival.n, rival.crs), round(rival.turn_cw, 3))
                ),
                *(why.get(id(one), ""), one.sentence, *_point(x, y, one.system), one.file),
            )
        )
    return Table(PLOT_COLUMNS, rows)


TREE_COLUMNS: Final = ("plot", "tag", "E", "N", "x", "y", "dbh_cm", "partner", "partner_dbh_cm", "residual")
"""Columns of the trees' table: E and N are corrected, x and y as surveyed, in the unit of their system, else metres."""


def trees_table(results: Sequence[PlotResult], *, placed: Callable[[PlotTree], bool] = lambda tree: True) -> Table:
    """A row for each tree of the plots that is `placed`."""
    rows: list[tuple[Cell, ...]] = [
        (
            *(one.name, tree.id, *_point(tree.e, tree.n, _map_crs(one)), *_point(tree.x, tree.y, one.system)),
            *(tree.dbh_cm, tree.partner, tree.partner_dbh_cm, _rounded(tree.residual, 3)),
        )
        for one in results
        for tree in one.trees
        if placed(tree)
    ]
    return Table(TREE_COLUMNS, rows)


PAIR_COLUMNS: Final = ("plot", "seen", "tag", "partner", "E", "N", "dbh_cm", "partner_dbh_cm", "residual")
"""Columns of the pairs' table; `seen` is both, plot (only there: ingrowth) or map (only there: felled, or missed)."""


def pairs_table(results: Sequence[PlotResult]) -> Table:
    """The trees of each placed plot with their partners, then those that only one side has."""
    rows: list[tuple[Cell, ...]] = []
    for one in results:
        if one.pose is None:
            continue
        for tree in one.trees:
            seen = "both" if tree.partner is not None else "plot"
            rows.append(
                (
                    *(one.name, seen, tree.id, tree.partner, *_point(tree.e, tree.n, one.pose.crs)),
                    *(tree.dbh_cm, tree.partner_dbh_cm, _rounded(tree.residual, 3)),
                )
            )
        rows += [
            (one.name, "map", None, tree.id, *_point(tree.e, tree.n, one.pose.crs), None, tree.dbh_cm, None)
            for tree in one.map_trees
            if tree.inside and not tree.paired
        ]
    return Table(PAIR_COLUMNS, rows)
