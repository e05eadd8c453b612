"""Tables are written with ids, attributes, places and their system, and the readers get them back."""

import csv
import importlib
import json
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyproj import CRS

from server.errors import NotAcceptable
from server.outputs.files import FORMATS, write_table
from server.outputs.tables import LONGITUDE_LATITUDE, OutputColumn, OutputLayer, OutputRows, known_system
from server.stem_maps.reader import read_stem_map
from server.stem_maps.reading.options import ReadOptions

raw: Any = importlib.import_module("pyogrio.raw")
parquet: Any = importlib.import_module("pyarrow.parquet")

COLUMNS = (
    OutputColumn("id", "text"),
    OutputColumn("dbh_cm", "real"),
    OutputColumn("stems", "integer"),
    OutputColumn("alive", "boolean"),
    OutputColumn("seen", "time"),
    OutputColumn("note", "text"),
)
SUFFIXES = [one.suffix for one in FORMATS]
CORNER = np.array([448_000.0, 5_411_000.0])
GRID = np.array([[x, y] for x in range(0, 40, 5) for y in range(0, 30, 5)]) + np.sin(np.arange(96).reshape(48, 2))
NAMES = [f"Baum {i}" for i in range(48)]
DBH = np.round(np.random.default_rng(1).uniform(8.0, 70.0, 48), 1)


