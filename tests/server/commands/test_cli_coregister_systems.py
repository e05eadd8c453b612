"""`urquhart coregister` in maps whose system is in feet, and with positions in a system of their own."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from server.stem_maps.reader import read_stem_map
from tests.server.commands.cli_helpers import LONGLEAF, Said, Urquhart
from tests.server.commands.test_cli_coregister import CENTRES, MOVED, seen_from, table

FOOT = 1200 / 3937
CORNER = np.array([2000000.0, 700000.0])
"""Of longleaf in EPSG:2264, US survey feet."""


def feet(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of longleaf (N, 2), metres, as coordinates of EPSG:2264."""
    return np.asarray(xy / FOOT + CORNER, dtype=np.float64)


def plots_in_feet(path: Path, names: tuple[str, ...] = tuple(CENTRES)) -> Path:
    rows = ["plot,tag,x,y"]
    for plot in names:
        ids, xy = seen_from(CENTRES[plot])
        rows += [f"{plot},{tag},{x:.3f},{y:.3f}" for tag, (x, y) in zip(ids, feet(xy).tolist(), strict=True)]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def place(urquhart: Urquhart, tmp_path: Path) -> Urquhart:
    """Runs `urquhart coregister` in longleaf, stored in EPSG:2264, into the folder `out`."""
    trees = read_stem_map(LONGLEAF)
    rows = [f"{tag},{x:.3f},{y:.3f}" for tag, (x, y) in zip(trees.ids, feet(trees.xy).tolist(), strict=True)]
    (tmp_path / "map.csv").write_text("\n".join(["tag,x,y", *rows]) + "\n", encoding="utf-8")
    known = ("--collection", "ft", "--crs", "EPSG:2264")
    said = urquhart("index", "map.csv", *known, "--radius", 40, "--spacing", 40, "--processes", 1)
    assert said.code == 0, said.err

    def call(*plots: object, crs: tuple[str, ...] = ("--crs", "EPSG:2264")) -> Said:
        return urquhart("coregister", *plots, "--collection", "ft", *crs, "--out", "out", "--effort", "fast")

    return call


def test_results_in_a_system_of_feet_are_in_feet(place: Urquhart, tmp_path: Path) -> None:
    said = place(plots_in_feet(tmp_path / "plots.csv"))
    assert said.code == 0, said.err
    out = tmp_path / "out"
    plots = {row["plot"]: row for row in table(out / "plots.csv")}
    read = {(row["plot"], row["tag"]): row for row in table(tmp_path / "plots.csv")}
    known = json.loads((out / "transforms.json").read_text("utf-8"))["transforms"]
    for name, centre in CENTRES.items():
        row = plots[name]
        assert (row["verdict"], row["crs"]) == ("matched", "EPSG:2264")
        own = np.array([[float(row["x"]), float(row["y"])]])
        at = feet(MOVED.inverse().apply((own - CORNER) * FOOT - centre) + centre)[0]
        np.testing.assert_allclose([float(row["E"]), float(row["N"])], at, atol=0.3)
        assert float(row["dE"]) == pytest.approx((float(row["E"]) - float(row["x"])) * FOOT, abs=0.002)  # metres
        assert known[name]["centre"]["to"] == pytest.approx([float(row["E"]), float(row["N"])], abs=0.001)
        matrix = np.loadtxt(out / "transforms" / f"{name}.txt")
        np.testing.assert_allclose(matrix, known[name]["matrix"])
        trees = [tree for tree in table(out / "trees.csv") if tree["plot"] == name]
        original = np.array([[float(tree["x"]), float(tree["y"]), 0.0, 1.0] for tree in trees])
        as_read = [[float(read[name, tree["tag"]][axis]) for axis in "xy"] for tree in trees]
        np.testing.assert_allclose(original[:, :2], as_read, atol=0.0011)
        corrected = np.array([[float(tree["E"]), float(tree["N"])] for tree in trees])
        np.testing.assert_allclose((original @ matrix.T)[:, :2], corrected, atol=0.005)
    pairs = {(row["plot"], row["tag"]): row["E"] for row in table(out / "pairs.csv") if row["seen"] == "both"}
    import pyogrio.raw  # type: ignore[import-untyped]

    for layer in ("plots", "trees"):
        meta, _, geometry, values = pyogrio.raw.read(out / f"{layer}.gpkg", layer=layer)
        columns = dict(zip(meta["fields"].tolist(), values, strict=True))
        assert meta["crs"] == "EPSG:2264"
        points = np.array([np.frombuffer(shape[5:21], "<f8") for shape in geometry])
        np.testing.assert_allclose(points, np.column_stack([columns["E"], columns["N"]]))
        assert points[:, 0].min() > CORNER[0]
    again = read_stem_map(out / "trees.gpkg")
    assert again.crs == "EPSG:2264"
    assert len(again) >= len(pairs) >= 40
    assert min(map(float, pairs.values())) > CORNER[0]
