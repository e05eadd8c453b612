"""docs/results.md, written from the JSON alone: our figures beside the letter's, what we chose, where we differ."""

from collections.abc import Callable, Mapping
from typing import Final

from benchmarks.experiments import Figures, provenance
from benchmarks.markdown import number, page, picture, prose, table
from benchmarks.paper import choices, loops, merges
from benchmarks.paper.charts import NAMES
from benchmarks.paper.published import TABLE3


def write_report(results: Mapping[str, Figures]) -> str:
    """The document, from the figures of the experiments that were run, by name."""
    return page(_head(results), *(write(results[name]) for name, write in SECTIONS.items() if name in results))


def _head(results: Mapping[str, Figures]) -> str:
    return page(
        "# Results: the paper's experiments",
        prose(
            """Nardari et al., *Place Recognition in Forests With Urquhart Tessellations*, RA-L 2020 (below: the
            letter), compares its method with GLAROT and with Li et al.'s Delaunay triangles. All of it that can be
            simulated or run on public data is run here again: the letter's method (`method="paper"`), both of its
            rivals rewritten from their papers, and beside them this project's own default (`robust`). `make
            bench-paper` writes everything from scratch, this page included; `make bench-paper ARGS=--quick` a smaller
            version in two minutes. One configuration throughout, the defaults of `urquhart/config.py`: nothing is
            tuned to a cell or a map, and no method is told the noise or the share of trees seen."""
        ),
        provenance(results),
    )


def efficiency_section(figures: Figures) -> str:
    """Table III."""
    parts = ("describe", "match", "gate", "ransac", "verify")
    sigma, detection = figures["cell"]
    orders = {"paper": TABLE3["paper"], "glarot-local": TABLE3["glarot (C++)"], "li": TABLE3["li"]}
    growth = []
    for name, found in figures["slopes"].items():
        describing, _, matching, _ = orders.get(name, ("", 0.0, "", 0.0))
        growth.append([NAMES[name], describing, f"n^{found['describe']:.2f}", matching, f"n^{found['match']:.2f}"])
    return page(
        "## Table III: efficiency",
        picture("table3", "Milliseconds against landmarks for describing and matching"),
        prose(
            f"""Median milliseconds on one thread, {figures["landmarks"]:.0f} landmarks an observation on average
            ({100 * sigma:.0f} cm, {100 * detection:.0f} %), {figures["pairs"]} pairs, half of them near; all methods
            take turns. Matching ends with correspondences; RANSAC and verification come on top, except for `robust`,
            whose figure is a whole look-up in a collection of one submap, verdict included. *Gate* is the comparison of
            two whole observations."""
        ),
        table(
            ["method", *parts],
            [
                [NAMES[name], *(number(row[part], 3) if part in row else "" for part in parts)]
                for name, row in figures["methods"].items()
            ],
        ),
        "The letter's milliseconds, in Python (GLAROT also in C++) on a laptop of 2016:",
        table(
            ["method", "describe", "match"],
            [[name, number(describe, 0), number(match, 3)] for name, (_, describe, _, match) in TABLE3.items()],
        ),
        prose(
            f"""How time grows with the n landmarks of an observation: the letter's worst case, and what is measured
            from {figures["steep_from"]} landmarks on. g, the number of polygons or triangles, is itself proportional
            to n."""
        ),
        table(["method", "describe: letter", "here", "match: letter", "here"], growth),
    )


SECTIONS: Final[dict[str, Callable[[Figures], str]]] = {
    "table1": loops.section,
    "pr_curves": loops.pr_section,
    "ablation": choices.section,
    "table2": merges.section,
    "table3": efficiency_section,
}
