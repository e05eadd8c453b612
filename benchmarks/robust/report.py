"""What the page says of the default method, written from the JSON alone."""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from benchmarks.experiments import Figures, provenance
from benchmarks.markdown import number, page, picture, prose, table
from benchmarks.robust.calibrate import read as read_calibration
from benchmarks.robust.calibration_report import calibration_section
from benchmarks.robust.charts import KINDS, NAMES, grid_rates
from benchmarks.robust.grid import CLUTTERS, DETECTIONS, SIGMAS
from benchmarks.robust.table1 import PEERS

SHORT: Final = 0.95
"""Recall over the oracle's below which a cell is named."""
COUNTED: Final = 10
"""Positive pairs that an oracle must accept for a cell's ratio to say anything."""


def write_report(results: Mapping[str, Figures]) -> str:
    """The part of the page, from the figures of the experiments that were run, by name."""
    sections = [write(results[name]) for name, write in SECTIONS.items() if name in results]
    return page(_head(results), *sections, calibration_section(read_calibration()))


def _head(results: Mapping[str, Figures]) -> str:
    return page(
        "# Results: how the default method holds",
        prose(
            """Everything here is made by `make bench-robust` (`ARGS=--quick` for a small version), with the defaults of
            `urquhart/config.py` in every cell: no method is told the noise, the share of trees seen, or what kind of
            forest it is in. The *oracle* is the same verification with the same gate, handed the true pose: what no
            search can beat. A match is *wrong* when the pose is not the true one (off by more than 1 m or 3 degrees; in
            the paper's own forests by more than the paper's bounds), and *false* when the place is not in the
            database at all. The numbers of the confidence are fitted on other forests, with other seeds:
            [below](#where-the-confidence-comes-from)."""
        ),
        provenance({name: figures for name, figures in results.items() if figures["seconds"]}),
    )


def table1_section(figures: Figures) -> str:
    """Table I and the peers."""
    cells = figures["cells"]
    worst = min(min(cell["f1_by_seed"]) for cell in cells)
    quiet = [cell["milliseconds"] for cell in cells if cell["cell"][0] <= 0.2]
    rows = []
    for k, cell in enumerate(cells):
        sigma, detection = cell["cell"]
        peers = [
            entry
            for name in PEERS
            for entry in (
                number(figures["peers"][name]["f1"][k]),
                number(figures["peers"][name]["milliseconds"][k]),
            )
        ]
        rows.append(
            [
                f"{100 * sigma:.0f} cm, {100 * detection:.0f} %",
                number(float(np.mean(cell["f1_by_seed"])), 3),
                number(min(cell["f1_by_seed"]), 3),
                str(cell["wrong"]),
                number(cell["milliseconds"]),
                *peers,
            ]
        )
    head = ["noise, seen", "F1", "worst seed", "wrong", "ms"]
    head += [entry for name in PEERS for entry in (f"{NAMES[name]}: F1", "ms")]
    return page(
        "## Loop closure in the paper's 20 cells",
        picture("robust_table1", "F1 and milliseconds a pair in each cell, beside three peers"),
        prose(
            f"""Any rotation, {len(figures["seeds"])} drives of {figures["pairs"]} pairs a cell, each observation a
            collection of its own. The lowest F1 of any cell and seed is {number(worst, 3)}. Milliseconds are medians
            over all pairs, near and far, of a whole look-up with its verdict, observation included:
            {number(min(quiet))} to {number(max(quiet))} in the cells up to 20 cm, at most
            {number(max(cell["milliseconds"] for cell in cells))} in any. The peers ran on the first drive's pairs in
            the same run; theirs are means over the pairs, with RANSAC and the same verification, descriptions made
            before. Their least number of correspondences is the one that is best over all cells."""
        ),
        table(head, rows),
    )


