"""`urquhart locate` gives poses as surveyors do: shift and turn amid the trees, with axes, units and directions."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer

from tests.server.commands.cli_helpers import Urquhart, write_observation
from tests.server.factories import forest
from urquhart import SE2

TURN, SHIFT = math.radians(-1.49), np.array([-4.2, 2.71])


@pytest.mark.parametrize(
    ("system", "corner", "unit", "position", "shift"),
    [
        (None, (0.0, 0.0), 1.0, r"x (?P<x>-?\d+\.\d{3}), y (?P<y>-?\d+\.\d{3}) m", "x -4.200 m, y +2.710 m"),
        ("EPSG:25832", (448_100.0, 5_411_000.0), 1.0,
         r"east (?P<x>\d+\.\d{3}), north (?P<y>\d+\.\d{3}) m \(EPSG:25832\)", "east -4.200 m, north +2.710 m"),
        ("EPSG:2225", (1_830_000.0, 610_000.0), 1200 / 3937,
         r"east (?P<x>\d+\.\d{3}), north (?P<y>\d+\.\d{3}) US survey foot \(EPSG:2225\)",
         "east -4.200 m, north +2.710 m (-13.779, +8.891 US survey foot)"),
    ],
)  # fmt: skip
def test_a_pose_is_a_shift_and_a_turn_amid_the_trees(
    urquhart: Urquhart,
    tmp_path: Path,
    system: str | None,
    corner: tuple[float, float],
    unit: float,
    position: str,
    shift: str,
) -> None:
    trees = forest(1) + corner
    middle = trees.mean(axis=0)
    seen = SE2(0.0, 0.0, -TURN).apply(trees - middle) + middle - SHIFT
    named = [] if system is None else ["--crs", system]
    for name, xy in (("als", trees), ("plot", seen)):
        write_observation(tmp_path / f"{name}.csv", xy / unit)
        text = (tmp_path / f"{name}.csv").read_text()
        (tmp_path / f"{name}.csv").write_text(text.replace("x_m,y_m", "x,y"))
    stored = urquhart("index", "als.csv", "--collection", "c", "--one-submap", *named)
    assert stored.code == 0, stored.err
    found = urquhart("locate", "plot.csv", "--collection", "c", *named)
    where = re.search(rf"middle of the trees: -?\d+\.\d{{3}}, -?\d+\.\d{{3}} m in the file is {position}", found.out)
    assert where is not None, found.out
    np.testing.assert_allclose([float(where["x"]), float(where["y"])], middle / unit, atol=0.002)
    assert f"shift there: {shift}; turn 1.490 deg clockwise (one sigma 0.0" in found.out


def test_shift_and_turn_between_two_systems_are_told_after_the_conversion(urquhart: Urquhart, tmp_path: Path) -> None:
    """Zones 32 and 33 have norths that differ by 4.5 degrees here, which is no turn of the plot."""
    trees = forest(1) + (650_000.0, 5_411_000.0)
    seen = np.column_stack(Transformer.from_crs(25832, 25833, always_xy=True).transform(*(trees + (1.5, -0.5)).T))
    for name, xy in (("als", trees), ("plot", seen)):
        write_observation(tmp_path / f"{name}.csv", xy)
    stored = urquhart("index", "als.csv", "--collection", "c", "--one-submap", "--crs", "EPSG:25832")
    assert stored.code == 0, stored.err
    said = urquhart("locate", "plot.csv", "--collection", "c", "--crs", "EPSG:25833").out
    (told,) = (line for line in said.splitlines() if line.startswith("converted from EPSG:25833 to EPSG:25832: "))
    assert "shift -1.50 m east, +0.50 m north, turn 0.00 deg" in told
    assert "turn 4.4" in said or "turn 4.5" in said
    same = urquhart("locate", "als.csv", "--collection", "c", "--crs", "EPSG:25832").out
    assert "converted" not in same
