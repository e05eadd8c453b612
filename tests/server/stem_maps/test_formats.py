"""GIS files, workbooks and point clouds: what is written with other programs' libraries is read as it was meant."""

import builtins
import importlib
import json
import struct
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from server.stem_maps.formats import workbooks
from server.stem_maps.reader import StemMap, StemMapError, read_stem_map
from server.stem_maps.reading.options import ReadOptions

pyogrio: Any = importlib.import_module("pyogrio")
raw: Any = importlib.import_module("pyogrio.raw")
openpyxl: Any = importlib.import_module("openpyxl")
laspy: Any = importlib.import_module("laspy")

TREES = np.random.default_rng(31).uniform(0.0, (60.0, 40.0), (80, 2)).round(3) + (448000.0, 5411000.0)
DBH_CM = np.random.default_rng(32).uniform(8.0, 60.0, 80).round(1)
TAGS = [f"T{n:03}" for n in range(80)]
DRIVERS = {
    "gpkg": "GPKG", "shp": "ESRI Shapefile", "fgb": "FlatGeobuf", "geojson": "GeoJSON", "kml": "KML", "gpx": "GPX",
}  # fmt: skip


def points(xy: NDArray[np.float64], kind: int = 1, *more: float) -> NDArray[Any]:
    """Well-known binary: points of the type `kind`, with `more` coordinates each."""
    code = f"<BI{2 + len(more)}d"
    return np.array([struct.pack(code, 1, kind, *place, *more) for place in xy.tolist()], dtype=object)


def write(path: Path, xy: NDArray[np.float64] = TREES, crs: str | None = "EPSG:25832", **options: Any) -> Path:
    """A file of trees with tags and diameters, by GDAL."""
    fields = options.pop("fields", {"tag": np.array(TAGS[: len(xy)], dtype=object), "dbh_cm": DBH_CM[: len(xy)]})
    geometry = options.pop("geometry", points(xy))
    settings = {"driver": DRIVERS[path.suffix[1:]], "crs": crs, "geometry_type": "Point"} | options
    raw.write(path, geometry=geometry, field_data=[*fields.values()], fields=[*fields], **settings)
    return path


def read(path: Path, **options: Any) -> StemMap:
    return read_stem_map(path, ReadOptions(**options))


def error_of(path: Path, **options: Any) -> str:
    with pytest.raises(StemMapError) as caught:
        read(path, **options)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(path))
    return str(caught.value)


# ---------------------------------------------------------------- GIS files


@pytest.mark.parametrize("suffix", ["gpkg", "shp", "fgb", "geojson"])
def test_points_of_gis_files_are_trees(tmp_path: Path, suffix: str) -> None:
    path = write(tmp_path / f"stand.{suffix}")
    stem_map = read(path)
    assert stem_map.dbh_cm is not None
    order = np.argsort(stem_map.ids)  # FlatGeobuf sorts features by place
    np.testing.assert_allclose(stem_map.xy[order], TREES, atol=1e-3)
    assert sorted(stem_map.ids) == TAGS
    assert stem_map.dbh_cm[order].tolist() == DBH_CM.tolist()
    assert stem_map.crs == "EPSG:25832"
    assert "in EPSG:25832" in stem_map.understood
    assert "but --crs says EPSG:25833: drop --crs" in error_of(path, crs="EPSG:25833")
    assert read(path, crs="EPSG:25832").crs == "EPSG:25832"
    moved = read(path, project="EPSG:32632")
    assert moved.crs == "EPSG:32632"
    np.testing.assert_allclose(np.ptp(moved.xy, axis=0), np.ptp(TREES, axis=0), rtol=1e-6)


