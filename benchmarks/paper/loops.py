"""What the report says of loop closure: Table I and the precision-recall curves."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.markdown import bullets, number, page, picture, prose, table
from benchmarks.paper import published
from benchmarks.paper.charts import best_gate
from benchmarks.paper.drive import LAPS, SENSOR, STEP
from benchmarks.paper.methods import LETTER_TAU
from benchmarks.paper.table1 import best_minimum, f1

Figures = dict[str, Any]
SHORT: Final = 0.03
"""F1 by which a cell may fall short of the letter's before it is named."""
LABELS: Final = {
    "paper": "paper",
    "paper-letter": f"paper, tau = {LETTER_TAU:g}",
    "glarot-local": "GLAROT, every landmark with its nearest, no gate",
    "glarot": "GLAROT, landmarks nearest to each other, no gate",
    "li-30": "Li et al., threshold 30",
    "li": "Li et al., threshold 100",
    "robust": "robust (its own verdict)",
}
COLUMNS: Final = (
    ("paper", (("paper-letter", "letter"), ("paper", "verified"))),
    ("glarot", (("gate", "letter"), ("glarot-local", "verified"))),
    ("li", (("li", "letter"), ("li", "verified"))),
)
"""For each method of the letter, which of our variants and scorings stand beside its figure."""


def section(figures: Figures) -> str:
    """Table I."""
    return page(
        "## Table I: loop closure in simulation",
        picture("table1", "F1 against noise for all methods, one column for each share of trees seen"),
        prose(
            """F1 in each cell, observations turned by any angle. *Letter* is the published figure. *As there* is ours
            scored as in the letter: a pair is reported when there are enough correspondences to run RANSAC, with the
            one minimum of 4, 8, 16, 32 and 64 that is best over all cells. *Verified* is ours when the transform that
            RANSAC finds must pass the all-landmark verification that every answer of this project has to pass."""
        ),
        _cells(figures),
        _verdict(figures),
        prose(
            """Mean F1 over the 20 cells by rotation range and scoring. In brackets: the least number of correspondences
            (for *inliers*: of RANSAC inliers) that is best over all cells, then the lowest and the highest of the
            forests."""
        ),
        _means(figures),
        prose(
            """GLAROT's first stage is a gate on the distance of two whole observations (here as a share of what they
            hold). The tighter it is, the more it keeps from the local signatures. Mean F1 by gate, landmarks nearest to
            each other:"""
        ),
        _gates(figures),
        picture("recall_by_distance", "Share of pairs found and right against the distance between their poses"),
        prose(
            """Share of all pairs found and right, verified, by the distance of their poses, over all cells. At 50 m two
            discs of 50 m share 39 % of their area."""
        ),
        "### What the letter leaves open, and what was chosen",
        bullets(_choices(figures)),
        "### Where we differ, and why",
        bullets(_differences(figures)),
    )


def pr_section(figures: Figures) -> str:
    """Precision-recall curves."""
    sweeps: dict[str, list[Figures]] = {"tau": [], "gamma": []}
    for curve in figures["curves"]:
        sweeps[curve["sweep"]].append(curve)
    tables = []
    for sweep, curves in sweeps.items():
        minima = [point["minimum"] for point in curves[0]["points"]]
        rows = [
            ["all" if c[sweep] is None else f"{c[sweep]:g}", *(number(p["f1"]) for p in c["points"])] for c in curves
        ]
        tables.append(table([sweep, *(f"at least {minimum}" for minimum in minima)], rows))
    tau, gamma = (max(curves, key=_best_f1) for curves in sweeps.values())
    kept = "with all polygons" if gamma["gamma"] is None else f"with {gamma['gamma']} polygons"
    return page(
        "## Precision and recall",
        picture("pr_curves", "Precision against recall for several tau and several gamma"),
        prose(
            f"""Scored as in the letter, precision and recall averaged over the 20 cells; a curve runs over the least
            number of correspondences, and a cell in which nothing is reported counts with precision 1. The letter finds
            tau = 5 best, and that taking fewer polygons of an observation (gamma) costs performance. Here the best mean
            F1 is {number(_best_f1(tau))}, at tau = {tau["tau"]:g}; at tau = {gamma["tau"]:g} it is best {kept}
            ({number(_best_f1(gamma))}). Mean F1 by least number of correspondences:"""
        ),
        *tables,
    )


