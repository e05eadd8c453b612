"""Units that a file does not name, and that are others than was taken: `urquhart coregister` and `urquhart locate`."""

from pathlib import Path

import numpy as np
import pytest

from server.stem_maps.reader import read_stem_map
from server.stem_maps.reading.options import ReadOptions
from tests.server.commands.cli_helpers import LONGLEAF, Said, Urquhart
from tests.server.commands.test_cli_coregister import table
from tests.server.commands.test_cli_trees import map_file, mapped, plot_file

__all__ = ["map_file", "mapped", "plot_file"]
FULL = {"deg": 360.0, "gon": 400.0}


def polar(path: Path, unit: str, column: str = "azimuth") -> Path:
    """Trees of longleaf around a point, as azimuths of that unit, all below 360, and distances."""
    xy = read_stem_map(LONGLEAF).xy - (100.0, 100.0)
    xy = np.random.default_rng(5).normal(xy[np.hypot(*xy.T) < 20.0], 0.03)
    azimuth = np.arctan2(xy[:, 0], xy[:, 1]) / (2 * np.pi) % 1.0 * FULL[unit]
    rows = zip(azimuth.tolist(), np.hypot(*xy.T).tolist(), strict=True)
    lines = [f"{tag},{a:.2f},{d:.3f}" for tag, (a, d) in enumerate(rows) if a < 359.0]
    path.write_text("\n".join([f"tag,{column},distance_m", *lines]) + "\n")
    return path


@pytest.fixture
def place(urquhart: Urquhart, indexed: Path, tmp_path: Path) -> Urquhart:
    def call(command: str, *words: object) -> Said:
        out = ("--out", tmp_path / "out") if command == "coregister" else ()
        return urquhart(command, *words, "--collection", "stand", "--database", indexed, *out)

    return call


def test_azimuths_without_a_unit_are_tried_in_gon(place: Urquhart, tmp_path: Path) -> None:
    path = polar(tmp_path / "p.csv", "gon")
    count = len(path.read_text().splitlines()) - 1
    assert place("coregister", path).code == 0
    (row,) = table(tmp_path / "out" / "plots.csv")
    assert row["verdict"] in ("ambiguous", "no_match")
    assert (row["reason"], row["E"], row["trees"]) == ("angle_unit", "", str(count))
    assert f"fit better in gon ({count} of {count} trees instead of " in row["look_at"]
    assert "say --angle gon, or --angle deg" in row["sentence"]
    said = place("locate", path)
    assert said.code == 0, said.err
    assert "(angle_unit)" in said.out and "matched (" not in said.out
    assert f"fit better in gon ({count} of {count} trees" in said.out
    as_json = place("locate", path, "--json")
    assert '"reason": "angle_unit"' in as_json.out and "fit better in gon" in as_json.err


def test_azimuths_in_the_unit_that_they_are_read_in_match(place: Urquhart, tmp_path: Path) -> None:
    known = place("coregister", polar(tmp_path / "p.csv", "gon"), "--angle", "gon")
    assert known.code == 0, known.err
    (row,) = table(tmp_path / "out" / "plots.csv")
    assert (row["verdict"], row["look_at"]) == ("matched", "")
    path = polar(tmp_path / "p.csv", "deg")
    for column in ("azimuth", "azimuth_deg"):
        place("coregister", polar(path, "deg", column))
        (row,) = table(tmp_path / "out" / "plots.csv")
        assert (row["verdict"], row["look_at"]) == ("matched", "")
    assert place("locate", path).out.startswith("matched")


def test_a_stem_map_is_read_again_in_gon(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text("tag,azimuth,distance,cx,cy\na,300,10,5,7\nb,0,4,5,7\nc,120,6,5,7\nbad,x,1,5,7\n")
    known = {"centre_x": "cx", "centre_y": "cy", "declination": 3.0, "skip_bad": True}
    read = read_stem_map(path, ReadOptions(**known))  # type: ignore[arg-type]
    in_gon = read.in_gon()
    named = read_stem_map(path, ReadOptions(angle="gon", **known))  # type: ignore[arg-type]
    assert in_gon is not None and named.in_gon() is None
    np.testing.assert_allclose(in_gon.xy, named.xy, atol=1e-9)
    assert in_gon.in_gon() is None


def test_diameters_in_another_unit_are_told(urquhart: Urquhart, mapped: Path, plot_file: Path, tmp_path: Path) -> None:
    head, *rows = plot_file.read_text().splitlines()
    inches = [f"{row.rpartition(',')[0]},{float(row.rpartition(',')[2]) / 2.54:.2f}" for row in rows]
    plot_file.write_text("\n".join([head.replace("dbh_cm", "dbh"), *inches]) + "\n")
    where = ("--collection", "forest", "--database", mapped)
    asked = "differ by the factor 2.54, the plot's are smaller: are they in inches? (--dbh-unit in)"
    for unit, told in (((), True), (("--dbh-unit", "in"), False)):
        assert urquhart("coregister", plot_file, *where, "--out", tmp_path / "out", *unit).code == 0
        (row,) = table(tmp_path / "out" / "plots.csv")
        assert row["verdict"] == "matched" and (asked in row["look_at"]) == told
        assert (asked in urquhart("locate", plot_file, *where, *unit).out) == told


def test_rows_that_are_left_out_are_counted_by_plot(
    urquhart: Urquhart, mapped: Path, plot_file: Path, tmp_path: Path
) -> None:
    head, *rows = plot_file.read_text().splitlines()
    lines = [f"A,{row}" for row in rows[:-3]] + [f"A,{row.split(',')[0]},none,1,9" for row in rows[-3:]]
    lines += [f"B,{tag},,{tag},12" for tag in range(4)]
    path = tmp_path / "season.csv"
    path.write_text("\n".join([f"plot,{head}", *lines]) + "\n")
    where = ("--collection", "forest", "--database", mapped, "--out", tmp_path / "out", "--skip-bad")
    assert urquhart("coregister", path, *where).code == 2  # B is not read
    plots = {row["plot"]: row for row in table(tmp_path / "out" / "plots.csv")}
    assert plots["A"]["verdict"] == "matched"
    assert "3 rows of this plot could not be read and are left out" in plots["A"]["look_at"]
    assert plots["B"]["verdict"] == "not_read"
    assert "none of the 4 rows of the plot 'B' can be read" in plots["B"]["look_at"]