def grid_section(figures: Figures) -> str:
    """The extended grid."""
    found, oracle = grid_rates(figures)
    false = sum(row["false"] for row in figures["summaries"])
    wrong = sum(row["wrong"] for row in figures["summaries"])
    short = []
    for k, row in enumerate(figures["summaries"]):
        sigma, detection, clutter = figures["cells"][k]
        if row["oracle"] >= COUNTED and row["right"] < SHORT * row["oracle"]:
            name = f"{100 * sigma:.0f} cm, {100 * detection:.0f} % seen, {100 * clutter:.0f} % false"
            short.append([name, str(row["right"]), str(row["oracle"]), number(row["right"] / row["oracle"])])
    tables = []
    for c, clutter in enumerate(CLUTTERS):
        head = [f"{100 * clutter:.0f} % false; seen", *(f"{100 * sigma:.0f} cm" for sigma in SIGMAS)]
        rows = [
            [f"{100 * detection:.0f} %", *(f"{found[c, d, s]:.2f} / {oracle[c, d, s]:.2f}" for s in range(len(SIGMAS)))]
            for d, detection in enumerate(DETECTIONS)
        ]
        tables.append(table(head, rows))
    total = sum(row["oracle"] for row in figures["summaries"])
    return page(
        "## Far beyond the paper's grid",
        picture("robust_grid", "Recall in each cell, and its share of what the oracle accepts"),
        prose(
            f"""The paper's forest, noise up to 1 m and half of the trees on each of the two sides, false landmarks up
            to as many as true ones; {figures["positive"]} pairs of one place and {figures["negative"]} of different
            places a cell. {false} false and {wrong} wrong matches among {len(figures["cells"]) * figures["negative"]}
            and {len(figures["cells"]) * figures["positive"]} pairs. Found and right: {number(_ratio(figures), 3)} of
            the {total} pairs that the oracle accepts. Each entry: share of the pairs found and right / accepted by the
            oracle."""
        ),
        *tables,
        prose(
            f"""Cells where the oracle accepts at least {COUNTED} pairs and fewer than {100 * SHORT:.0f} % of them are
            found: {
                "none."
                if not short
                else "these. The true pose stands out too little there for the correlation to "
                "propose it: of those refined, others had more landmarks together. Finer cells find more of them, at a "
                "cost that every pair would pay."
            }"""
        ),
        table(["cell", "right", "oracle", "share"], short) if short else "",
        prose(
            """What limits the oracle: beyond about 60 cm the residual of a true pair (85 cm) is as large as what
            chance partners have, and a tree without a partner counts against a pose. Nothing but a prior on the pose
            would help."""
        ),
    )


def rows_section(figures: Figures) -> str:
    """Plantations."""
    rows = []
    for kind, row in zip(figures["kinds"], figures["summaries"], strict=True):
        spacing, jitter, survival, sigma = kind
        rows.append(
            [
                f"{spacing[0]:g} x {spacing[1]:g} m, {100 * jitter:.0f} cm, {100 * survival:.0f} %, "
                f"{100 * sigma:.0f} cm",
                str(row["inside"]),
                str(row["alone"]),
                str(row["oracle"]),
                str(row["right"]),
                str(row["wrong"]),
                f"{row['false']} / {row['outside']}",
                number(row["milliseconds"], 0),
            ]
        )
    sums = {name: sum(row[name] for row in figures["summaries"]) for name in figures["summaries"][0]}
    return page(
        "## Plantations",
        prose(
            f"""Rows of trees, {sums["outside"]} queries from places that are not in the database (half further down the
            same rows, half in another stand planted alike) and {sums["inside"]} from inside, 36 submaps, ranges of 15
            to 25 m. {sums["false"]} false and {sums["wrong"]} wrong matches. Right: {sums["right"]}, which is
            {number(sums["right"] / sums["oracle"], 3)} of what the oracle accepts with the rivals that other submaps
            hold, and {number(sums["right"] / sums["alone"], 3)} of what it would accept if each submap were alone in
            the world; the rest is answered `ambiguous`. Where trees stand within 15 cm of their planting points and are
            measured to 10-20 cm, one row looks like the next, and that is the honest answer."""
        ),
        table(["spacing, jitter, survival, noise", "inside", "alone", "oracle", "right", "wrong", "false", "ms"], rows),
    )


def edges_section(figures: Figures) -> str:
    """Plantations where another place fits nearly as well."""
    rows = []
    for (scene, spacing, jitter, survival), row in zip(figures["kinds"], figures["summaries"], strict=True):
        stand = f"{spacing[0]:g} x {spacing[1]:g} m, {100 * jitter:.0f} cm, {100 * survival:.0f} %"
        counts = [str(row[name]) for name in ("inside", "oracle", "right", "wrong")]
        rows.append([f"{scene}: {stand}", *counts, f"{row['false']} / {row['outside']}"])
    sums = {name: sum(row[name] for row in figures["summaries"]) for name in ("false", "wrong", "inside", "outside")}
    return page(
        "## Edges of plantations",
        prose(
            f"""Stands in which another place fits nearly as well: amid rows that were planted to the centimetre, at a
            corner that is like the opposite one, at one of several edges, in one of two stands planted alike, and in
            the lane between two stands of which only the outer edges are stored. Noise is 3 to 5 cm. {sums["inside"]}
            queries from places in the database and {sums["outside"]} from others: {sums["wrong"]} wrong and
            {sums["false"]} false matches."""
        ),
        table(["place: spacing, jitter, survival", "inside", "oracle", "right", "wrong", "false"], rows),
    )


