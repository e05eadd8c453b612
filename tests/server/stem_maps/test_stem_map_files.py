"""Files as survey offices have them: read as they are meant, or refused with the reason; never wrong in silence."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.stem_maps.reader import StemMap, StemMapError, read_stem_map
from server.stem_maps.reading.options import ReadOptions
from server.stem_maps.tiling import without_twins
from tests.server.commands.cli_helpers import Urquhart, refused

TREES = np.random.default_rng(11).uniform(0.0, (60.0, 40.0), (80, 2)).round(3)
DBH_CM = np.random.default_rng(12).uniform(8.0, 60.0, 80).round(1)
INDEX = ["--collection", "c", "--radius", 20, "--spacing", 15]


def table(header: str, row: Callable[[int, float, float, float], str], unit: float = 1.0) -> str:
    """A header, and a line for each tree from its number, x, y and diameter: centimetres times `unit`."""
    lines = [
        row(i + 1, x, y, round(d * unit, 6))
        for i, ((x, y), d) in enumerate(zip(TREES.tolist(), DBH_CM.tolist(), strict=True))
    ]
    return "\n".join([header, *lines]) + "\n"


def read(folder: Path, text: str, **options: Any) -> StemMap:
    path = folder / "stand.csv"
    path.write_text(text)
    return read_stem_map(path, ReadOptions(**options))


def same_trees(stem_map: StemMap) -> bool:
    return bool(np.array_equal(stem_map.xy, TREES))


# ---------------------------------------------------------------- lines, separators, numbers


def test_a_tag_may_begin_with_a_hash(tmp_path: Path) -> None:
    text = "# plot 7\n# of May\n" + table("tag,x,y", lambda i, x, y, _: f"{'#' if i % 3 else ''}{i},{x},{y}")
    stem_map = read(tmp_path, text)
    assert same_trees(stem_map)
    assert stem_map.ids[:3] == ("#1", "#2", "3")
    assert "passed over 2 comments above the header and 0 blank lines" in stem_map.understood


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("mark", [",", "."])
def test_semicolons_and_tabs_with_either_decimal_mark(tmp_path: Path, separator: str, mark: str) -> None:
    text = table("Nummer,x,y,dbh_cm", lambda i, x, y, d: f"{i},{x},{y},{d}").replace(",", separator)
    stem_map = read(tmp_path, text.replace(".", mark))
    assert same_trees(stem_map)
    assert stem_map.dbh_cm is not None
    assert stem_map.dbh_cm.tolist() == DBH_CM.tolist()
    named = "semicolons" if separator == ";" else "tabs"
    assert f"columns separated by {named}" in stem_map.understood
    assert ("decimals with commas" in stem_map.understood) == (mark == ",")
    assert "not used: 'Nummer'" in stem_map.understood


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ('id,x,y\n1,"125,019","179,443"\n', 2, "'125,019', whose comma may be a decimal mark or separate thousands"),
        ("id,x,y\n1,448.125,5.411.179\n", 2, "'448.125', whose point may be a decimal mark or separate thousands"),
        ("id,x,y,dbh\n1,448.125,5.411.179,21.1\n", 2, "use one, and write numbers without thousands separators"),
        ("id;x;y\n1;5.411.179.44;7\n", 2, "not a number: '5.411.179.44': write numbers without thousands"),
        ("id;x;y\n1;1,5;7,5\n2;1.5;7,5\n", 3, "line 2 has ',' as the decimal mark: use one"),
        ("x,y\n1_000,2\n", 2, "x: not a number: '1_000'"),
        ("x,y\n1,Infinity\n", 2, "not a finite number"),
        ("x,y\n1,2\n#3,4,5\n", 3, "a comment may only stand above the header"),
    ],
)
def test_numbers_that_could_mean_something_else_are_refused(tmp_path: Path, text: str, line: int, message: str) -> None:
    with pytest.raises(StemMapError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value)
    assert caught.value.line == line


def test_decimals_that_were_cut_at_the_comma_are_noticed(tmp_path: Path) -> None:
    """`x,y,dbh,h` with rows of 125,0 and 179,4: four fields, and each of them means something else."""
    text = table("x,y,dbh_cm,h", lambda i, x, y, d: f"{int(x) + 20},{i % 10},{int(y) + 20},{i % 7}")
    with pytest.raises(StemMapError, match="y has one digit in all 80 rows: commas of decimals"):
        read(tmp_path, text)
    grid = table("x,y", lambda i, x, y, d: f"{i % 10}.0,{i // 10}.0")
    assert len(read(tmp_path, grid)) == 80


# ---------------------------------------------------------------- columns


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("x_ft,y_m", "x and y are in ft and m: use one unit"),
        ("X_FT,Y_FT,x_cm", "two columns are called x_m or x: keep one"),
        ("lon,lat", "longitude and latitude are degrees: name them with --x and --y, their system with --crs"),
        ("x,y,easting,northing", "two pairs of positions, 'x', 'y' and 'easting', 'northing': name the one to read"),
        ("azimuth,dbh", "column x_m or x is missing"),
        ("x_m,y_m,x,y", "two columns are called x_m or x: keep one"),
        ("x,y,dbh_cm,dbh_mm", "'dbh_cm' and 'dbh_mm' are both diameters"),
        ("x,y,height,tree_height", "are both heights"),
        ("ost,nord", "column x_m or x is missing"),
    ],
)
def test_columns_that_mean_something_else_are_refused_by_name(tmp_path: Path, header: str, message: str) -> None:
    row = ",".join("1" for _ in header.split(","))
    with pytest.raises(StemMapError, match=r"stand\.csv:1: ") as caught:
        read(tmp_path, f"{header}\n{row}\n")
    assert message in str(caught.value)


def test_what_is_not_used_is_named_and_may_be_ignored(tmp_path: Path) -> None:
    text = table("x_m,y_m,x,y,Layer,id", lambda i, x, y, _: f"{x},{y},{x + 4e5},{y + 5e6},L,{i}")
    stem_map = read(tmp_path, text, ignore=("X", "y"))
    assert same_trees(stem_map)
    assert stem_map.understood == "read tree_id from 'id', x_m from 'x_m', y_m from 'y_m'; not used: 'x', 'y', 'Layer'"
    with pytest.raises(StemMapError, match="there is no column 'z', which --ignore names"):
        read(tmp_path, text, ignore=("z",))


@pytest.mark.parametrize("name", ["plot", "Plot_ID"])
def test_plots_in_coordinates_of_their_own_are_not_laid_on_each_other(tmp_path: Path, name: str) -> None:
    text = table(f"{name},tree,x,y", lambda i, x, y, _: f"P{i % 4},{i // 4},{x - 30},{y - 20}")
    with pytest.raises(StemMapError) as caught:
        read(tmp_path, text)
    for word in (f"the column '{name}' has 4 values whose trees overlap", f"--plot {name}", f"--ignore {name}"):
        assert word in str(caught.value)


def test_plots_of_one_frame_are_read_and_their_ids_told_apart(tmp_path: Path) -> None:
    text = table("plot,tree,x,y", lambda i, x, y, _: f"P{i % 4},{i // 4},{x + 100 * (i % 4)},{y}")
    stem_map = read(tmp_path, text)
    assert len(stem_map) == 80
    assert stem_map.ids[0] == "P1-0"
    assert "ids repeat between plots, so each begins with its 'plot'" in stem_map.understood
    one = table("plot,tree,x,y", lambda i, x, y, _: f"P1,{i},{x},{y}")
    assert read(tmp_path, one).ids[0] == "1"


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        ("plot,tree,x,y,azimuth,distance", "--azimuth and --distance"),
        ("plot,tree,x,y", "its own x_m and y_m"),
    ],
)
@pytest.mark.parametrize("plots", [1, 5])
def test_plot_centres_are_not_trees(tmp_path: Path, header: str, reason: str, plots: int) -> None:
    tail = ",115.3,14.1" if "azimuth" in header else ""
    text = table(header, lambda i, x, y, _: f"P{i % plots},{i // plots},{4e5 + 100 * (i % plots)},5e6{tail}")
    with pytest.raises(StemMapError) as caught:
        read(tmp_path, text)
    assert "plots' centres and not trees' positions" in str(caught.value)
    assert reason in str(caught.value)


def test_measurements_beside_positions_do_no_harm(tmp_path: Path) -> None:
    stem_map = read(tmp_path, table("tree,x,y,azimuth,distance", lambda i, x, y, _: f"{i},{x},{y},115.3,14.1"))
    assert same_trees(stem_map)
    assert "not used: 'azimuth', 'distance'" in stem_map.understood


# ---------------------------------------------------------------- diameters


@pytest.mark.parametrize(("unit", "factor"), [("cm", 1.0), ("mm", 10.0), ("m", 0.01), ("in", 1 / 2.54)])
def test_diameters_have_the_unit_of_their_name_or_of_the_option(tmp_path: Path, unit: str, factor: float) -> None:
    for header, options in ((f"dbh_{unit}", {}), ("DBH", {"dbh_unit": unit})):
        text = table(f"x,y,{header}", lambda i, x, y, d: f"{x},{y},{d}", factor)
        stem_map = read(tmp_path, text, **options)
        assert stem_map.dbh_cm is not None
        np.testing.assert_allclose(stem_map.dbh_cm, DBH_CM, rtol=1e-4)
        assert f"diameters in {unit} from '{header}'" in stem_map.understood
        assert "no unit" not in stem_map.understood
    with pytest.raises(StemMapError, match="but --dbh-unit says"):
        read(tmp_path, "x,y,dbh_cm\n1,2,30\n", dbh_unit="mm")


def test_a_diameter_without_unit_is_told_and_stops_where_it_cannot_be_centimetres(tmp_path: Path) -> None:
    stem_map = read(tmp_path, table("x,y,dbh", lambda i, x, y, d: f"{x},{y},{d}"))
    assert "diameters in cm from 'dbh', which names no unit" in stem_map.understood
    assert stem_map.dbh_cm is not None
    assert stem_map.dbh_cm.tolist() == DBH_CM.tolist()
    for factor in (10.0, 0.01):
        with pytest.raises(StemMapError, match=r"the median of the column 'dbh' is .*: give the unit"):
            read(tmp_path, table("x,y,dbh", lambda i, x, y, d: f"{x},{y},{d}", factor))
    for header, factor in (("dbh_m", 1.0), ("dbh_cm", 0.01), ("dbh_mm", 0.1)):
        with pytest.raises(StemMapError, match=f"the median of the column '{header}' is .*: give the unit"):
            read(tmp_path, table(f"x,y,{header}", lambda i, x, y, d: f"{x},{y},{d}", factor))


# ---------------------------------------------------------------- stems and tags


def test_stems_of_one_tree_are_one_tree_the_thickest(tmp_path: Path) -> None:
    rows = ["a,1,5,5,10.5", "b,1,9,9,", "a,2,5,5,31.0", "a,3,5.004,5,12", "b,2,9,9,8.5", "c,1,1,1,20"]
    stem_map = read(tmp_path, "tree_id,stem,x,y,dbh_cm\n" + "\n".join(rows) + "\n")
    assert stem_map.ids == ("a", "b", "c")
    assert stem_map.dbh_cm is not None
    assert stem_map.dbh_cm.tolist() == [31.0, 8.5, 20.0]
    assert "3 rows are further stems of a tree: the thickest stays" in stem_map.understood
    with pytest.raises(StemMapError, match=r"stand\.csv:3: tree id 'a' is used before, on line 2, 5 m away"):
        read(tmp_path, "id,x,y\na,1,2\na,4,6\n")


def test_trees_with_tags_of_their_own_at_one_place_are_the_thickest(tmp_path: Path) -> None:
    rows = ["a,5,5,10.5", "b,5,5,31.0", "c,5,5,", "d,1,1,20", "e,2,2,20", "f,3,3,20"]
    kept = without_twins(read(tmp_path, "tag,x,y,dbh_cm\n" + "\n".join(rows) + "\n"))
    assert kept.ids == ("b", "d", "e", "f")
    assert kept.dbh_cm is not None
    assert kept.dbh_cm.tolist() == [31.0, 20.0, 20.0, 20.0]
    assert without_twins(kept) is kept


def test_tags_are_text(tmp_path: Path) -> None:
    tags = ["0012", "12", "1.0", "1", "1E+05", "12A"]
    rows = [f"{tag},{i},{i}" for i, tag in enumerate(tags)]
    assert read(tmp_path, "treeID,x,y\n" + "\n".join(rows) + "\n").ids == tuple(tags)


# ---------------------------------------------------------------- through the command line


def test_the_commands_tell_what_they_understood(urquhart: Urquhart, tmp_path: Path) -> None:
    (tmp_path / "stand.csv").write_text(table("tag,x,y,dbh,note", lambda i, x, y, d: f"#{i},{x},{y},{d * 10},n"))
    refused(urquhart("index", "stand.csv", *INDEX), "--dbh-unit")
    said = urquhart("index", "stand.csv", *INDEX, "--dbh-unit", "mm")
    assert said.code == 0
    assert "stand: read tree_id from 'tag', x_m from 'x', y_m from 'y', diameters in mm from 'dbh'" in said.out
    assert "not used: 'note'" in said.out
    assert "stand: 80 trees -> " in said.out
    found = urquhart("locate", "stand.csv", "--collection", "c", "--dbh-unit", "mm", "--ignore", "note")
    assert found.code == 0
    assert "stand.csv: read tree_id from 'tag'" in found.out
