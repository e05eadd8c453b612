"""Pictures of plots: tags that can be read."""

import re

import numpy as np
import pytest

from server.coregistration.outputs.picture import draw_plot
from server.coregistration.results import PlotResult, PlotTree

LABEL = re.compile(r'<text x="([-\d.]+)" y="([-\d.]+)" class="tag">([^<]+)</text>')


def picture(count: int, prefix: str) -> str:
    rng = np.random.default_rng(1)
    trees = [PlotTree(f"{prefix}{n}", x, y, 20.0) for n, (x, y) in enumerate(rng.uniform(-12.0, 12.0, (count, 2)))]
    return draw_plot(
        PlotResult(
            "p", "p.csv", "", "no_match", "no_proposal", "not found", centre=(0.0, 0.0), radius=17.0, trees=trees
        ),
        "als",
    )


@pytest.mark.parametrize(("count", "prefix", "least"), [(30, "", 30), (60, "2026-north-east-", 40), (400, "T", 120)])
def test_tags_do_not_cover_one_another(count: int, prefix: str, least: int) -> None:
    drawn = picture(count, prefix)
    found = [(float(x), float(y), 6.0 * len(tag)) for x, y, tag in LABEL.findall(drawn)]
    assert least <= len(found) <= count
    for at, (x, y, wide) in enumerate(found):
        for other, down, long in found[at + 1 :]:
            assert abs(y - down) >= 10.9 or x + wide <= other or other + long <= x
    assert drawn.count(f"<title>{prefix}") >= count  # each tree tells its whole tag
