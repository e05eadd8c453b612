"""A tiny version of what `make bench-scale` measures: a forest in tiles, a database, its answers, the page."""

import copy
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from numpy.typing import NDArray

from benchmarks import record
from benchmarks.markdown import FOLDER
from benchmarks.scale import __main__ as command
from benchmarks.scale.asking import is_right, summarize
from benchmarks.scale.charts import PICTURES, short
from benchmarks.scale.measurement import Measurement, memory, seconds_alive, spread
from benchmarks.scale.measurement_plan import COMPARED, PARTS, RIVALS, SIZES, asked
from benchmarks.scale.observations import Observations, join, write
from benchmarks.scale.report import slope, write_report
from benchmarks.scale.requirements import ASKED_OF, CAUSES, REQUIREMENTS, look, resident
from benchmarks.scale.rivals.quads import RADIUS
from benchmarks.scale.rivals.rival import TOLERANCE, Described
from benchmarks.scale.rivals.triangles import TriangleRival, sorted_triangles
from benchmarks.scale.tiled_forest import (
    GOOD,
    KINDS,
    MARGIN,
    PLAIN,
    SPACING,
    World,
    dense_stand,
    grid_shape,
    questions_of,
)
from benchmarks.scale.tiled_forest import RADIUS as RANGE
from benchmarks.scale.worker import run_alone, run_here
from urquhart import SE2, Config, describe

ROOT = Path(__file__).parents[2]
SEED = 5
TINY = 25


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A size of `TINY` submaps measured whole: the forest by a process of its own, the rest here."""
    folder = tmp_path_factory.mktemp("scale")

    def run(measurement: Measurement) -> dict[str, Any]:
        return run_alone(measurement) if measurement.part.endswith("simulate") else run_here(measurement)

    command.measure(TINY, folder, quick=True, seed=SEED, workers=1, run=run)
    return folder


@pytest.fixture(scope="module")
def figures(room: Path) -> dict[str, Any]:
    """The JSON of that size."""
    parts = {name: record.read(room / f"{name}.json") for name in PARTS if (room / f"{name}.json").exists()}
    command.keep(room, TINY, parts, {"command": "python -m benchmarks.scale", "seed": SEED})
    return record.read(room / FOLDER / "scale.json")


# ------------------------------------------------------------------ the world


def points(measurement: tuple[int, float, tuple[int, ...]]) -> list[NDArray[np.float64]]:
    """Submaps of a world of 400, asked for in an order of the caller's."""
    seed, tile, indices = measurement
    world = World(400, seed, tile=tile)
    return [world.submap(index).xy for index in indices]


def test_a_submap_is_the_same_whichever_process_makes_it_and_when() -> None:
    # With tiles of 130 m seams go through most of them.
    order = (399, 21, 0, 210, 57)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        first, second = pool.map(points, [(SEED, 130.0, order), (SEED, 130.0, order[::-1])])
    here = World(400, SEED, tile=130.0)
    for index, one, other in zip(order, first, reversed(second), strict=True):
        assert np.array_equal(one, other)
        assert np.array_equal(one, here.submap(index).xy)
    assert not np.array_equal(first[0], World(400, SEED + 1, tile=130.0).submap(order[0]).xy)


def test_trees_go_on_across_the_seams() -> None:
    world = World(400, SEED, tile=130.0)
    x, y = 260.0, 390.0  # the corner of four tiles
    trees = world.trees_near(x, y) - (x, y)
    near = trees[np.hypot(*trees.T) < RANGE]
    quarters = [np.all((near > 0) == side, axis=1).sum() for side in ((0, 0), (0, 1), (1, 0), (1, 1))]
    assert 80 <= len(near) <= 130
    assert min(quarters) > 15
    # What is seen from both sides of a seam are the same trees.
    views = [world.trees_near(x + east, y) for east in (-30.0, 30.0)]
    both = [
        view[np.all([np.hypot(*(view - (x + east, y)).T) < RANGE for east in (-30.0, 30.0)], axis=0)] for view in views
    ]
    assert len(both[0]) > 20
    assert {tuple(tree) for tree in both[0].tolist()} == {tuple(tree) for tree in both[1].tolist()}