@pytest.mark.parametrize("suffix", ["kml", "gpx", "geojson"])
def test_degrees_of_gis_files_are_refused_with_advice_or_converted(tmp_path: Path, suffix: str) -> None:
    degrees = np.column_stack([8.2 + (TREES[:, 0] - 448000) / 74500, 48.8 + (TREES[:, 1] - 5411000) / 111200])
    names = {"name": np.array(TAGS, dtype=object)}
    path = write(tmp_path / f"stand.{suffix}", degrees, "EPSG:4326", fields=names)
    assert "gives degrees, and distances between trees need metres: convert with --project EPSG:32632" in error_of(path)
    stem_map = read(path, project="EPSG:32632")
    assert stem_map.ids == tuple(TAGS)
    np.testing.assert_allclose(np.ptp(stem_map.xy, axis=0), np.ptp(TREES, axis=0), rtol=0.02)


@pytest.mark.parametrize("suffix", ["gpkg", "shp", "geojson"])
def test_heights_of_points_are_left_out(tmp_path: Path, suffix: str) -> None:
    path = write(tmp_path / f"stand.{suffix}", geometry=points(TREES, 1001, 3.0), geometry_type="Point Z")
    np.testing.assert_allclose(read(path).xy, TREES, atol=1e-3)


def test_a_geojson_file_in_metres_has_the_system_that_the_caller_names(tmp_path: Path) -> None:
    path = tmp_path / "stand.geojson"
    shapes = [
        {"type": "Feature", "properties": {"tag": tag}, "geometry": {"type": "Point", "coordinates": place}}
        for tag, place in zip(TAGS, TREES.tolist(), strict=True)
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": shapes}))
    plain = read(path)
    assert plain.crs is None
    assert "positions are no degrees, so the system of the file is not known" in plain.understood
    assert read(path, crs="EPSG:25832").crs == "EPSG:25832"


def test_shapes_that_are_not_points_are_refused(tmp_path: Path) -> None:
    ring = [*TREES[:3].tolist(), TREES[0].tolist()]
    polygon = struct.pack("<BIII", 1, 3, 1, 4) + b"".join(struct.pack("<dd", *place) for place in ring)
    fields = {"tag": np.array(["a"], dtype=object)}
    path = write(
        tmp_path / "a.gpkg", geometry=np.array([polygon], dtype=object), geometry_type="Polygon", fields=fields
    )
    assert "feature 1 is a polygon and not a point: give a point for each tree" in error_of(path)
    two = struct.pack("<BII", 1, 4, 2) + b"".join(points(TREES[:2]).tolist())
    one = struct.pack("<BII", 1, 4, 1) + points(TREES[:1])[0]
    both = {"tag": np.array(["a", "b", "c"], dtype=object)}
    path = write(
        tmp_path / "b.gpkg", geometry=np.array([one, two, None], dtype=object), geometry_type="MultiPoint", fields=both
    )
    with pytest.raises(StemMapError) as caught:
        read(path)
    assert [(row.line, row.what) for row in caught.value.bad_rows] == [
        (2, "the feature has not exactly one point"),
        (3, "the feature has no geometry"),
    ]
    assert read(path, skip_bad=True).ids == ("a",)


def test_a_layer_is_chosen_by_its_name(tmp_path: Path) -> None:
    path = write(tmp_path / "stand.gpkg", layer="trees")
    write(path, TREES[:30], layer="roads", append=True)
    assert "has 2 layers, 'trees', 'roads': choose one with --layer" in error_of(path)
    assert len(read(path, layer="roads")) == 30
    assert "has no layer 'tree': there are 'trees', 'roads'" in error_of(path, layer="tree")
    table = tmp_path / "stand.csv"
    table.write_text("x,y\n1,2\n")
    assert "has no layers" in error_of(table, layer="trees")


def test_a_layer_without_geometry_needs_columns_of_positions(tmp_path: Path) -> None:
    plain = {"tag": np.array(TAGS, dtype=object), "dbh_cm": DBH_CM}
    path = write(tmp_path / "a.gpkg", geometry=None, geometry_type=None, fields=plain, crs=None)
    assert "column x_m or x is missing" in error_of(path)
    placed = plain | {"x": TREES[:, 0], "y": TREES[:, 1]}
    path = write(tmp_path / "b.gpkg", geometry=None, geometry_type=None, fields=placed, crs=None)
    np.testing.assert_array_equal(read(path, crs="EPSG:25832").xy, TREES)


def test_attributes_may_be_used_instead_of_the_geometry(tmp_path: Path) -> None:
    fields = {"e": TREES[:, 0] + 5.0, "n": TREES[:, 1]}
    path = write(tmp_path / "stand.gpkg", fields=fields)
    assert "not used: 'e', 'n'" in read(path).understood
    np.testing.assert_array_equal(read(path, x="e", y="n").xy, TREES + (5.0, 0.0))


@pytest.mark.parametrize("suffix", ["gpkg", "shp", "fgb", "geojson", "kml", "parquet"])
def test_damaged_gis_files_are_one_line(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"stand.{suffix}"
    path.write_bytes(b"")
    assert "is empty" in error_of(path)
    path.write_bytes(b"<OGRVRTDataSource></OGRVRTDataSource>" if suffix != "kml" else b"x,y\n1,2\n")
    assert "although its suffix is" in error_of(path)
    if suffix in DRIVERS:
        path.unlink()
        written = write(path, fields={"name": np.array(TAGS, dtype=object)}, crs="EPSG:4326", xy=TREES / 1e6)
        path.write_bytes(written.read_bytes()[: written.stat().st_size // 2])
        error_of(path)
    else:
        path.write_bytes(b"PAR1 and what else a Parquet file has PAR1")
        error_of(path)


EXTRAS = ("pyogrio", "openpyxl", "laspy", "pyarrow")


def test_an_extra_that_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gis = [write(tmp_path / "stand.gpkg"), workbook(tmp_path / "stand.xlsx")]
    (tmp_path / "a.parquet").write_bytes(b"PAR1")
    paths = {"gis": gis, "las": [cloud(tmp_path / "a.las")], "parquet": [tmp_path / "a.parquet"]}
    found = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name.split(".")[0] in EXTRAS:
            raise ImportError(name)
        return found(name, *rest, **more)

    for name in [name for name in sys.modules if name.split(".")[0] in EXTRAS]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setattr(builtins, "__import__", without)
    for extra, files in paths.items():
        for path in files:
            assert f"pip install 'urquhart[{extra}]'" in error_of(path)


# ---------------------------------------------------------------- workbooks


def workbook(path: Path, sheets: dict[str, list[list[Any]]] | None = None) -> Path:
    trees = [[tag, x, y, d] for tag, (x, y), d in zip(TAGS, TREES.tolist(), DBH_CM.tolist(), strict=True)]
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, lines in (sheets or {"trees": [["tag", "x", "y", "DBH (cm)"], *trees]}).items():
        sheet = book.create_sheet(name)
        for line in lines:
            sheet.append(line)
    book.save(path)
    return path


def test_a_sheet_of_a_workbook_is_a_table(tmp_path: Path) -> None:
    stem_map = read(workbook(tmp_path / "stand.xlsx"), crs="EPSG:25832")
    np.testing.assert_array_equal(stem_map.xy, TREES)
    assert stem_map.ids == tuple(TAGS)
    assert stem_map.dbh_cm is not None
    assert stem_map.dbh_cm.tolist() == DBH_CM.tolist()
    lines: list[list[Any]] = [["Plot 7", None], [], ["nr", "x", "y", "note"]]
    lines += [[1, 1.5, 2.5, None], [2.0, "3.5", "4.5", "leans"], [3, None, 1]]
    path = workbook(tmp_path / "b.xlsx", {"about": [["a season"]], "plot 7": lines})
    assert "b.xlsx:6: x: has no value" in error_of(path)
    titled = read(path, skip_bad=True, id="nr")
    assert (titled.ids, titled.xy.tolist()) == (("1", "2"), [[1.5, 2.5], [3.5, 4.5]])
    assert "1 title rows above the header in row 3" in titled.understood
    path = workbook(tmp_path / "c.xlsx", {"a": [["x", "y"], [1, 2]], "b": [["x", "y"], [3, 4]]})
    assert "has 2 sheets of trees, 'a', 'b': choose one with --layer" in error_of(path)
    assert read(path, layer="b").xy.tolist() == [[3.0, 4.0]]
    assert "has no sheet 'd'" in error_of(path, layer="d")
    assert "the file is empty" in error_of(workbook(tmp_path / "e.xlsx", {"a": []}))


def test_blank_rows_with_formats_are_not_parsed(tmp_path: Path) -> None:
    sheet: list[list[Any]] = [["x", "y"], [1.5, 2.5], [None, None], [3.5, 4.5], [5.5, 7.5]]
    path = workbook(tmp_path / "f.xlsx", {"a": sheet})
    book = openpyxl.load_workbook(path)
    for row in range(6, 3000):
        book["a"].cell(row, 1).number_format = "0.00"
    book.save(path)
    parsed = openpyxl.load_workbook(path, read_only=True)["a"]
    assert workbooks._last_row(path, parsed) == 5
    assert read(path, unit="m").xy.tolist() == [[1.5, 2.5], [3.5, 4.5], [5.5, 7.5]]


def test_workbooks_that_cannot_be_read_are_one_line(tmp_path: Path) -> None:
    path = workbook(tmp_path / "stand.xlsx")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert "only a part of one" in error_of(path)
    path.write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(512))
    assert "has a password, or is an old xls file" in error_of(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", bytes(60_000_000))
    assert "unpacks to 60 MB" in error_of(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.txt", "x")
    assert "is no workbook that can be read" in error_of(path)


# ---------------------------------------------------------------- point clouds


def cloud(path: Path, name: str | None = "treeID", crs: int | None = 25832) -> Path:
    """Forty points of stem and crown for each tree, and some of the ground."""
    rng = np.random.default_rng(7)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), np.array([448000.0, 5411000.0, 0.0])
    if name is not None:
        header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=np.int32))
    header.add_extra_dim(laspy.ExtraBytesParams(name="dbh_cm", type=np.float32))
    if crs is not None:
        from pyproj import CRS

        header.add_crs(CRS.from_epsg(crs))
    numbers = np.concatenate([np.repeat(np.arange(1, 81), 40), np.zeros(500, int)])
    height = np.concatenate([np.tile(np.linspace(0.0, 20.0, 40) ** 1.0, 80), np.zeros(500)])
    height[:3200].reshape(80, 40)[:, 1:13] = np.linspace(1.0, 1.6, 12)
    stems = np.repeat(TREES, 40, axis=0)
    crowns = (height[:3200] > 3.0)[:, None] * rng.normal(1.5, 1.0, (3200, 2))
    xy = np.concatenate([stems + crowns, rng.uniform(TREES.min(axis=0), TREES.max(axis=0), (500, 2))])
    las = laspy.LasData(header)
    las.x, las.y, las.z = xy[:, 0], xy[:, 1], height
    if name is not None:
        las[name] = numbers
    las["dbh_cm"] = np.concatenate([np.repeat(DBH_CM, 40), np.zeros(500)])
    las.write(path)
    return path


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_trees_of_a_point_cloud_stand_at_breast_height(tmp_path: Path, suffix: str) -> None:
    stem_map = read(cloud(tmp_path / f"stand.{suffix}"))
    np.testing.assert_allclose(stem_map.xy, TREES, atol=1e-3)
    assert (stem_map.ids[0], stem_map.ids[-1], stem_map.crs) == ("1", "80", "EPSG:25832")
    assert stem_map.dbh_cm is not None
    np.testing.assert_allclose(stem_map.dbh_cm, DBH_CM, atol=1e-5)
    assert "3700 points, 500 of no tree, 80 trees stand where their stem is at breast height" in stem_map.understood


def test_a_point_cloud_must_say_which_tree_a_point_is_of(tmp_path: Path) -> None:
    path = cloud(tmp_path / "stand.laz", name="segment")
    assert "its extra dimensions are 'segment', 'dbh_cm'" in error_of(path)
    assert len(read(path, id="segment")) == 80
    none = cloud(tmp_path / "none.las", name=None)
    assert "segment the trees first, or name the dimension with --id" in error_of(none)
    whole = path.read_bytes()
    for size in (100, len(whole) // 2):
        path.write_bytes(whole[:size])
        error_of(path)
    las = cloud(tmp_path / "cut.las")
    damaged = bytearray(las.read_bytes())
    damaged[100:104] = b"\xff\xff\xff\xff"  # the number of records before the points
    las.write_bytes(damaged)
    assert "promises more records than the file holds" in error_of(las)
    las.write_bytes(b"PK\x03\x04")
    assert "is no point cloud, although its suffix is .las" in error_of(las)
    cloud(las)
    las.write_bytes(las.read_bytes()[:60_000])
    assert "is cut off" in error_of(las) or "no point cloud" in error_of(las)


# ---------------------------------------------------------------- other files


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.csv", b"", "the file is empty"),
        ("a.csv", b"\xef\xbb\xbf", "the file is empty"),
        ("a.csv", b"x,y\n", "has a header but no trees"),
        ("a.csv", b"x,y\n1,\x002\n", "NUL"),
        ("a.csv", b"PK\x03\x04rest", "a zip archive"),
        ("a.csv", b"SQLite format 3\x00", "give it the suffix gpkg"),
        ("a.txt", b"LASF" + bytes(80), "give it the suffix las"),
        ("a.csv", b"x,y" + b",a" * 1_000_000, "1000002 columns"),
        ("a.csv", b"x,y\n" + b"1,2" + b"," * 5000, "a header but no trees"),
        ("a.rds", b"\x1f\x8b", "R's own format"),
        ("a.xls", b"\xd0\xcf", "save it as xlsx"),
        ("a.zip", b"PK", "unpack it"),
        ("a.xyz", b"1.5 2.5 3.5\n4.5 5.5 6.5\n", "the header must name x_m and y_m"),
    ],
)
def test_files_that_hold_no_trees(tmp_path: Path, name: str, content: bytes, told: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    if told == "a header but no trees":
        assert read(path, unit="m").xy.tolist() == [[1.0, 2.0]]
    else:
        assert told in error_of(path)


def test_broken_gis_files_are_refused_in_plain_words(tmp_path: Path) -> None:
    path = tmp_path / "trees.geojson"
    path.write_text('{"type": "FeatureCollection",\n "features": [{"type": "Feature", ')
    assert "is not JSON from line 2, column" in error_of(path)
    path.write_text('{"type": "nothing"}')
    assert "not a collection of features" in error_of(path)
    (tmp_path / "trees.shp").write_bytes(b"\x00\x00\x27\x0a" + bytes(96))
    assert "needs trees.shx and trees.dbf beside it" in error_of(tmp_path / "trees.shp")
    (tmp_path / "trees.gpkg").write_bytes(b"SQLite format 3\0" + bytes(3000))
    assert "is damaged or cut off" in error_of(tmp_path / "trees.gpkg")
    (tmp_path / "trees.csv").write_text("tag|x|y\n1|2|3\n")
    assert "sep=|" in error_of(tmp_path / "trees.csv")
    (tmp_path / "trees.csv").write_text("sep=|\ntag|x|y\n1|2|3\n2|5|9\n")
    assert "columns separated by '|'" in read_stem_map(tmp_path / "trees.csv").understood
