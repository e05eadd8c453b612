"""What the caller says of a file, and the shapes of files that surveys have."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.stem_maps.reader import StemMap, StemMapError, read_stem_map
from server.stem_maps.reading.options import ReadOptions
from tests.server.commands.cli_helpers import Urquhart, refused

TREES = np.random.default_rng(21).uniform(0.0, (60.0, 40.0), (80, 2)).round(3)
DBH_CM = np.random.default_rng(22).uniform(8.0, 60.0, 80).round(1)
INDEX = ["--collection", "c", "--radius", 20, "--spacing", 15]


def rows(line: str, **more: Any) -> str:
    """A line for each tree: `line` may name n, x, y and d (centimetres)."""
    return "".join(
        line.format(n=n, x=x, y=y, d=d, **{key: values[n - 1] for key, values in more.items()}) + "\n"
        for n, ((x, y), d) in enumerate(zip(TREES.tolist(), DBH_CM.tolist(), strict=True), start=1)
    )


def read(folder: Path, text: str | bytes, **options: Any) -> StemMap:
    path = folder / "stand.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_stem_map(path, ReadOptions(**options))


def error_of(folder: Path, text: str | bytes, **options: Any) -> str:
    with pytest.raises(StemMapError) as caught:
        read(folder, text, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# ---------------------------------------------------------------- dialects of text


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "cp1252"])
def test_text_may_have_any_usual_encoding(tmp_path: Path, encoding: str) -> None:
    text = "id,x,y,species\n" + rows("{n},{x},{y},érable")
    stem_map = read(tmp_path, text.encode(encoding))
    assert stem_map.species == ("érable",) * 80
    assert ("read as" in stem_map.understood) == (encoding != "utf-8-sig")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("sep=;\nid;x;y\n" + rows("{n};{x};{y}"), "separated by semicolons"),
        ("sep=|\nid|x|y\n" + rows("{n}|{x}|{y}"), "separated by '|'"),
        ("id  x   y\n" + rows(" {n}  {x}   {y} "), "separated by spaces"),
        ('"x" "y" "dbh"\n' + rows('"{n}" {x} {y} {d}'), "as R writes its row names"),
        ('"","x","y"\n' + rows('"{n}",{x},{y}'), "tree_id from ''"),
        ("//x y z\n" + rows("{x} {y} 0"), "not used: 'z'"),
        ("Plot 7; May 2026\nsurveyed, by two\n\nid,x,y\n" + rows("{n},{x},{y}"), "2 title rows above the header on"),
        ("id,x,y,,\n" + rows("{n},{x},{y},,") + ",,,,\n,,,,\n", "2 blank lines"),
        ("id,x,y\n" + rows("{n},{x},{y},"), "tree_id from 'id'"),
        ('id,x,y\n' + rows('{n},"{x}","{y}"').replace(".", ","), "decimals with commas"),
    ],
)  # fmt: skip
def test_dialects_of_csv(tmp_path: Path, text: str, told: str) -> None:
    stem_map = read(tmp_path, text)
    np.testing.assert_array_equal(stem_map.xy, TREES)
    assert told in stem_map.understood


@pytest.mark.parametrize(
    ("write", "separator"),
    [
        (lambda value: f"{value + 448000:,.2f}", ","),
        (lambda value: f"{value + 448000:,.2f}".translate({44: 46, 46: 44}), ";"),
        (lambda value: f"{value + 448000:,.2f}".replace(",", " "), ";"),
        (lambda value: f"{value + 448000:,.2f}".replace(",", "'"), ","),
        (lambda value: f"{value + 448000:,.2f}".replace(",", "\u202f").replace(".", ","), "\t"),
    ],
)
def test_thousands_are_read_where_they_cannot_be_decimals(tmp_path: Path, write: Any, separator: str) -> None:
    lines = [separator.join(f'"{write(value)}"' for value in place) for place in TREES.tolist()]
    stem_map = read(tmp_path, "\n".join([separator.join("xy"), *lines]))
    np.testing.assert_allclose(stem_map.xy, TREES + 448000, atol=0.0051)
    assert "thousands grouped" in stem_map.understood


def test_a_mark_that_may_be_either_is_told_by_the_caller(tmp_path: Path) -> None:
    text = "x;y;dbh_cm\n1.125;5.179;20\n1.155;5.045;30\n"
    assert read(tmp_path, text).xy[0].tolist() == [1.125, 5.179]
    assert read(tmp_path, text, decimal="comma").xy[0].tolist() == [1125.0, 5179.0]
    quoted = 'x,y\n"1,125","5,179"\n"1,155","7,045"\n'
    assert "--decimal comma or --decimal point" in error_of(tmp_path, quoted)
    assert read(tmp_path, quoted, decimal="comma").xy[0].tolist() == [1.125, 5.179]
    assert read(tmp_path, quoted, decimal="point").xy[0].tolist() == [1125.0, 5179.0]


@pytest.mark.parametrize("word", ["", "NA", "n/a", "NULL", "-", "NaN", "."])
def test_words_for_no_value(tmp_path: Path, word: str) -> None:
    stem_map = read(tmp_path, f"id,x,y,dbh_cm,species\na,1,2,{word},{word}\nb,3,4,30,fir\n")
    assert stem_map.dbh_cm is not None
    np.testing.assert_array_equal(stem_map.dbh_cm, [np.nan, 30.0])
    assert stem_map.species == ("", "fir")
    assert "stand.csv:2: x: has no value" in error_of(tmp_path, f"x,y\n{word or 'NA'},2\n")


# ---------------------------------------------------------------- well-known headers


@pytest.mark.parametrize(
    ("header", "line", "told"),
    [
        ("treeID,X,Y,Z", "{n},{x},{y},18.5", "tree_id from 'treeID'"),
        ("TreeID,X,Y,Radius,Error,H,h_radius", "{n},{x},{y},{r},0.01,18.5,1.3", "radii in m from 'Radius', as TreeLS"),
        (",TH,DBH,X,Y", "T{n},18.5,{m},{x},{y}", "diameters in m from 'DBH', as 3DFin"),
        ("TreeID, TreeLocationX, TreeLocationY, TreeHeight, DBH, CrownArea", "{n},{x},{y},18.5,{m},9.5", "as LiDAR360"),
        ("id,file,tree,x,y,h.dist,dbh", "1,scan,{n},{x},{y},5.5,{d}", "tree_id from 'tree'"),
        ("treeID,stemID,tag,sp,quadrat,gx,gy,dbh,status", "{n},{n},9{n},quru,0101,{x},{y},{mm},A", "as ForestGEO"),
        ("OBJECTID,POINT_X,POINT_Y,DBH_cm", "{n},{x},{y},{d}", "tree_id from 'OBJECTID'"),
        ("tree,x,y,DBHqsm,TreeHeight", "{n},{x},{y},{m},18.5", "diameters in m from 'DBHqsm', as TreeQSM"),
        ("Baum,Rechtswert,Hochwert,BHD", "{n},{x},{y},{d}", "diameters in cm from 'BHD', which names no unit"),
        ("Tag,Easting (m),Northing (m),DBH [mm]", "{n},{x},{y},{mm}", "diameters in mm from 'DBH [mm]'"),
    ],
)  # fmt: skip
def test_headers_of_well_known_programs(tmp_path: Path, header: str, line: str, told: str) -> None:
    units = {"m": (DBH_CM / 100).round(4), "mm": (DBH_CM * 10).round(1), "r": (DBH_CM / 200).round(5)}
    stem_map = read(tmp_path, f"{header}\n" + rows(line, **units))
    np.testing.assert_array_equal(stem_map.xy, TREES)
    assert told in stem_map.understood
    assert stem_map.ids[4] in ("5", "T5")
    if "dbh" in header.lower() or "radius" in header.lower() or "BHD" in header:
        assert stem_map.dbh_cm is not None
        np.testing.assert_allclose(stem_map.dbh_cm, DBH_CM, atol=0.01)


def test_forestgeo_diameters_that_are_no_millimetres_are_refused(tmp_path: Path) -> None:
    text = "treeID,gx,gy,dbh\n" + rows("{n},{x},{y},{d}")
    assert "ForestGEO writes diameters in mm from 10 on" in error_of(tmp_path, text)
    assert read(tmp_path, text, dbh_unit="cm").dbh_cm is not None


def test_positions_within_quadrats(tmp_path: Path) -> None:
    cell = TREES // 20
    local = (TREES - 20 * cell).round(3)
    codes = [f"{int(column):02}{int(row):02}" for column, row in cell.tolist()]
    line = "{n},{q},{lx},{ly}"
    more = {"q": codes, "lx": local[:, 0].tolist(), "ly": local[:, 1].tolist()}
    stem_map = read(tmp_path, "tag,quadrat,lx,ly\n" + rows(line, **more))
    np.testing.assert_allclose(stem_map.xy, TREES, atol=1e-9)
    assert "quadrats of 20 m, of which 0000 begins at 0, 0" in stem_map.understood
    assert "--quadrat-size" in error_of(tmp_path, "tag,quadrat,lx,ly\n" + rows(line, **more), quadrat_size=10.0)
    assert "two digits of column" in error_of(tmp_path, "tag,quadrat,lx,ly\n1,A3,1,2\n")


# ---------------------------------------------------------------- columns by their names


def test_columns_are_what_the_caller_says(tmp_path: Path) -> None:
    text = "E,N,x,y,nr,d,ht,name\n" + rows("{x},{y},0,0,t{n},{d},20.5,fir")
    stem_map = read(tmp_path, text, x="E", y="n", id="NR", dbh="d", dbh_unit="cm", height="ht", species="name")
    np.testing.assert_array_equal(stem_map.xy, TREES)
    assert (stem_map.ids[0], stem_map.species) == ("t1", ("fir",) * 80)
    assert stem_map.dbh_cm is not None
    assert "not used: 'x', 'y'" in stem_map.understood
    assert "there is no column 'dd', which --dbh names: it names 'E', 'N'" in error_of(tmp_path, text, dbh="dd")
    assert "--x is given: give --y, too" in error_of(tmp_path, text, x="E")


@pytest.mark.parametrize(("unit", "metres"), [("ft", 0.3048), ("us-ft", 1200 / 3937), ("cm", 0.01), ("km", 1000.0)])
def test_positions_are_converted_to_metres(tmp_path: Path, unit: Any, metres: float) -> None:
    text = "x,y\n" + "".join(f"{x / metres!r},{y / metres!r}\n" for x, y in TREES.tolist())
    stem_map = read(tmp_path, text, unit=unit)
    np.testing.assert_allclose(stem_map.xy, TREES, atol=1e-9)
    assert f"converted from {unit} to metres" in stem_map.understood
    named = "us_ft" if unit == "us-ft" else unit
    np.testing.assert_allclose(read(tmp_path, text.replace("x,y", f"x_{named},y_{named}")).xy, TREES, atol=1e-9)
    assert "names its unit, but --unit says m" in error_of(
        tmp_path, text.replace("x,y", f"x_{named},y_{named}"), unit="m"
    )


def test_a_file_beside_the_data_says_the_same(tmp_path: Path) -> None:
    text = "E,N,BHD2\n" + rows("{x},{y},{d}")
    (tmp_path / "columns.toml").write_text('x = "E"\ny = "N"\ndbh = "BHD2"\ndbh-unit = "cm"\nplot = "plot"\n')
    stem_map = read(tmp_path, text)
    np.testing.assert_array_equal(stem_map.xy, TREES)
    assert stem_map.understood.startswith("columns.toml says x, y, plot, dbh, dbh_unit; read ") or (
        "columns.toml says" in stem_map.understood
    )
    (tmp_path / "columns.toml").write_text('dbh_unti = "cm"\n')
    assert "columns.toml: the key 'dbh_unti' is not known; did you mean 'dbh_unit'?" in error_of(tmp_path, text)
    for wrong, told in (("unit = 'miles'", "one of m, ft"), ("x = 3", "x is 3"), ("x = ", "no TOML file")):
        (tmp_path / "columns.toml").write_text(wrong)
        assert told in error_of(tmp_path, text)


def test_dead_trees_are_left_out_by_their_status(tmp_path: Path) -> None:
    text = "id,x,y,state\n" + rows("{n},{x},{y},{s}", s=["dead" if n % 4 == 0 else "A" for n in range(80)])
    assert len(read(tmp_path, text)) == 80
    stem_map = read(tmp_path, text, status="state", keep=("a",))
    assert len(stem_map) == 60
    assert "left out 20 of 80 rows by their 'state'" in stem_map.understood
    assert "has the values 'A' (60), 'dead' (20): name those" in error_of(tmp_path, text, status="state")
    assert "no row has the status 'alive'" in error_of(tmp_path, text, status="state", keep=("alive",))
    assert "name the column with --status" in error_of(tmp_path, text, keep=("A",))


def test_plots_that_differ_in_their_case_are_two_plots(tmp_path: Path) -> None:
    plots = ["A" if n < 17 else "a" if n < 36 else "b" for n in range(80)]
    text = "id,x,y,plot\n" + rows("{n},{x},{y},{s}", s=plots)
    for only, count in (("A", 17), ("a", 19), ("b", 44), ("B", 44)):
        assert len(read(tmp_path, text, plot="plot", only=only)) == count
    text = text.replace(",b\n", ",ab\n").replace(",a\n", ",aB\n")
    assert "fits the plots 'aB' and 'ab'" in error_of(tmp_path, text, plot="plot", only="AB")


def test_a_status_that_is_not_used_is_told(tmp_path: Path) -> None:
    text = "id,x,y,DFstatus,Höhe\n" + rows("{n},{x},{y},{s},12.5", s=["alive", "dead"] * 40)
    stem_map = read(tmp_path, text)
    assert "'DFstatus' is not used, so dead trees may be among these: --status and --keep" in stem_map.understood
    assert stem_map.height_m is not None
    assert "DFstatus' is not used" not in read(tmp_path, text, status="DFstatus", keep=("alive",)).understood


def test_bad_rows_are_reported_together_or_left_out(tmp_path: Path) -> None:
    text = "id,x,y,dbh_cm\n" + rows("{n},{x},{y},{d}") + "81,oak,1,30\n82,2,,30\n83,1\n,5,5,20\n"
    with pytest.raises(StemMapError) as caught:
        read(tmp_path, text)
    assert "stand.csv:82: x: not a number: 'oak' (3 more bad rows" in str(caught.value)
    assert [(row.line, row.column) for row in caught.value.bad_rows] == [(82, "x"), (83, "y"), (84, ""), (85, "")]
    stem_map = read(tmp_path, text, skip_bad=True)
    assert len(stem_map) == 80
    assert "left out 4 rows that cannot be used" in stem_map.understood


# ---------------------------------------------------------------- systems


def test_the_system_of_a_file_is_checked(tmp_path: Path) -> None:
    text = "x,y\n" + "".join(f"{x + 448000},{y + 5411000}\n" for x, y in TREES.tolist())
    stem_map = read(tmp_path, text, crs="EPSG:25832")
    assert stem_map.crs == "EPSG:25832"
    assert "in EPSG:25832" in stem_map.understood
    assert "is no known coordinate reference system" in error_of(tmp_path, text, crs="EPSG:nope")
    assert "would lie outside" in error_of(tmp_path, text, crs="EPSG:2264")
    assert "gives degrees" in error_of(tmp_path, text, crs="EPSG:4326")
    swapped = "x,y\n" + "".join(f"{y + 5411000},{x + 448000}\n" for x, y in TREES.tolist())
    assert "check that x is east" in error_of(tmp_path, swapped, crs="EPSG:25832")
    feet = "x,y\n" + "".join(f"{x / 0.3048006 + 1.5e6},{y / 0.3048006 + 6e5}\n" for x, y in TREES.tolist())
    in_feet = read(tmp_path, feet, crs="EPSG:2264")
    np.testing.assert_allclose(np.ptp(in_feet.xy, axis=0), np.ptp(TREES, axis=0), rtol=1e-4)
    assert "converted from US survey foot to metres" in in_feet.understood
    assert "said to be in m: drop one" in error_of(tmp_path, feet, crs="EPSG:2264", unit="m")


def test_degrees_are_refused_or_converted(tmp_path: Path) -> None:
    east, north = 1 / (111_320 * math.cos(math.radians(48.0))), 1 / 111_320
    places = [(8.2 + x * east, 48.0 + y * north) for x, y in TREES.tolist()]
    text = "lon,lat\n" + "".join(f"{x!r},{y!r}\n" for x, y in places)
    assert "longitude and latitude are degrees" in error_of(tmp_path, text)
    assert "--project EPSG:32632" in error_of(tmp_path, text, x="lon", y="lat", crs="EPSG:4326")
    assert "as degrees of longitude" in error_of(tmp_path, text.replace("lon,lat", "x,y"))
    stem_map = read(tmp_path, text, x="lon", y="lat", crs="EPSG:4326", project="EPSG:25832")
    assert stem_map.crs == "EPSG:25832"
    np.testing.assert_allclose(np.ptp(stem_map.xy, axis=0), np.ptp(TREES, axis=0), rtol=0.01)


# ---------------------------------------------------------------- plausibility


def test_what_can_hardly_be_metres_is_refused_unless_it_is_named(tmp_path: Path) -> None:
    feet = "x,y,dbh_cm\n" + "".join(
        f"{x / 0.3048},{y / 0.3048},{d / 3}\n" for (x, y), d in zip(TREES.tolist(), DBH_CM.tolist(), strict=True)
    )
    assert "say --unit ft" in error_of(tmp_path, feet)
    assert len(read(tmp_path, feet, unit="m")) == 80
    dense = "x_m,y_m\n" + "".join(f"{x / 10},{y / 10}\n" for x, y in TREES.tolist())
    assert "trees on a hectare: name the unit" in error_of(tmp_path, dense)
    assert len(read(tmp_path, dense, unit="m")) == 80
    line = "x,y\n" + rows("{x},7.5")
    assert "y is 7.5 in all 80 rows" in error_of(tmp_path, line)
    coarse = "x,y\n" + "".join(f"{round(x / 10) * 10},{round(y / 4) * 4}\n" for x, y in TREES.tolist())
    assert "rounded too coarsely" in error_of(tmp_path, coarse)
    tall = "x,y,height\n" + rows("{x},{y},85.5")
    assert "--height-unit" in error_of(tmp_path, tall)
    assert read(tmp_path, tall, height_unit="ft").height_m is not None


# ---------------------------------------------------------------- polar plots


POLAR = np.column_stack([np.hypot(*(TREES - 20.0).T), np.arctan2(*(TREES - 20.0).T) % (2 * np.pi)])


@pytest.mark.parametrize(
    ("header", "turn", "options"),
    [
        ("azimuth,distance", 360.0, {}),
        ("azimuth_gon,dist_m", 400.0, {}),
        ("azi,dist", 400.0, {"angle": "gon"}),
        ("az,r", 2 * np.pi, {"angle": "rad", "azimuth": "az", "distance": "r"}),
    ],
)
def test_polar_measurements_are_read(tmp_path: Path, header: str, turn: float, options: dict[str, Any]) -> None:
    text = f"tree,{header}\n" + rows(
        "{n},{a!r},{r!r}", a=(POLAR[:, 1] / (2 * np.pi) * turn).tolist(), r=POLAR[:, 0].tolist()
    )
    np.testing.assert_allclose(read(tmp_path, text, **options).xy, TREES - 20.0, atol=1e-9)


def test_declination_slope_and_centres(tmp_path: Path) -> None:
    degrees = np.degrees(POLAR[:, 1])
    along = POLAR[:, 0] / math.cos(math.radians(12.0))
    plots = ["P1" if n % 2 else "P2" for n in range(80)]
    more = {"p": plots, "a": (degrees - 3.5).tolist(), "s": along.tolist()}
    text = "plot,tree,azimuth,distance,slope\n" + rows("{p},{n},{a!r},{s!r},12", **more)
    (tmp_path / "centres.csv").write_text("plot,x,y\nP1,448020,5411020\nP2,448520,5411020\n")
    given: dict[str, Any] = {"declination": 3.5, "slope": "slope", "centres": tmp_path / "centres.csv"}
    stem_map = read(tmp_path, text, **given)
    offset = np.array([[448000.0 if plot == "P1" else 448500.0, 5411000.0] for plot in plots])
    np.testing.assert_allclose(stem_map.xy - offset, TREES, atol=1e-6)
    for told in ("3.5 deg added to azimuths", "made horizontal", "from the centres of --centres"):
        assert told in stem_map.understood
    (tmp_path / "centres.csv").write_text("plot,x,y\nP1,448020,5411020\n")
    assert "no centre of the plot 'P2'" in error_of(tmp_path, text, **given)
    named = text.replace("plot,tree", "cx,cy,tree").replace("P1,", "448020,5411020,").replace("P2,", "448020,5411020,")
    centred = read(tmp_path, named, declination=3.5, slope="slope", centre_x="cx", centre_y="cy")
    np.testing.assert_allclose(centred.xy - (448000.0, 5411000.0), TREES, atol=1e-6)


def test_centres_that_repeat_are_those_of_polar_plots(tmp_path: Path) -> None:
    more = {"a": np.degrees(POLAR[:, 1]).tolist(), "r": POLAR[:, 0].tolist()}
    stem_map = read(tmp_path, "tree,x,y,azimuth,distance\n" + rows("{n},20.0,20.0,{a!r},{r!r}", **more))
    np.testing.assert_allclose(stem_map.xy, TREES, atol=1e-9)
    assert "from centres in 'x' and 'y'" in stem_map.understood


def test_positions_that_may_be_centres_or_trees_are_told_by_the_caller(tmp_path: Path) -> None:
    places = [f"{n // 4 * 5}.5,{7 + n % 3}.5" for n in range(80)]
    text = "tree,x,y,azimuth,distance\n" + rows("{n},{p},{a},9.5", p=places, a=[4 * n for n in range(80)])
    assert "80 rows have 60 positions, beside an azimuth" in error_of(tmp_path, text)
    assert "from centres" in read(tmp_path, text, azimuth="azimuth", distance="distance").understood
    assert len(read(tmp_path, text, ignore=("azimuth",))) == 80


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"declination": 3.0}, "--declination is for polar measurements"),
        ({"project": "EPSG:25832"}, "name the system of the positions with --crs, too"),
        ({"centres": Path("none.csv")}, "no such file"),
        ({"only": "P1"}, "name the column with --plot"),
    ],
)
def test_options_that_change_nothing_are_refused(tmp_path: Path, options: dict[str, Any], told: str) -> None:
    text = "tree,x,y\n" + rows("{n},{x},{y}")
    with pytest.raises(StemMapError, match=told):
        read(tmp_path, text, **options)


@pytest.mark.parametrize(
    ("azimuth", "slope", "told"),
    [
        ("{n}00", "0", "more than a full turn in deg"),
        ("0.0{n}", "0", "looks like radians"),
        ("1{n}", "80", "--slope-unit"),
    ],
)
def test_angles_in_another_unit_are_refused(tmp_path: Path, azimuth: str, slope: str, told: str) -> None:
    text = "tree,azimuth,distance,slope\n" + rows(f"{{n}},{azimuth},{{x}},{slope}")
    assert told in error_of(tmp_path, text, slope="slope")


# ---------------------------------------------------------------- plots through the command line


def test_each_plot_is_a_submap_of_one_stand(urquhart: Urquhart, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    plots = {f"P{i}": rng.uniform(-14.0, 14.0, (25, 2)).round(2) for i in range(1, 7)}

    def write(names: list[str]) -> None:
        lines = [f"{name},{n},{x},{y}" for name in names for n, (x, y) in enumerate(plots[name].tolist())]
        (tmp_path / "season.csv").write_text("\n".join(["plot,tree,x,y", *lines, "P9,1,1,1", ""]))

    write([*plots])
    refused(
        urquhart("index", "season.csv", *INDEX), "the column 'plot' has 7 values whose trees overlap", "--plot plot"
    )
    said = urquhart("index", "season.csv", *INDEX, "--plot", "plot")
    assert said.code == 0, said.err
    for told in ("season: 151 trees -> 6 submaps", "6 plots, each a place of its own", "1 plots left out with fewer"):
        assert told in said.out
    (tmp_path / "seen.csv").write_text(
        "tree,x,y\n" + "".join(f"{i},{y},{-x}\n" for i, (x, y) in enumerate(plots["P3"]))
    )
    found = urquhart("locate", "seen.csv", "--collection", "c")
    assert "pose in season-P3: x" in found.out
    whole = urquhart("locate", "season.csv", "--collection", "c", "--plot", "plot")
    refused(whole, "has 7 plots: choose one with --only")
    only = urquhart("locate", "season.csv", "--collection", "c", "--plot", "plot", "--only", "P5")
    assert "pose in season-P5" in only.out
    write(["P1", "P2"])
    again = urquhart("index", "season.csv", *INDEX, "--plot", "plot")
    assert "(0 new, 0 replaced, 2 unchanged)" in again.out
    assert "4 removed that the stand had before" in again.out


def test_files_in_two_systems_are_not_mixed(urquhart: Urquhart, tmp_path: Path) -> None:
    for name in "ab":
        (tmp_path / name).mkdir()
        lines = "".join(f"{x + 448000},{y + 5411000}\n" for x, y in TREES.tolist())
        (tmp_path / name / f"{name}.csv").write_text("x,y\n" + lines)
    (tmp_path / "a" / "columns.toml").write_text('crs = "EPSG:25832"\n')
    (tmp_path / "b" / "columns.toml").write_text('crs = "EPSG:32632"\n')
    refused(urquhart("index", "a/a.csv", "b/b.csv", *INDEX), "but b/b.csv is in EPSG:32632: convert all to one system")
