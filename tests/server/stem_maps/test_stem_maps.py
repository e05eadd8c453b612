"""Stem maps as files, and how they are cut into discs."""

import contextlib
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from server.config.settings import Limits
from server.schemas.common import check_id
from server.stem_maps.plots import cut_plots, keep_whole
from server.stem_maps.reader import StemMap, StemMapError, read_stem_map
from server.stem_maps.stands import StandError, cut_stand, lines_of
from server.stem_maps.tiling import MERGE_DISTANCE, MINIMUM_TREES, CuttingError, cut, merge
from server.submaps.described_batches import read_line

STEM_MAPS = Path(__file__).parents[3] / "data" / "stem_maps"


def write(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


# ---------------------------------------------------------------- reading


@pytest.mark.parametrize(
    ("name", "trees", "width", "height"),
    [("longleaf", 584, 200.0, 200.0), ("lansing", 2251, 924 * 0.3048, 924 * 0.3048), ("bei", 3604, 1000.0, 500.0)],
)
def test_the_shipped_maps_are_what_their_readme_says(name: str, trees: int, width: float, height: float) -> None:
    stem_map = read_stem_map(STEM_MAPS / f"{name}.csv")
    assert (stem_map.name, len(stem_map)) == (name, trees)
    assert stem_map.ids[0] == "1"
    assert stem_map.xy.min() >= 0.0
    assert (stem_map.xy.max(axis=0) <= (width + 1e-3, height + 1e-3)).all()
    assert (np.ptp(stem_map.xy, axis=0) > 0.98 * np.array([width, height])).all()
    assert (stem_map.dbh_cm is not None) == (name == "longleaf")
    assert (stem_map.species is not None) == (name == "lansing")
    duplicates = len(stem_map) - len(merge(stem_map.xy))
    assert duplicates == (1 if name == "lansing" else 0)


def test_columns_go_by_name_in_any_order_and_case(tmp_path: Path) -> None:
    text = "\ufeff# plot 7\nSpecies, Y , note,ID,X,dbh,height_m\n\nfir, 2.5 ,a,t1,1e1,30.5,\n,-1,b,t2,.5,,12\n"
    stem_map = read_stem_map(write(tmp_path / "plot_7.csv", text))
    assert stem_map.name == "plot_7"
    assert stem_map.ids == ("t1", "t2")
    assert stem_map.xy.tolist() == [[10.0, 2.5], [0.5, -1.0]]
    assert stem_map.species == ("fir", "")
    assert stem_map.dbh_cm is not None
    assert stem_map.height_m is not None
    np.testing.assert_equal(stem_map.dbh_cm, [30.5, np.nan])
    np.testing.assert_equal(stem_map.height_m, [np.nan, 12.0])


def test_trees_without_ids_are_numbered(tmp_path: Path) -> None:
    stem_map = read_stem_map(write(tmp_path / "a.csv", "x,y\r\n0,0\r\n1,2\r\n"))
    assert stem_map.ids == ("1", "2")
    assert (stem_map.dbh_cm, stem_map.height_m, stem_map.species) == (None, None, None)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", None, "the file is empty"),
        ("\n\n# nothing\n", None, "the file is empty"),
        ("x_m,y_m\n", None, "has a header but no trees"),
        (
            "x_m,z_m\n1,2\n",
            1,
            "y_m or y is missing: the header must name x_m and y_m, or --x and --y must name the columns, and it names",
        ),
        (f"{','.join('abcdefghij')}\n", 1, "it names 'a', 'b', 'c', 'd', 'e', 'f', 'g', 'h' and 2 more"),
        ("# c\n\nxy\n1 2\n", 3, "separated by commas, semicolons, tabs or spaces"),
        ("x,x_m,y\n1,1,2\n", 1, "two columns are called x_m or x"),
        ("id,tree_id,x,y\n1,1,1,2\n", 1, "two columns are called tree_id or id"),
        ("x,y\n1,2\n1,2,3\n", 3, "3 fields where the header has 2"),
        ("x,y\n1,2\n1\n", 3, "1 fields where the header has 2"),
        ("x,y\n1,2\n# c\n1,3\n", 3, "1 fields where the header has 2: a comment may only stand above the header"),
        ("x,y\n1,oak\n", 2, "y: not a number: 'oak'"),
        ("x,y\n1,\n", 2, "y: has no value"),
        ("x,y\n1_000,2\n", 2, "x: not a number: '1_000'"),
        ("x,y\n1,nan\n", 2, "y: has no value"),
        ("x,y\n-inf,2\n", 2, "x: not a finite number: '-inf'"),
        ("x,y\n1e300,2\n", 2, "coordinates must be in metres"),
        ("x,y,dbh\n1,2,-3\n", 2, "dbh: must be more than 0, or empty: -3"),
        ("x,y,height_m\n1,2,inf\n", 2, "height_m: not a finite number"),
        ("id,x,y\na,1,2\n,3,4\n", 3, "the tree's id is empty"),
        ("id,x,y\na,1,2\nb,2,2\na,3,4\n", 4, "tree id 'a' is used before, on line 2"),
        ('x,y\n"1,2\n', 2, "is not comma-separated text"),
        (b"x,y\n1,2\n\xff,3\n", 3, "x: not a number: '\u00ff'"),
        (b"x,y\n1,\x002\n", 2, "is no text: it holds NUL characters"),
        (f"x,y\n1,{'9' * 200_000}\n", 2, "field larger than field limit"),
        (f"x,y\n1,{'o' * 100}\n", 2, "..."),
    ],
)
def test_a_bad_file_is_one_line_that_says_where(
    tmp_path: Path, text: str | bytes, line: int | None, message: str
) -> None:
    path = write(tmp_path / "bad.csv", text)
    with pytest.raises(StemMapError) as caught:
        read_stem_map(path)
    said = str(caught.value)
    assert said.startswith(f"{path}: " if line is None else f"{path}:{line}: ")
    assert message in said
    assert "\n" not in said
    assert len(said) < 300 + len(str(path))
    assert caught.value.line == line