def mean_f1(scoring: Figures) -> float:
    """Mean F1 over the cells at the best minimum."""
    return float(f1(scoring["counts"]).mean(axis=1).max())


def _cells(figures: Figures) -> str:
    full = figures["rotations"]["full"]["methods"]
    columns: list[NDArray[np.float64]] = []
    for name, variants in COLUMNS:
        columns.append(np.array(published.TABLE1[name]).ravel())
        columns += [_column(full, best_gate(full) if v == "gate" else v, scoring) for v, scoring in variants]
    columns.append(_column(full, "robust", "verdict"))
    rows = [
        [f"{100 * sigma:.0f} cm, {100 * detection:.0f} %", *(number(float(column[c])) for column in columns)]
        for c, (sigma, detection) in enumerate(figures["cells"])
    ]
    rows.append(["**mean**", *(f"**{number(float(column.mean()))}**" for column in columns)])
    head = ["noise, seen", "paper: letter", "as there", "verified", "GLAROT: letter", "as there (gate)"]
    return table([*head, "local, verified", "Li: letter", "as there", "verified", "robust"], rows)


def _verdict(figures: Figures) -> str:
    full = figures["rotations"]["full"]["methods"]
    short = _shortfalls(figures, "paper", "verified")
    as_there = _shortfalls(figures, "paper-letter", "letter")
    robust = _column(full, "robust", "verdict")
    return prose(
        f"""`method="paper"` verified has a mean of {number(mean_f1(full["paper"]["verified"]))}; the letter's is
        {number(published.mean(published.TABLE1["paper"]))}, and
        {
            f"it is short of the letter by more than {SHORT:g} in {short}"
            if short
            else f"in no cell is it short of the letter by more than {SHORT:g}"
        }.
        Scored as in the letter, with the letter's tau of {LETTER_TAU:g}, the mean is
        {number(mean_f1(full["paper-letter"]["letter"]))}{
            f", short of it by more than {SHORT:g} in {as_there}" if as_there else ""
        }. The robust method's lowest cell is {number(float(robust.min()), 3)}."""
    )


def _means(figures: Figures) -> str:
    rows = []
    for name, label in LABELS.items():
        for rotation, what in (("full", "any"), ("quarter", "a quarter turn")):
            scorings = figures["rotations"][rotation]["methods"][name]
            last = "verdict" if "verdict" in scorings else "verified"
            rows.append([label, what, *(_best(figures, scorings, s) for s in ("letter", "inliers", last))])
    return table(["method", "rotation", "as there", "inliers", "verified"], rows, words=2)


def _gates(figures: Figures) -> str:
    full = figures["rotations"]["full"]["methods"]
    gates = [name for name in full if name.startswith("glarot@")]
    rows = [
        [label, *(number(mean_f1(full[name][scoring])) for name in (*gates, "glarot"))]
        for scoring, label in (("letter", "as there"), ("verified", "verified"))
    ]
    return table(["scoring", *(name.removeprefix("glarot@") for name in gates), "no gate"], rows)


def _choices(figures: Figures) -> list[str]:
    count, seeds = figures["per_lap"] * LAPS, figures["seeds"]
    return [
        f"""The path is a circle of {STEP * figures["per_lap"]:.0f} m, driven {LAPS} times, with one observation at a
        random point of every {STEP:g} m: {count} observations, {figures["pairs"]} pairs, {figures["positive"]:.0f} of
        them within {SENSOR:g} m. Each pair is tried once, the later observation asking about the earlier one.""",
        f"""One forest for each seed ({", ".join(map(str, seeds))}); the cells of a seed share forest and poses.
        Counts are added up over forests before F1 is taken.""",
        """Bridson's k is 30. That gives about 99 trees to a disc and 5.3 m to the nearest neighbour, not the letter's
        80 and 3.4 m, which cannot both hold.""",
        """RANSAC is the letter's (d = 0.5 m, r = 0.99, s = 40,000). Where there are fewer pairs of correspondences than
        iterations, each is tried once; the best transform is fitted to its inliers.""",
        """A right report of a pair farther apart than the sensor's range is a true positive; not to report it is no
        miss.""",
        """GLARE's range is 30 m, and a landmark counts as a Gaussian of half a bin of direction and one of distance. Of
        the gates tried, the column shows the best over all cells. Li et al.'s threshold is the letter's 100, and
        30.""",
    ]