def test_queries_are_from_inside_the_grid_and_submaps_noisy() -> None:
    world = World(TINY, SEED)
    poses = np.array([world.query("inside-20", k).pose for k in range(200)], dtype=object)
    x, y = np.array([(pose.x, pose.y) for pose in poses]).T
    assert x.min() >= MARGIN and x.max() <= MARGIN + world.sides[0]
    assert np.ptp(x) > 0.9 * world.sides[0] and np.ptp(y) > 0.9 * world.sides[1]
    seen = world.submap(12)
    trees = world.trees_near(seen.pose.x, seen.pose.y) - (seen.pose.x, seen.pose.y)
    within = trees[np.hypot(*trees.T) <= RANGE]
    c, s = np.cos(seen.pose.yaw), np.sin(seen.pose.yaw)
    placed = seen.xy @ np.array([[c, s], [-s, c]])
    off = np.hypot(*(placed[:, None] - within[None]).transpose(2, 0, 1)).min(axis=1)
    assert 0.8 * len(within) < len(placed) < len(within)
    assert 0.5 * GOOD.sigma < np.sqrt(0.5 * np.mean(off**2)) < 1.5 * GOOD.sigma
    assert not np.array_equal(world.query("outside-20", 0).xy[:5], world.query("inside-20", 0).xy[:5])


@pytest.mark.parametrize(("submaps", "shape"), [(25, (5, 5)), (1_000, (25, 40)), (100_000, (250, 400)), (7, (1, 7))])
def test_the_grid_holds_exactly_so_many(submaps: int, shape: tuple[int, int]) -> None:
    assert grid_shape(submaps) == shape
    world = World(submaps, SEED)
    for index in (0, submaps // 2, submaps - 1):
        row, column = divmod(index, shape[1])
        assert world.nearest(MARGIN + SPACING * column + 20.0, MARGIN + SPACING * row - 20.0) == index


def test_dense_stands_have_300_to_2000_trees_a_hectare_and_no_heaps() -> None:
    counts = []
    for seed in range(20):
        trees = dense_stand(np.random.default_rng(seed), 50.0)
        apart = np.hypot(*(trees[:, None] - trees).transpose(2, 0, 1)) + np.diag(np.full(len(trees), np.inf))
        counts.append(len(trees) / 0.25)
        assert apart.min() > 0.2 * np.sqrt(1e4 / counts[-1])
    assert 250.0 < min(counts) < 500.0 and 1_200.0 < max(counts) < 2_200.0


def test_full_effort_is_asked_the_same_as_fast() -> None:
    assert {questions_of(name) for name in KINDS} <= KINDS.keys()
    for name, kind in KINDS.items():
        assert KINDS[questions_of(name)] == kind._replace(effort="fast")


def test_observations_are_read_as_they_were_written(tmp_path: Path) -> None:
    world = World(TINY, SEED)
    seen = [world.submap(index) for index in range(7)]
    write(tmp_path, "a", seen[:3])
    write(tmp_path, "b", seen[3:])
    join(tmp_path, "whole", ["a", "b"])
    read = Observations.load(tmp_path, "whole")
    assert len(read) == 7
    for index, one in enumerate(seen):
        assert np.array_equal(read.xy(index), one.xy)
        assert read.pose(index).distance(one.pose) == (0.0, 0.0)
    assert read.xy(0).flags.writeable
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "whole-offsets.npy",
        "whole-points.npy",
        "whole-poses.npy",
    ]


# ------------------------------------------------------------------ end to end


