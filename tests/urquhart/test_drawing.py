import xml.etree.ElementTree as ET

import numpy as np

from tests.urquhart import forests
from urquhart import SE2, Config, Recognizer, describe, draw_match, draw_tessellation

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
    candidate = recognizer.recognize(seen).candidates[0]
    svg = draw_match(seen, xy, candidate)
    assert count(svg, "line", "pair") == len(candidate.query_indices) == 72
    misses = count(svg, "path", "miss")
    assert 4 <= misses <= 8
    assert count(svg, "circle", "query") + count(svg, "circle", "query outside") == 72
    assert count(svg, "circle", "submap") + count(svg, "circle", "submap outside") == 80


def test_scale_bars_fit_any_extent() -> None:
    for scale in (0.01, 1.0, 30.0, 4000.0):
        svg = draw_tessellation(describe(forests.uniform(np.random.default_rng(2)) * scale, Config()))
        [bar] = [e for e in ET.fromstring(svg).iter(SVG + "line") if e.get("class") == "bar"]
        assert 40.0 < float(bar.get("x2", "0")) - float(bar.get("x1", "0")) < 400.0