def rows(xy: Any = CORNER + GRID, names: Any = None) -> OutputRows:
    count = len(xy)
    return OutputRows(
        [
            NAMES[:count] if names is None else names,
            [*DBH[: count - 1].tolist(), None],
            list(range(count)),
            [True, False] * (count // 2),
            [datetime(2026, 5, 4, 9, 30, i, tzinfo=UTC) for i in range(count)],
            ['Höhe, "ungenau"', *[None] * (count - 1)],
        ],
        np.asarray(xy, dtype=np.float64),
    )


def layer(crs: str | None = "EPSG:25832", frame: str = "plot 7") -> OutputLayer:
    return OutputLayer("trees", COLUMNS, known_system(crs, frame))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_out_and_in_again(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"trees{suffix}"
    assert write_table(path, layer(), [rows()]) == 48
    options = ReadOptions(project="EPSG:25832") if suffix == ".geojson" else ReadOptions()
    read = read_stem_map(path, options)
    assert read.ids == tuple(NAMES)
    np.testing.assert_allclose(read.xy, CORNER + GRID, atol=2e-4)
    assert read.crs == "EPSG:25832"
    assert read.dbh_cm is not None
    np.testing.assert_array_equal(read.dbh_cm, [*DBH[:-1], np.nan])
    again = tmp_path / f"again{suffix}"
    write_table(again, layer(read.crs), [rows(read.xy, list(read.ids))])
    np.testing.assert_allclose(read_stem_map(again, options).xy, read.xy, atol=1e-4)


@pytest.mark.parametrize("suffix", [".gpkg", ".parquet"])
def test_a_local_frame_has_an_engineering_system_with_its_name(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"trees{suffix}"
    write_table(path, layer(None, 'plot "7"'), [rows(GRID)])
    read = read_stem_map(path)
    np.testing.assert_array_equal(read.xy, GRID)
    assert read.crs == 'plot "7" (local frame)'


def test_a_local_frame_as_csv_names_no_system(tmp_path: Path) -> None:
    path = tmp_path / "trees.csv"
    write_table(path, layer(None), [rows(GRID)])
    read = read_stem_map(path)
    np.testing.assert_allclose(read.xy, GRID, atol=1e-4)
    assert read.crs is None


def test_a_local_frame_has_no_geometry_in_geojson(tmp_path: Path) -> None:
    path = tmp_path / "trees.geojson"
    write_table(path, layer(None), [rows(GRID)])
    features = json.loads(path.read_bytes())["features"]
    assert [one["geometry"] for one in features] == [None] * 48
    assert "'plot 7' has no crs" in features[0]["properties"]["no_geometry"]


def test_feet_stay_feet(tmp_path: Path) -> None:
    feet = np.array([6_000_000.0, 2_000_000.0]) + GRID / 0.3048
    for suffix in SUFFIXES:
        path = tmp_path / f"trees{suffix}"
        write_table(path, layer("EPSG:2225"), [rows(feet)])
        options = ReadOptions(project="EPSG:2225") if suffix == ".geojson" else ReadOptions()
        np.testing.assert_allclose(read_stem_map(path, options).xy, feet * 1200 / 3937, atol=2e-4)


def test_values_of_every_kind_and_their_absence(tmp_path: Path) -> None:
    write_table(tmp_path / "a.csv", layer(), [rows()])
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        lines = list(csv.reader(file))
    assert lines[0] == ["id", "x", "y", "dbh_cm", "stems", "alive", "seen", "note", "crs"]
    assert lines[1][3:] == [str(DBH[0]), "0", "true", "2026-05-04T09:30:00Z", 'Höhe, "ungenau"', "EPSG:25832"]
    assert (lines[48][3], lines[48][7]) == ("", "")
    write_table(tmp_path / "a.geojson", layer(), [rows()])
    [first, *_, last] = json.loads((tmp_path / "a.geojson").read_bytes())["features"]
    assert first["properties"]["seen"] == "2026-05-04T09:30:00Z"
    assert (last["properties"]["dbh_cm"], last["properties"]["alive"]) == (None, False)
    write_table(tmp_path / "a.gpkg", layer(), [rows()])
    meta, _, _, values = raw.read(str(tmp_path / "a.gpkg"))
    found = dict(zip(meta["fields"], values, strict=True))
    assert [found["seen"].dtype.kind, found["alive"].dtype.kind, found["stems"].dtype.kind] == ["M", "b", "i"]
    assert str(found["seen"][0]).startswith("2026-05-04T09:30:00")
    assert np.isnan(found["dbh_cm"][-1])
    assert found["note"].tolist()[:2] == ['Höhe, "ungenau"', None]
    write_table(tmp_path / "a.parquet", layer(), [rows()])
    table = parquet.read_table(str(tmp_path / "a.parquet")).to_pylist()
    assert table[0]["seen"] == datetime(2026, 5, 4, 9, 30, tzinfo=UTC)
    assert (table[-1]["dbh_cm"], table[-1]["stems"], table[1]["note"]) == (None, 47, None)


def test_geoparquet_metadata(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    far = rows(CORNER + GRID + 1000.0)
    write_table(path, layer(), [rows(), far])
    geo = json.loads(parquet.read_metadata(str(path)).metadata[b"geo"])
    assert (geo["version"], geo["primary_column"]) == ("1.1.0", "geometry")
    column = geo["columns"]["geometry"]
    assert (column["encoding"], column["geometry_types"]) == ("WKB", ["Point"])
    assert CRS.from_json_dict(column["crs"]) == CRS("EPSG:25832")
    low, high = (CORNER + GRID).min(axis=0), (CORNER + GRID + 1000.0).max(axis=0)
    np.testing.assert_array_equal(column["bbox"], [*low, *high])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_table_without_rows_has_its_columns(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    assert write_table(path, layer(), []) == 0
    if suffix == ".geojson":
        assert json.loads(path.read_bytes())["features"] == []
    else:
        assert read_stem_map(path, allow_empty=True).ids == ()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_polygons_and_rows_without_a_place(tmp_path: Path, suffix: str) -> None:
    square = CORNER + np.array([[0.0, 0.0], [0.0, 10.0], [10.0, 10.0], [10.0, 0.0]])  # clockwise
    plots = OutputLayer("plots", COLUMNS[:1], known_system("EPSG:25832"), "Polygon")
    values = OutputRows([["a", "b"]], np.array([square.mean(axis=0), [np.nan, np.nan]]), [square, None], ["", "lost"])
    path = tmp_path / f"plots{suffix}"
    assert write_table(path, plots, [values]) == 2
    if suffix == ".csv":
        assert path.read_text().splitlines()[1:] == ["a,448005.0000,5411005.0000,EPSG:25832", "b,,,"]
    elif suffix == ".geojson":
        a, b = json.loads(path.read_bytes())["features"]
        (ring,) = a["geometry"]["coordinates"]
        xy = np.array(ring)
        assert ring[0] == ring[-1]
        assert float(xy[:-1, 0] @ xy[1:, 1] - xy[:-1, 1] @ xy[1:, 0]) > 0.0
        assert (b["geometry"], b["properties"]["no_geometry"]) == (None, "lost")
    elif suffix == ".gpkg":
        meta, _, shapes, _ = raw.read(str(path))
        assert (meta["geometry_type"], shapes[1]) == ("Polygon", None)
        np.testing.assert_array_equal(np.frombuffer(shapes[0][13:], "<f8").reshape(-1, 2), [*square, square[0]])
    else:
        shapes = parquet.read_table(str(path)).column("geometry").to_pylist()
        np.testing.assert_array_equal(np.frombuffer(shapes[0][13:], "<f8").reshape(-1, 2), [*square, square[0]])
        assert shapes[1] is None


def test_a_geographic_system_is_longitude_and_latitude(tmp_path: Path) -> None:
    lonlat = OutputLayer("t", COLUMNS, known_system("EPSG:25832"))
    write_table(tmp_path / "a.geojson", lonlat, [rows()])
    x, y = json.loads((tmp_path / "a.geojson").read_bytes())["features"][0]["geometry"]["coordinates"]
    assert (round(x, 1), round(y, 1)) == (8.3, 48.8)
    assert CRS(LONGITUDE_LATITUDE).axis_info[0].direction == "east"


def test_a_failed_file_leaves_the_old_one(tmp_path: Path) -> None:
    def broken() -> Any:
        yield rows()
        raise ValueError("broken")

    for suffix in SUFFIXES:
        path = tmp_path / f"a{suffix}"
        path.write_text("old")
        with pytest.raises(ValueError, match="broken"):
            write_table(path, layer(), broken())
        assert path.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == len(SUFFIXES)


def test_what_cannot_be_written_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(NotAcceptable, match=r"\.shp: use \.csv"):
        write_table(tmp_path / "a.shp", layer(), [rows()])

    for name in ("pyogrio.raw", "pyarrow"):
        monkeypatch.setitem(sys.modules, name, None)
    for suffix, extra in ((".gpkg", "gis"), (".parquet", "parquet")):
        with pytest.raises(NotAcceptable, match=rf"pip install 'urquhart\[{extra}\]'"):
            write_table(tmp_path / f"a{suffix}", layer(), [rows()])


@pytest.mark.parametrize(
    "name", ['=HYPERLINK("http://x.example")', "+1a", "-1", "@SUM(A1)", "'=1+1", "'plain", "\uff1d1"]
)
def test_a_spreadsheet_runs_no_tag_as_a_formula(tmp_path: Path, name: str) -> None:
    path = tmp_path / "trees.csv"
    write_table(path, layer(), [rows(names=[name, *NAMES[1:]])])
    with path.open(encoding="utf-8", newline="") as file:
        written = next(csv.DictReader(file))["id"]
    assert written == "-1" or written[0] == "'"
    assert read_stem_map(path).ids[0] == name