def test_a_small_database_finds_what_is_in_it_and_nothing_else(figures: dict[str, Any]) -> None:
    parts = figures["sizes"][str(TINY)]["parts"]
    assert set(parts) == set(PARTS) - {"compile"}
    for name, kind in KINDS.items():
        assert parts[name]["asked"] == asked(name, TINY, quick=True)
        assert (parts[name]["wrong"], parts[name]["false"], parts[name]["mistaken"]) == (0, 0, [])
        assert parts[name]["milliseconds"]["p50"] <= parts[name]["milliseconds"]["p95"]
        assert parts[name]["stages"]["describe"] > 0.0
        assert parts[name]["memory"]["resident"] >= parts[name]["memory"]["own"] > 0.0
        if kind.inside:
            assert parts[name]["recall"] >= 0.95
    ingest = parts["ingest"]
    whole = ingest["durable_seconds"] + ingest["searchable_seconds"]
    assert ingest["submaps_per_second"] == pytest.approx(TINY / whole, rel=1e-3)
    assert ingest["database_bytes"] > 1_000
    steps = ("open_seconds", "index_seconds", "first_query_seconds")
    assert sum(parts["start"][step] for step in steps) == pytest.approx(parts["start"]["ready_seconds"], rel=1e-3)
    assert parts["http"]["differing"] == 0
    assert parts["http"]["http"]["p50"] > parts["http"]["empty"]["p50"] > 0.0
    assert all(
        part["spent_seconds"] > 0.0 and 0.0 <= part["others"] <= (os.cpu_count() or 1) for part in parts.values()
    )
    assert parts["threads"]["speedup"] > 0.0


@pytest.mark.parametrize("name", RIVALS)
def test_rivals_find_places_among_few(figures: dict[str, Any], name: str) -> None:
    found = figures["sizes"][str(TINY)]["parts"][name]
    for kind, least in (("inside-20", 0.95), ("inside-40", 0.7)):
        assert found["kinds"][kind]["recall"] >= least
        assert found["kinds"][kind]["listed"] >= least
    assert found["bytes"] > 0.0 or name == "rival-exhaustive"


def test_what_was_measured_is_not_measured_again(room: Path) -> None:
    ran: list[str] = []

    def run(measurement: Measurement) -> dict[str, Any]:
        ran.append(measurement.part)
        return {"submaps": 1.0}

    before = {name: (room / f"{name}.json").read_bytes() for name in PARTS if (room / f"{name}.json").exists()}
    try:
        command.measure(TINY, room, quick=True, seed=SEED, workers=1, run=run)
        assert ran == []
        (room / "ingest.json").unlink()
        command.measure(TINY, room, quick=True, seed=SEED, workers=1, run=run)
        # All that needs the database is made again, what needs the submaps alone is not.
        assert ran == [name for name, part in PARTS.items() if "ingest" in (name, *part.after) and name != "compile"]
    finally:
        for name, content in before.items():
            (room / f"{name}.json").write_bytes(content)


def test_a_part_that_fails_stops_the_run(tmp_path: Path) -> None:
    def run(measurement: Measurement) -> dict[str, Any]:
        raise OSError(f"no room for {measurement.part}")

    with pytest.raises(OSError, match="no room for simulate"):
        command.measure(TINY, tmp_path, quick=True, seed=SEED, workers=1, run=run)
    assert not (tmp_path / "simulate.json").exists()


def test_unknown_parts_are_refused() -> None:
    with pytest.raises(typer.BadParameter, match="simulat"):
        command.main(again=["simulat"])


# ---------------------------------------------------------------- what is told


def row(number: int, verdict: str, *, right: bool, milliseconds: float = 2.0, **stages: float) -> dict[str, Any]:
    return {
        "number": number,
        "milliseconds": milliseconds,
        "verdict": verdict,
        "right": right,
        "submap": 3,
        "confidence": 0.9995,
        "stages": stages,
    }


def test_answers_are_counted_by_what_they_are_worth() -> None:
    rows = [
        row(0, "matched", right=True, describe=1.0),
        row(1, "matched", right=False, describe=3.0, exhaustive=40.0),
        row(2, "ambiguous", right=True, describe=2.0),
        row(3, "no_match", right=False, milliseconds=9.0, describe=2.0),
    ]
    inside = summarize(rows, inside=True)
    assert (inside["recall"], inside["matched_right"], inside["wrong"], inside["false"]) == (0.5, 1, 1, 0)
    assert (inside["ambiguous"], inside["no_match"]) == (1, 1)
    assert inside["mistaken"] == [[1, 3, 0.9995]]
    assert inside["stages"] == {"describe": 2.0, "exhaustive": 40.0}
    assert inside["reached"] == {"describe": 1.0, "exhaustive": 0.25}
    outside = summarize([one | {"right": False} for one in rows], inside=False)
    assert (outside["recall"], outside["wrong"], outside["false"]) == (None, 0, 2)