def _differences(figures: Figures) -> list[str]:
    full = figures["rotations"]["full"]["methods"]
    gate, free = (number(mean_f1(full[name]["letter"])) for name in (best_gate(full), "glarot"))
    li, li_30 = (number(mean_f1(full[name]["letter"])) for name in ("li", "li-30"))
    printed = np.array(published.TABLE1["paper"]).ravel()
    own = f1(full["paper-letter"]["letter"]["counts"]).max(axis=0)
    return [
        f"""Scored as there, the paper's method is better than in the letter where trees are missed and worse where all
        are seen. One minimum for all cells is part of it: few correspondences suit the cells with many gaps, and let
        strangers in where there are none. With each cell at a minimum of its own the mean is
        {number(float(own.mean()))}, and {int((own < printed - SHORT).sum())} cells are short of the letter by more
        than {SHORT:g}: noise moves descriptors past tau = {LETTER_TAU:g}. The default tau finds them, and needs a
        verification to keep strangers out.""",
        """The letter squares the centroid distance; its authors' published code does not, and that is what measures
        better (see the choices behind the defaults). The default is the plain distance.""",
        f"""GLAROT does better here than in the letter: {gate} scored as there, {free} without the gate. The gate must
        tell whole observations apart that share half of their trees, and those differ as much as strangers do; and how
        far GLARE looks decides more than anything else (see there).""",
        f"""Li et al.'s method, scored as there, bears noise better than in the letter and clean data worse: at the
        letter's threshold of 100 strangers share too many triangles (mean {li}; at 30 it is {li_30}). Why noise costs
        it so much more in the letter is not to be told from the text; here several triangles claim each landmark, and
        the most frequent claim is taken.""",
        """To be scored by the number of correspondences rewards a method for silence where nothing is to be found. With
        a verification behind it, many correspondences of which few are right serve better than few that mostly are:
        that is why both baselines overtake the paper's method once verified, and why a larger tau then is better.""",
        """The robust method gets the same pairs, each submap as a collection of its own, and is scored by its own
        verdict, which also weighs rival poses.""",
    ]


def _column(methods: Figures, name: str, scoring: str) -> NDArray[np.float64]:
    chosen = methods[name][scoring]
    return np.asarray(f1(chosen["counts"])[best_minimum(chosen)])


def _best(figures: Figures, scorings: Figures, scoring: str) -> str:
    if scoring not in scorings:
        return ""
    at = best_minimum(scorings[scoring])
    by_seed = [row[at] for row in scorings[scoring]["mean_by_seed"]]
    least = f"{figures['minima'][scoring][at]}; " if scoring in figures["minima"] else ""
    return f"{number(mean_f1(scorings[scoring]), 3)} ({least}{number(min(by_seed), 3)} to {number(max(by_seed), 3)})"


def _shortfalls(figures: Figures, name: str, scoring: str) -> str:
    column = _column(figures["rotations"]["full"]["methods"], name, scoring)
    printed = np.array(published.TABLE1["paper"]).ravel()
    return ", ".join(
        f"{100 * sigma:.0f} cm at {100 * detection:.0f} % ({number(float(column[c]))} for {number(float(printed[c]))})"
        for c, (sigma, detection) in enumerate(figures["cells"])
        if column[c] < printed[c] - SHORT
    )


def _best_f1(curve: Figures) -> float:
    return max(float(point["f1"]) for point in curve["points"])