def test_files_that_cannot_be_opened_are_named(tmp_path: Path) -> None:
    with pytest.raises(StemMapError, match=r"none\.csv: no such file$"):
        read_stem_map(tmp_path / "none.csv")
    with pytest.raises(StemMapError, match="is a directory"):
        read_stem_map(tmp_path)
    with pytest.raises(StemMapError, match="cannot be read"):
        read_stem_map(tmp_path / ("n" * 300))


def test_an_observation_may_be_empty(tmp_path: Path) -> None:
    observation = read_stem_map(write(tmp_path / "o.csv", "x,y\n"), allow_empty=True)
    assert observation.xy.shape == (0, 2)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(b"x,y\n" + data)
    with contextlib.suppress(StemMapError):
        stem_map = read_stem_map(path, allow_empty=True)
        assert stem_map.xy.shape == (len(stem_map), 2)
        assert np.isfinite(stem_map.xy).all()


# ---------------------------------------------------------------- cutting


def stand(xy: ArrayLike, name: str = "stand") -> StemMap:
    points = np.asarray(xy, dtype=np.float64)
    return StemMap(name, tuple(str(i + 1) for i in range(len(points))), points)


def test_discs_hold_exactly_the_trees_within_the_radius(tmp_path: Path) -> None:
    stem_map = read_stem_map(STEM_MAPS / "lansing.csv")
    result = cut(stem_map, 30.0, 20.0)
    assert (result.trees, result.merged, result.uncovered) == (2251, 1, 0)
    assert len(result.discs) + result.skipped == result.columns * result.rows
    kept = merge(stem_map.xy)
    for disc in result.discs:
        np.testing.assert_allclose(disc.xy + disc.centre, stem_map.xy[disc.tree_indices], atol=1e-9)
        inside = kept[np.hypot(*(stem_map.xy[kept] - disc.centre).T) <= 30.0]
        assert disc.tree_indices.tolist() == inside.tolist()
    assert len({disc.submap_id for disc in result.discs}) == len(result.discs)
    assert result.discs[0].submap_id == "lansing-00-00"
    for disc in result.discs:
        check_id(disc.submap_id)


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(20, 200),
    st.floats(5.0, 200.0),
    st.floats(1.0, 60.0),
    st.floats(0.72, 3.0),
    st.floats(-1e7, 1e7),
)
def test_every_tree_is_in_reach_of_the_grid(
    seed: int, count: int, side: float, spacing: float, ratio: float, offset: float
) -> None:
    rng = np.random.default_rng(seed)
    stem_map = stand(offset + rng.uniform(0.0, side, (count, 2)))
    result = cut(stem_map, ratio * spacing, spacing, minimum_trees=1)  # 0.72 > 1 / sqrt(2)
    assert result.uncovered == 0
    low, high = stem_map.xy.min(axis=0), stem_map.xy.max(axis=0)
    for disc in result.discs:
        assert (np.array(disc.centre) >= low - 1e-6).all()
        assert (np.array(disc.centre) <= high + 1e-6).all()
        assert (np.hypot(*disc.xy.T) <= ratio * spacing + 1e-6).all()


def test_discs_with_too_few_trees_are_counted() -> None:
    rng = np.random.default_rng(1)
    crowd = rng.uniform(0.0, 10.0, (50, 2))
    lone = [(100.0, 5.0), (103.0, 5.0)]
    result = cut(stand(np.concatenate([crowd, lone])), 10.0, 10.0)
    assert result.discs
    assert all(len(disc.xy) >= MINIMUM_TREES for disc in result.discs)
    assert result.skipped == result.columns * result.rows - len(result.discs) > 0
    assert result.uncovered == 2


def test_close_trees_are_merged_into_the_first_and_counted() -> None:
    near = MERGE_DISTANCE / 2
    #        0           1 gives way   2 near 1 only: stays   3           4 gives way to 3
    points = [(0.0, 0.0), (near, 0.0), (near * 2.5, 0.0), (5.0, 5.0), (5.0, 5.0)]
    assert merge(np.array(points)).tolist() == [0, 2, 3]
    result = cut(stand(points), 10.0, 10.0, minimum_trees=1)
    assert result.merged == 2
    assert result.discs[0].tree_indices.tolist() == [0, 2, 3]