def test_a_pose_is_right_within_a_metre_and_three_degrees() -> None:
    submap, truth = SE2(100.0, 200.0, 2.0), SE2(120.0, 190.0, -1.0)
    found = submap.inverse() @ truth
    assert is_right(submap, found, truth)
    assert is_right(submap, found, SE2(120.9, 190.0, -1.05))
    assert not is_right(submap, found, SE2(121.1, 190.0, -1.0))
    assert not is_right(submap, found, SE2(120.0, 190.0, -1.06))


def test_medians_of_runs_and_tails_of_times() -> None:
    runs = [{"a": value, "b": {"c": 10.0 * value}} for value in (3.0, 1.0, 2.0)]
    assert command.middle(runs) == {"a": 2.0, "b": {"c": 20.0}}
    assert spread([float(k) for k in range(101)]) == {"p50": 50.0, "p95": 95.0, "p99": 99.0}


def test_memory_and_age_are_this_process() -> None:
    ballast = np.ones(20_000_000)
    now = memory()
    assert now["own"] >= ballast.nbytes / 1e6
    assert now["resident"] == pytest.approx(now["own"] + now["files"], rel=0.05)
    assert 0.0 < seconds_alive() < os.times().elapsed


def test_sizes_and_queries_of_a_run() -> None:
    assert command.sizes(1_000_000, quick=False) == list(SIZES)
    assert command.sizes(99_999, quick=False) == [1_000, 10_000]
    assert command.sizes(1_000_000, quick=True) == [1_000, 10_000]
    assert command.sizes(25, quick=False) == [25]
    assert asked("outside-20", 100_000, quick=False) == 10_000
    assert asked("outside-20", 1_000_000, quick=False) == 1_000
    assert asked("inside-40", 1_000_000, quick=False) == 500
    assert [short(size) for size in (25, *SIZES)] == ["25", "1k", "10k", "100k", "1M"]
    assert all(count <= asked("inside-20", SIZES[-1], quick=False) for count in COMPARED)


def test_requirements_know_which_way_is_better(figures: dict[str, Any]) -> None:
    parts = copy.deepcopy(figures["sizes"][str(TINY)]["parts"])
    by_name = {requirement.name: requirement for requirement in REQUIREMENTS}
    assert {name for name, _ in CAUSES} <= set(by_name)
    recall, false = by_name["recall@1, 20 cm, 90 %"], by_name["false matches, 20 cm, 90 %"]
    memory_used, disk = by_name["resident memory"], by_name["index on disk, a submap"]
    assert recall.met(parts, ASKED_OF[0]) and false.met(parts, ASKED_OF[1]) and memory_used.met(parts, ASKED_OF[1])
    assert disk.met({"ingest": {"index_bytes": None}}, ASKED_OF[0]) is None
    assert disk.met({"ingest": {"index_bytes": 3_100.0}}, ASKED_OF[0]) is False
    assert all(requirement.met({}, ASKED_OF[0]) is None for requirement in REQUIREMENTS)
    parts["inside-20"]["recall"], parts["outside-20"]["false"] = 0.98, 1
    parts["outside-40"]["memory"]["resident"] = 5_100.0
    assert recall.met(parts, ASKED_OF[0]) is False and false.met(parts, ASKED_OF[1]) is False
    assert memory_used.met(parts, ASKED_OF[1]) is False and resident(parts) == pytest.approx(5.1)
    assert look("inside-20", "no", "such")(parts) is None
    page = write_report(figures | {"sizes": {str(ASKED_OF[0]): figures["sizes"][str(TINY)] | {"parts": parts}}})
    assert "**no**" in page and f"- {recall.name}, 100k" in page


def test_the_slope_is_the_exponent_of_growth(figures: dict[str, Any]) -> None:
    sizes = {}
    for size in (1_000, 10_000, 100_000):
        one = copy.deepcopy(figures["sizes"][str(TINY)])
        one["parts"]["inside-20"]["milliseconds"]["p50"] = 0.01 * size**0.5
        sizes[str(size)] = one
    grown = figures | {"sizes": sizes}
    assert slope(grown, look("inside-20", "milliseconds", "p50")) == pytest.approx(0.5)
    assert slope(figures, look("inside-20", "milliseconds", "p50")) is None
    assert "### How steeply" in write_report(grown)
    assert "### How steeply" not in write_report(figures)


