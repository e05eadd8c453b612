"""`urquhart coregister` with positions and plots that are in another system than the map."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pyproj import Transformer

from server.stem_maps.reader import read_stem_map
from tests.server.commands.cli_helpers import LONGLEAF, Said, Urquhart, refused
from tests.server.commands.test_cli_coregister import CENTRES, MOVED, seen_from, table

CORNER = np.array([700000.0, 5411000.0])
"""Of longleaf in EPSG:25832, metres."""
NEAR = ("--at-sigma", 3, "--heading-sigma", 3)


def converted(xy: NDArray[np.float64], crs: str) -> NDArray[np.float64]:
    """Points (N, 2) of longleaf, metres, in another system, x east and y north."""
    here = (xy + CORNER).T
    return np.column_stack(Transformer.from_crs("EPSG:25832", crs, always_xy=True).transform(*here))


def gnss(path: Path, crs: str, names: tuple[str, ...] = tuple(CENTRES), column: str = "") -> Path:
    """A table of where the plots are, 1.8 m off, with a column `crs` if it is given."""
    truth = np.array([CENTRES[name] for name in names]) + (MOVED.inverse().x + 1.5, MOVED.inverse().y - 1.0)
    rows = [f"{name},{x!r},{y!r},{column}" for name, (x, y) in zip(names, converted(truth, crs).tolist(), strict=True)]
    path.write_text("\n".join(["plot,x,y,crs", *rows]) + "\n")
    return path


@pytest.fixture
def place(urquhart: Urquhart, tmp_path: Path) -> Urquhart:
    """Runs `urquhart coregister` in longleaf, stored in EPSG:25832, into the folder `out`."""
    trees = read_stem_map(LONGLEAF)
    rows = [f"{tag},{x:.3f},{y:.3f}" for tag, (x, y) in zip(trees.ids, (trees.xy + CORNER).tolist(), strict=True)]
    (tmp_path / "map.csv").write_text("\n".join(["tag,x,y", *rows]) + "\n", encoding="utf-8")
    known = ("--collection", "utm", "--crs", "EPSG:25832", "--radius", 40, "--spacing", 40, "--processes", 1)
    assert urquhart("index", "map.csv", *known).code == 0

    def call(*words: object) -> Said:
        return urquhart("coregister", *words, "--collection", "utm", "--out", "out", "--effort", "fast")

    return call


@pytest.fixture
def local(tmp_path: Path) -> Path:
    """A folder of plots, each about a point 0, 0 of its own."""
    folder = tmp_path / "plots"
    folder.mkdir()
    for name, centre in CENTRES.items():
        ids, xy = seen_from(centre)
        text = "".join(f"{tag},{x:.3f},{y:.3f}\n" for tag, (x, y) in zip(ids, (xy - centre).tolist(), strict=True))
        (folder / f"{name}.csv").write_text(f"tag,x,y\n{text}")
    return folder


def test_positions_of_another_system_are_converted(place: Urquhart, local: Path, tmp_path: Path) -> None:
    for crs, words in (("EPSG:4326", ()), ("EPSG:4326", ("--positions-crs", "EPSG:4326")), ("EPSG:25833", ())):
        path = gnss(tmp_path / "gnss.csv", crs, column="" if words else crs)
        said = place(local, "--positions", path, *NEAR, *words)
        assert said.code == 0, said.err
        assert "gnss.csv: 3 positions in EPSG:25832" in said.err
        for row in table(tmp_path / "out" / "plots.csv"):
            assert (row["verdict"], row["searched"]) == ("matched", "near")
            assert (float(row["dE"]), float(row["dN"])) == pytest.approx((-1.5, 1.0), abs=0.5)


def test_positions_that_cannot_be_in_the_map_are_refused(place: Urquhart, local: Path, tmp_path: Path) -> None:
    path = gnss(tmp_path / "gnss.csv", "EPSG:4326")
    refused(place(local, "--positions", path, *NEAR), "degrees")
    refused(place(local, "--positions", gnss(path, "EPSG:25833"), *NEAR), "--positions-crs")
    refused(place(local, "--positions-crs", "EPSG:25833"), "needs --positions")
    gnss(path, "EPSG:25832")
    path.write_text(path.read_text().replace("P1,700", "P1,720"))
    said = place(local, "--positions", path, *NEAR)
    assert "gnss.csv: 1 positions lie outside of the map: P1" in said.err


def test_plots_of_another_system_are_converted_too(place: Urquhart, tmp_path: Path) -> None:
    rows = ["plot,tag,x,y"]
    for plot, centre in CENTRES.items():
        ids, xy = seen_from(centre)
        there = converted(xy, "EPSG:25833").tolist()
        rows += [f"{plot},{tag},{x:.3f},{y:.3f}" for tag, (x, y) in zip(ids, there, strict=True)]
    path = tmp_path / "season.csv"
    path.write_text("\n".join(rows) + "\n")
    for near in ((), ("--at-sigma", 5, "--heading-sigma", 3)):
        said = place(path, "--crs", "EPSG:25833", *near)
        assert said.code == 0, said.err
        for row in table(tmp_path / "out" / "plots.csv"):
            assert (row["verdict"], row["searched"]) == ("matched", "near" if near else "everywhere")
            own = converted(np.array([CENTRES[row["plot"]]]), "EPSG:25833")[0]
            assert np.hypot(float(row["x"]) - own[0], float(row["y"]) - own[1]) < 10.0
            shift = (MOVED.inverse().x, MOVED.inverse().y)
            assert (float(row["dE"]), float(row["dN"])) == pytest.approx(shift, abs=0.6)
            assert float(row["turn_cw_deg"]) == pytest.approx(np.degrees(MOVED.yaw), abs=0.3)  # grids differ by 4 deg
    said = place(path)  # as if they were in the map's system
    assert said.out.count("look at P") == 3
    assert "km from its own coordinates: check them, and the system" in said.out