def test_grid_numbers_are_padded_so_that_ids_sort() -> None:
    rng = np.random.default_rng(2)
    result = cut(stand(rng.uniform(0, (300.0, 30.0), (3000, 2))), 5.0, 2.5, minimum_trees=1)
    ids = [disc.submap_id for disc in result.discs]
    assert ids == sorted(ids)
    assert ids[0] == "stand-000-00"


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_radius_and_spacing_are_positive_numbers(value: float) -> None:
    with pytest.raises(CuttingError, match="the radius must be a positive number"):
        cut(stand([(0, 0), (1, 1)]), value, 10.0)
    with pytest.raises(CuttingError, match="the spacing must be a positive number"):
        cut(stand([(0, 0), (1, 1)]), 10.0, value)


def test_cuts_that_make_no_sense_say_what_to_change() -> None:
    rng = np.random.default_rng(3)
    crowd = rng.uniform(0.0, 10.0, (50, 2))
    with pytest.raises(CuttingError, match="make the radius larger"):
        cut(stand(crowd), 0.1, 1.0)
    with pytest.raises(CuttingError, match="the stem map has 2 trees, and a submap needs at least 10"):
        cut(stand(crowd[:2]), 30.0, 1.0)
    with pytest.raises(CuttingError, match=r"has 9 trees \(18 before stems within 1 cm were merged\)"):
        cut(stand(np.repeat(crowd[:9], 2, axis=0)), 30.0, 1.0)
    with pytest.raises(CuttingError, match="make the radius smaller"):
        cut(stand(crowd), 100.0, 1.0, maximum_trees=49)
    with pytest.raises(CuttingError, match="a tree far outside the stand"):
        cut(stand(np.concatenate([crowd, [(1e8, 1e8)]])), 30.0, 1e-6)
    with pytest.raises(CuttingError, match="makes 1002001 submaps"):
        cut(stand([(0.0, 0.0), (1000.0, 1000.0)]), 30.0, 1.0)


def test_a_single_point_is_one_disc() -> None:
    result = cut(stand([(3.0, 4.0)]), 1.0, 1.0, minimum_trees=1)
    assert [(disc.submap_id, disc.centre) for disc in result.discs] == [("stand-0-0", (3.0, 4.0))]


# ---------------------------------------------------------------- submaps


def test_discs_become_submaps_with_their_pose_and_what_is_known(tmp_path: Path) -> None:
    text = "tree_id,x_m,y_m,dbh_cm,height_m,species\n" + "".join(
        f"t{i},{i},{i * i % 7},{'' if i % 2 else 30 + i},{'' if i % 3 else 12.5},{'fir' if i % 2 else ''}\n"
        for i in range(12)
    )
    stem_map = read_stem_map(write(tmp_path / "plot.csv", text))
    stand_cut = cut_stand(stem_map, 100.0, 50.0, Limits())
    (line,) = lines_of(stem_map, stand_cut)
    submap = read_line(line, Limits())
    assert submap.id == submap.frame_id == "plot-0-0"
    assert submap.map_pose is not None
    assert (submap.map_pose.frame_id, submap.map_pose.yaw) == ("plot", 0.0)
    np.testing.assert_allclose(submap.positions() + (submap.map_pose.x, submap.map_pose.y), stem_map.xy, atol=1e-9)
    assert submap.landmark_ids() == [f"t{i}" for i in range(12)]
    assert submap.attributes() == {
        "dbh_cm": [30.0 + i if i % 2 == 0 else None for i in range(12)],
        "height_m": [12.5 if i % 3 == 0 else None for i in range(12)],
        "species": ["fir" if i % 2 else None for i in range(12)],
    }


def test_names_that_a_submap_cannot_have_are_refused() -> None:
    points = np.random.default_rng(4).uniform(0, 10, (20, 2))
    with pytest.raises(StandError, match="rename it"):
        cut_stand(stand(points, name="plot 7"), 30.0, 30.0, Limits())
    stem_map = StemMap("plot", ("a" * 200, *(str(i) for i in range(19))), points)
    with pytest.raises(StandError, match="plot: tree value 'aaa"):
        list(lines_of(stem_map, cut_stand(stem_map, 30.0, 30.0, Limits())))


def test_a_whole_map_has_a_limit_of_trees_and_a_radius_is_a_number() -> None:
    trees = StemMap("big", tuple(map(str, range(30))), np.random.default_rng(2).uniform(0.0, 50.0, (30, 2)))
    with pytest.raises(CuttingError, match="'big' has 30 trees, more than the 20 that a submap may have"):
        keep_whole(trees, maximum_trees=20)
    with pytest.raises(CuttingError, match="the radius must be a positive number of metres, not inf"):
        cut_plots(replace(trees, plots=("1",) * 30), float("inf"), 10.0)