def test_the_page_says_when_the_machine_was_busy(figures: dict[str, Any]) -> None:
    other = copy.deepcopy(figures)
    for part in other["sizes"][str(TINY)]["parts"].values():
        part["others"] = 0.0
    assert "did other work" not in write_report(other)
    other["sizes"][str(TINY)]["parts"]["http"]["others"] = 1.25
    assert "other work during 1 of" in " ".join(write_report(other).split())


def test_figures_of_other_sizes_stay(tmp_path: Path, figures: dict[str, Any]) -> None:
    parts = figures["sizes"][str(TINY)]["parts"]
    head = {"command": "python -m benchmarks.scale", "seed": SEED}
    for size in (1_000, TINY):
        command.keep(tmp_path, size, parts, head)
    found = record.read(tmp_path / FOLDER / "scale.json")
    assert list(found["sizes"]) == [str(TINY), "1000"]
    page = command.write_page(tmp_path)
    assert page.read_text(encoding="utf-8") == write_report(found)
    assert all((tmp_path / FOLDER / f"{name}.svg").stat().st_size > 1_000 for name in PICTURES)


# ------------------------------------------------------------------- rivals


def test_the_ball_of_a_range_search_has_the_volume_of_the_box() -> None:
    rng = np.random.default_rng(0)
    inside = np.linalg.norm(rng.uniform(-RADIUS, RADIUS, (400_000, 5)), axis=1) < RADIUS
    assert inside.mean() * (2.0 * RADIUS) ** 5 == pytest.approx((2.0 * TOLERANCE) ** 5, rel=0.02)


def test_triangles_are_the_same_turned_and_not_mirrored() -> None:
    rng = np.random.default_rng(1)
    xy = rng.uniform(-30.0, 30.0, (40, 2))
    features = describe(xy, Config())
    sides, corners = sorted_triangles(features.landmarks, features.tessellation.triangles)
    assert np.all(np.diff(np.abs(sides), axis=1) >= 0.0)
    opposite = features.landmarks[corners]
    lengths = np.linalg.norm(np.roll(opposite, -1, axis=1) - np.roll(opposite, -2, axis=1), axis=2)
    assert np.allclose(np.abs(sides), lengths, rtol=1e-5)
    assert 0.2 < (sides[:, 0] < 0.0).mean() < 0.8
    rival = TriangleRival()
    for points_of in (rng.uniform(-30.0, 30.0, (40, 2)), xy, xy * [1.0, -1.0]):
        rival.add(describe(points_of, Config()))
    rival.build()
    turned = SE2(7.0, -3.0, 2.2).apply(xy)
    query = Described.of(describe(turned, Config()))
    ranking = rival.rank(query, 2)
    assert ranking.submaps[0] == 1
    poses = rival.poses(query, ranking, 0, Described.of(features))
    moved = SE2(*poses[0].tolist()).apply(query.features.landmarks)
    assert np.abs(moved[:, None] - features.landmarks[None]).sum(axis=2).min(axis=1).max() < 1e-3


# ------------------------------------------------------------------ published


def test_the_published_page_is_written_from_the_published_figures() -> None:
    assert (ROOT / "docs" / command.PAGE).read_text(encoding="utf-8") == command.page_of(ROOT / "docs")
    assert all((ROOT / "docs" / FOLDER / f"{name}.svg").exists() for name in PICTURES)


def test_nothing_published_is_matched_and_wrong() -> None:
    published = record.read(ROOT / "docs" / FOLDER / "scale.json")
    assert {"1000", "10000", "100000", "1000000"} <= set(published["sizes"])
    for one in published["sizes"].values():
        for name in KINDS.keys() & one["parts"].keys():
            assert (one["parts"][name]["wrong"], one["parts"][name]["false"]) == (0, 0)
        assert set(PLAIN) <= one["parts"].keys()
        assert one["parts"]["http"]["differing"] == 0
