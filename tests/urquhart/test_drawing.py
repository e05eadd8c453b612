import re
import tracemalloc
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from tests.urquhart import forests
from urquhart import (
    SE2,
    Abandoned,
    Budget,
    Candidate,
    Config,
    Recognizer,
    describe,
    draw_match,
    draw_motion,
    draw_tessellation,
)
from urquhart.budget import DeadlinePassed
from urquhart.report.match import covered
from urquhart.report.svg import MOST

SVG = "{http://www.w3.org/2000/svg}"


def count(svg: str, tag: str, style: str) -> int:
    return sum(1 for element in ET.fromstring(svg).iter(SVG + tag) if element.get("class") == style)


def test_a_tessellation_shows_every_landmark_triangle_and_polygon() -> None:
    features = describe(forests.uniform(np.random.default_rng(0)), Config())
    svg = draw_tessellation(features, title="plot <7> & more")
    assert count(svg, "circle", "tree") == len(features.landmarks)
    assert count(svg, "polygon", "triangle") == len(features.tessellation.triangles)
    assert count(svg, "polygon", "polygon") == len(features.tessellation)
    assert "plot &lt;7&gt; &amp; more" in svg


def test_a_match_joins_its_inliers_and_crosses_its_misses() -> None:
    rng = np.random.default_rng(1)
    xy = forests.uniform(rng)
    recognizer = Recognizer(Config())
    recognizer.add([(1, describe(xy, Config()))])
    seen = SE2(3.0, 4.0, 1.0).inverse().apply(xy[8:] + rng.normal(0.0, 0.05, (72, 2)))
    candidate = recognizer.locate(seen).candidates[0]
    svg = draw_match(seen, xy, candidate)
    assert count(svg, "line", "pair") == len(candidate.query_indices) == 72
    misses = count(svg, "path", "miss")
    assert 4 <= misses <= 8
    assert count(svg, "circle", "query") + count(svg, "circle", "query outside") == 72
    assert count(svg, "circle", "submap") + count(svg, "circle", "submap outside") == 80


def test_a_moving_match_starts_as_the_query_was_seen_and_ends_in_the_submap() -> None:
    """The CSS transform takes every landmark from where it is drawn back to its position in the query's own frame."""
    rng = np.random.default_rng(1)
    xy = forests.uniform(rng)
    recognizer = Recognizer(Config())
    recognizer.add([(1, describe(xy, Config()))])
    seen = SE2(3.0, 4.0, 1.0).inverse().apply(xy)
    found = recognizer.locate(seen).candidates[0]
    svg = draw_motion(seen, xy, found.transform, np.column_stack([found.query_indices, found.submap_indices]))
    root = ET.fromstring(svg)
    moving, proof = (next(g for g in root.iter(SVG + "g") if g.get("class") == name) for name in ("moving", "proof"))
    assert len(proof.findall(SVG + "line")) == len(xy)

    def pixels(parent: ET.Element) -> NDArray[np.float64]:
        return np.array([[float(c.get("cx", "")), float(c.get("cy", ""))] for c in parent.findall(SVG + "circle")])

    placed, submap = pixels(moving), pixels(root)
    assert np.abs(placed - submap).max() < 0.3
    numbers = [float(n) for n in re.findall(r"-?[0-9.]+(?=px|deg)", svg[svg.index("transform-origin") :])]
    x, y, dx, dy, turn = numbers
    angle = np.radians(turn)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    start = (placed - [x, y]) @ rotation.T + [x + dx, y + dy]
    scale = np.ptp(placed, axis=0).max() / np.ptp(xy, axis=0).max()
    shown = (start - start.mean(axis=0)) * [1.0, -1.0] / scale
    assert np.abs(shown - (seen - seen.mean(axis=0))).max() < 0.2
    assert (start[:, 0] > submap[:, 0].max()).all()
    assert abs(turn - np.degrees(1.0)) < 0.5


def test_scale_bars_fit_any_extent() -> None:
    for scale in (0.01, 1.0, 30.0, 4000.0):
        svg = draw_tessellation(describe(forests.uniform(np.random.default_rng(2)) * scale, Config()))
        [bar] = [e for e in ET.fromstring(svg).iter(SVG + "line") if e.get("class") == "bar"]
        assert 40.0 < float(bar.get("x2", "0")) - float(bar.get("x1", "0")) < 400.0


