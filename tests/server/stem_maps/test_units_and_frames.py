"""Units and frames of one file that differ, or are named in unusual places: converted, or refused, and never mixed."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl  # type: ignore[import-untyped]
import pytest
from pyproj import Transformer

from server.stem_maps.reader import StemMapError, read_centres, read_stem_map
from server.stem_maps.reading.options import ReadOptions

RNG = np.random.default_rng(5)
OFFSETS = RNG.uniform(-14.0, 14.0, (40, 2)).round(2)
AZIMUTH = np.degrees(np.arctan2(OFFSETS[:, 0], OFFSETS[:, 1])) % 360.0
DISTANCE = np.hypot(*OFFSETS.T)
CENTRE = (10.5, 48.1)
IN_DEGREES = {"crs": "EPSG:4326", "project": "EPSG:25832"}


def written(path: Path, names: str, *columns: Any) -> Path:
    """A CSV file with a column of numbers for each name."""
    lines = [",".join(f"{value!r}" if isinstance(value, str) else f"{value:.9g}" for value in row)
             for row in zip(*(np.broadcast_to(column, 40).tolist() for column in columns), strict=True)]  # fmt: skip
    path.write_text("\n".join([names, *lines]) + "\n", encoding="utf-8")
    return path


def test_centres_in_degrees_are_projected_before_offsets_are_added(tmp_path: Path) -> None:
    expected = np.array(Transformer.from_crs(4326, 25832, always_xy=True).transform(*CENTRE)) + OFFSETS
    path = written(tmp_path / "p.csv", "lon,lat,azimuth_deg,distance", *CENTRE, AZIMUTH, DISTANCE)
    for names in ({"centre_x": "lon", "centre_y": "lat"}, {"x": "lon", "y": "lat"}):
        polar = {"azimuth": "azimuth_deg", "distance": "distance"}
        stem_map = read_stem_map(path, ReadOptions(**polar, **names, **IN_DEGREES))  # type: ignore[arg-type]
        np.testing.assert_allclose(stem_map.xy, expected, atol=0.001)


def test_centres_of_a_file_in_degrees_are_projected(tmp_path: Path) -> None:
    centres = tmp_path / "centres.csv"
    centres.write_text(f"plot,lon,lat\n1,{CENTRE[0]},{CENTRE[1]}\n", encoding="utf-8")
    path = written(tmp_path / "p.csv", "plot,azimuth_deg,distance", 1, AZIMUTH, DISTANCE)
    options = ReadOptions(azimuth="azimuth_deg", distance="distance", plot="plot", centres=centres, **IN_DEGREES)  # type: ignore[arg-type]
    with pytest.raises(StemMapError, match="x_m or x is missing"):
        read_stem_map(path, options)
    centres.write_text(f"plot,x,y\n1,{CENTRE[0]},{CENTRE[1]}\n", encoding="utf-8")
    expected = np.array(Transformer.from_crs(4326, 25832, always_xy=True).transform(*CENTRE)) + OFFSETS
    np.testing.assert_allclose(read_stem_map(path, options).xy, expected, atol=0.001)


@pytest.mark.parametrize("name", ["lx", "lx_ft"])
def test_quadrats_are_in_the_unit_of_their_lengths(tmp_path: Path, name: str) -> None:
    local = RNG.uniform(0.0, 65.617, (40, 2)).round(2)
    names = f"quadrat,{name},{name.replace('x', 'y')}"
    path = written(tmp_path / "q.csv", names, 102, *local.T)
    unit = ReadOptions(unit="ft" if name == "lx" else None)
    with pytest.raises(StemMapError, match="in ft with --quadrat-size"):
        read_stem_map(path, unit)
    stem_map = read_stem_map(path, ReadOptions(unit=unit.unit, quadrat_size=65.617))
    np.testing.assert_allclose(stem_map.xy, (local + [0.0, 65.617]) * 0.3048, atol=1e-6)


def test_units_of_slopes_and_centres_in_the_header_count(tmp_path: Path) -> None:
    names = "cx_ft,cy_ft,azimuth_deg,distance,slope_percent"
    path = written(tmp_path / "s.csv", names, 100.0, 200.0, AZIMUTH, DISTANCE, 40.0)
    options = ReadOptions(
        azimuth="azimuth_deg", distance="distance", slope="slope_percent", centre_x="cx_ft", centre_y="cy_ft"
    )
    expected = np.array([100.0, 200.0]) * 0.3048 + OFFSETS * np.cos(np.arctan(0.4))
    np.testing.assert_allclose(read_stem_map(path, options).xy, expected, atol=0.001)


def test_angles_without_a_unit_are_told(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "azimuth,distance", AZIMUTH, DISTANCE)
    assert "'azimuth', which names no unit, and distances" in read_stem_map(path).understood


def test_diameters_beside_feet_name_their_unit(tmp_path: Path) -> None:
    path = written(tmp_path / "d.csv", "x_ft,y_ft,dbh", *(OFFSETS.T * 3.28), np.linspace(8.0, 20.0, 40))
    with pytest.raises(StemMapError, match="positions are in ft, and 'dbh' names no unit: name it with --dbh-unit"):
        read_stem_map(path)
    dbh_cm = read_stem_map(path, ReadOptions(dbh_unit="in")).dbh_cm
    assert dbh_cm is not None
    np.testing.assert_allclose(dbh_cm, np.linspace(8.0, 20.0, 40) * 2.54, atol=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        "x\ty\n" + "".join(f"{x + 20}\t{y + 20}\t30.5\n" for x, y in OFFSETS),
        "id\tx\ty\tdbh_cm\n" + "".join(f"t{n}\t{x}\t{y}\t30.5\t\n" for n, (x, y) in enumerate(OFFSETS)),
    ],
)
def test_a_field_more_than_the_header_shifts_no_column(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.tsv"
    path.write_text(text, encoding="utf-8")
    if text.startswith("id"):
        np.testing.assert_array_equal(read_stem_map(path).xy, OFFSETS)
    else:
        with pytest.raises(StemMapError, match="3 fields where the header has 2"):
            read_stem_map(path)


def test_a_text_among_the_numbers_of_a_workbook_says_nothing_of_the_others(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(["x", "y"])
    for x, y in (1000.0 + OFFSETS).tolist():
        sheet.append([x, y])
    sheet["A7"] = "1,004"
    book.save(tmp_path / "w.xlsx")
    stem_map = read_stem_map(tmp_path / "w.xlsx")
    assert stem_map.xy[5, 0] == 1004.0
    assert "thousands grouped" in stem_map.understood


@pytest.mark.parametrize("code", [0.0, -9999.0])
def test_positions_that_mean_none_are_refused(tmp_path: Path, code: float) -> None:
    xy = OFFSETS + 20.0
    xy[[3, 8, 21]] = code
    path = written(tmp_path / "z.csv", "x_m,y_m", *xy.T)
    with pytest.raises(StemMapError, match=f"3 trees stand at {code:g}, {code:g}, as if they had no position"):
        read_stem_map(path)


def test_a_pipe_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(StemMapError, match="no regular file"):
        read_stem_map(tmp_path / "pipe.csv")


def test_centres_that_name_their_system_are_in_its_unit(tmp_path: Path) -> None:
    path = tmp_path / "centres.csv"
    path.write_text("plot,x,y,crs\nA,2000000.0,700000.0,EPSG:2264\nB,2000100.0,700000.0,EPSG:2264\n")
    centres = read_centres(path, ReadOptions()).places
    foot = 1200.0 / 3937.0
    assert centres["A"] == pytest.approx((2_000_000.0 * foot, 700_000.0 * foot), abs=1e-3)
    assert centres["B"][0] - centres["A"][0] == pytest.approx(100.0 * foot, abs=1e-6)


@pytest.mark.parametrize("rows", [["A,8.123456,48.123456", "B,8.223456,48.323456"], ["A,8.123456,48.123456"]])
def test_centres_in_degrees_that_nobody_named_are_refused(tmp_path: Path, rows: list[str]) -> None:
    path = tmp_path / "centres.csv"
    path.write_text("\n".join(["plot,x,y", *rows]) + "\n")
    with pytest.raises(StemMapError, match="seem to be in degrees"):
        read_centres(path, ReadOptions())
    assert len(read_centres(path, ReadOptions(unit="m")).places) == len(rows)
    local = tmp_path / "local.csv"
    local.write_text("plot,x,y\nA,10.5,20.25\nB,40.5,20.25\n")
    assert read_centres(local, ReadOptions()).places["B"] == (40.5, 20.25)


def test_trees_have_the_system_of_the_centres_that_they_were_measured_from(tmp_path: Path) -> None:
    centres, path = tmp_path / "centres.csv", tmp_path / "polar.csv"
    path.write_text("".join(["plot,azimuth,distance\n", *(f"A,{30 * i},{4 + i}\n" for i in range(6))]))
    polar = ReadOptions(centres=centres, azimuth="azimuth", distance="distance", angle="deg")
    centres.write_text("plot,x,y,crs\nA,448000,5411000,EPSG:25832\n")
    there = read_stem_map(path, polar)
    assert (there.crs, there.xy[0].tolist()) == ("EPSG:25832", [448000.0, 5411004.0])
    centres.write_text("plot,x,y,crs\nA,8.29,48.85,EPSG:4326\n")
    with pytest.raises(StemMapError, match="gives degrees"):
        read_stem_map(path, polar)
    converted = read_stem_map(path, replace(polar, project="EPSG:25832"))
    assert converted.crs == "EPSG:25832"
    assert np.allclose(converted.xy[0], [447900.8, 5411102.5], atol=200.0)
    assert np.hypot(*(converted.xy[3] - converted.xy[0])) == pytest.approx(np.hypot(4.0, 7.0), abs=1e-6)


def feet_of(path: Path, name: str, corner: float) -> Path:
    """Positions in columns whose header names a unit, `corner` units east of the origin."""
    return written(path, f"x_{name},y_{name}", OFFSETS[:, 0] / 0.3048 + corner, OFFSETS[:, 1] / 0.3048 + 0.35 * corner)


def test_feet_of_a_header_are_those_of_the_system(tmp_path: Path) -> None:
    path = feet_of(tmp_path / "f.csv", "ft", 2_000_000.0)
    known = read_stem_map(path, ReadOptions(crs="EPSG:2264"))
    named = read_stem_map(path, ReadOptions(unit=None, crs=None))
    # 2 in a million: 1.2 m here.
    np.testing.assert_allclose((known.xy - named.xy).mean(axis=0), [1.219, 0.427], atol=0.001)
    assert (known.assumed, "US survey feet" in known.understood) == ((), False)
    with pytest.raises(StemMapError, match="positions are said to be in ft"):
        read_stem_map(path, ReadOptions(unit="ft", crs="EPSG:2264"))


@pytest.mark.parametrize(
    ("name", "corner", "unit", "assumed"),
    [
        ("ft", 2_000_000.0, None, ("unit",)),
        ("ft", 2_000_000.0, "ft", ()),
        ("ft", 0.0, None, ()),
        ("us_ft", 2_000_000.0, None, ()),
    ],
)
def test_feet_that_may_be_of_two_kinds_are_told_where_it_matters(
    tmp_path: Path, name: str, corner: float, unit: Any, assumed: tuple[str, ...]
) -> None:
    read = read_stem_map(feet_of(tmp_path / "f.csv", name, corner), ReadOptions(unit=unit))
    assert read.assumed == assumed
    assert ("US survey feet, they are off by 1.22 m, so say --unit us-ft" in read.understood) is bool(assumed)