def few_trees_section(figures: Figures) -> str:
    """A handful of trees."""
    rows = []
    for (trees, sigma, detection), row in zip(figures["cells"], figures["summaries"], strict=True):
        shares = [number(row[name] / row["inside"], 3) for name in ("first", "oracle", "right")]
        rows.append(
            [
                f"{trees} trees, {100 * sigma:.0f} cm, {100 * detection:.0f} %",
                *shares,
                str(row["wrong"]),
                f"{row['false']} / {row['outside']}",
            ]
        )
    sums = {name: sum(row[name] for row in figures["summaries"]) for name in ("false", "wrong", "inside", "outside")}
    return page(
        "## Few trees",
        prose(
            f"""The paper's forest, {figures["submaps"]} overlapping submaps; a query has the trees nearest to the
            sensor only. *First*: the first candidate is right, reported or not. {sums["inside"]} queries from places in
            the database and {sums["outside"]} from another forest: {sums["wrong"]} wrong and {sums["false"]} false
            matches."""
        ),
        table(["query: trees, noise, seen", "first", "oracle", "right", "wrong", "false"], rows),
    )


def stands_section(figures: Figures) -> str:
    """Real trees."""
    rows, total = [], {"inside": 0, "oracle": 0, "right": 0, "right_of_oracle": 0, "wrong": 0, "false": 0, "outside": 0}
    for name, levels in figures["stands"].items():
        for level, row in levels.items():
            for key in total:
                total[key] += row[key]
            if row["inside"]:
                entries = [str(row[key]) for key in ("inside", "oracle", "right", "wrong")]
                rows.append([f"{name}, {level}", *entries, number(row["milliseconds"], 1)])
    pairs = []
    for with_diameters, groups in zip((False, True), figures["plots"], strict=True):
        for group, row in groups.items():
            pairs.append(
                [
                    f"{group}, {'with' if with_diameters else 'without'} diameters",
                    *(str(row[key]) for key in ("inside", "right", "wrong", "ambiguous")),
                ]
            )
    return page(
        "## Real trees",
        prose(
            f"""Stem maps cut into discs of about 60 trees (8 to 50 m), stored with 10 cm of noise and 5 % missing;
            all of them and all first surveys of the plots lie in one collection. Queries have 60 to 100 % of that
            range, noise and trees seen as named, and 10 % false landmarks. {total["right_of_oracle"]} of the
            {total["oracle"]} that the oracle accepts are found and right
            ({number(total["right_of_oracle"] / max(total["oracle"], 1), 3)}); {total["wrong"]} of {total["inside"]} are
            wrong. {total["outside"]} queries from stands that are not stored
            ({", ".join(figures["held_out"])}): {total["false"]} matched. *Counted again* asks with the same stand's
            trees ten or twenty years later."""
        ),
        table(["stand, noise, seen", "asked", "oracle", "right", "wrong", "ms"], rows),
        prose(
            """Plots surveyed twice by different means, field against mobile laser (prf025), terrestrial scan (rioja)
            and drone (t3upland, left 0.5 to 1.8 m apart by the best rigid fit); the second survey asks, every other
            plot and stand is a distractor:"""
        ),
        table(["plots", "asked", "right", "wrong", "ambiguous"], pairs),
    )


def reliability_section(figures: Figures) -> str:
    """The reliability diagram."""
    rows = [[str(one["count"]), number(one["confidence"], 4), number(one["right"], 4)] for one in figures["bins"]]
    parts = ", ".join(f"{count} from {KINDS[name]}" for name, count in figures["answers"].items())
    return page(
        "## Is the confidence true?",
        picture("robust_reliability", "Share of right answers against confidence"),
        prose(
            f"""Every answer above that names a pose ({parts}), reported or not, in bins of at least 500. Bars are two
            standard deviations of a share that is what it is said to be. The mean distance from the diagonal over all
            answers is {number(figures["expected_error"], 3)}. A pose about which nothing speaks (log-odds below -8)
            keeps a confidence of a few percent: where noise is beyond anything foreseen, the best guess is right that
            often. `matched` begins at 0.999."""
        ),
        table(["answers", "mean confidence", "right"], rows),
    )


def _ratio(figures: Figures) -> float:
    found = sum(row["right_of_oracle"] for row in figures["summaries"])
    return float(found / max(sum(row["oracle"] for row in figures["summaries"]), 1))


SECTIONS: Final[dict[str, Callable[[Figures], str]]] = {
    "robust_table1": table1_section,
    "robust_grid": grid_section,
    "robust_rows": rows_section,
    "robust_edges": edges_section,
    "robust_few_trees": few_trees_section,
    "robust_stands": stands_section,
    "robust_reliability": reliability_section,
}