def ring(count: int, radius: float) -> NDArray[np.float64]:
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return radius * np.column_stack([np.cos(turn), np.sin(turn)])


def matched(pairs: int) -> Candidate:
    """A candidate that leaves the query where it is; the first landmarks of both sides are its pairs."""
    xy = forests.uniform(np.random.default_rng(1))
    recognizer = Recognizer(Config())
    recognizer.add([(1, describe(xy, Config()))])
    found = recognizer.locate(xy).candidates[0]
    both = np.arange(pairs)
    return replace(found, transform=SE2(0.0, 0.0, 0.0), query_indices=both, submap_indices=both)


def peak(work: Callable[[], object]) -> int:
    """Bytes that are allocated at once while the work is done."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_the_hull_takes_memory_for_the_landmarks_only() -> None:
    """Every landmark of a ring is a corner of its hull; a table of points by corners has 400 million cells."""
    around, within = ring(20_000, 4000.0), ring(20_000, 3999.0)
    assert peak(lambda: covered(within, around)) < 50_000_000
    assert covered(within, around).all()
    assert not covered(around, within).any()
    assert covered(around, around).all()


@pytest.mark.parametrize("seed", range(20))
def test_a_landmark_is_covered_where_no_side_of_the_hull_leaves_it_out(seed: int) -> None:
    rng = np.random.default_rng(seed)
    others = rng.integers(0, 5, (12, 2)).astype(float) if seed % 2 else rng.normal(0.0, 2.0, (12, 2))
    points = np.concatenate([rng.integers(-1, 6, (200, 2)).astype(float), rng.normal(1.0, 3.0, (200, 2)), others])
    sides = ConvexHull(others).equations
    expected = (points @ sides[:, :2].T + sides[:, 2] <= 1e-9).all(axis=1)
    np.testing.assert_array_equal(covered(points, others), expected)


def test_trees_on_one_line_are_drawn_too() -> None:
    line = np.column_stack([np.arange(5.0), np.zeros(5)])
    assert covered(line, line).all()
    assert covered(line[:, ::-1], line[:, ::-1]).all()
    assert not covered(line + (0.0, 1.0), line).any()


def test_of_very_many_trees_a_picture_shows_those_of_the_overlap_and_says_how_many() -> None:
    submap = np.random.default_rng(0).uniform(0.0, 1000.0, (20_000, 2))
    query = submap[:6_000] * (0.2, 0.2)  # in a corner
    svg = draw_match(query, submap, matched(0))
    assert count(svg, "circle", "query") == MOST
    assert count(svg, "circle", "submap") == covered(submap, query).sum() < 1_000
    assert count(svg, "circle", "submap") + count(svg, "circle", "submap outside") == MOST
    assert "10,000 of 26,000 trees drawn" in svg
    svg = draw_match(submap, submap, matched(20_000))
    assert count(svg, "line", "pair") == MOST
    assert len(svg) < 3_000_000
    assert "drawn" not in draw_match(query[:100], submap[:100], matched(100))


def test_of_a_very_large_submap_the_middle_is_drawn() -> None:
    features = describe(np.random.default_rng(0).uniform(0.0, 400.0, (8_000, 2)), Config())
    svg = draw_tessellation(features)
    assert count(svg, "circle", "tree") == MOST
    assert MOST < count(svg, "polygon", "triangle") < 2 * MOST
    assert 0 < count(svg, "polygon", "polygon") < len(features.tessellation)
    assert "5,000 of 8,000 trees drawn nearest to the middle" in svg


def test_a_picture_ends_with_its_budget() -> None:
    submap = ring(3_000, 50.0)
    features, found = describe(forests.uniform(np.random.default_rng(0)), Config()), matched(3_000)
    abandoned = Budget()
    abandoned.abandon()
    for budget, error in ((Budget(0.0), DeadlinePassed), (abandoned, Abandoned)):
        with pytest.raises(error):
            draw_match(submap, submap, found, budget=budget)
        with pytest.raises(error):
            draw_tessellation(features, budget=budget)
