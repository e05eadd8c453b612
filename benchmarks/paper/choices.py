"""What the report says of the choices behind the defaults: the ablation."""

from typing import Any

from benchmarks.markdown import number, page, picture, prose, table
from benchmarks.paper.charts import best_rows, serves, verified

Figures = dict[str, Any]
PLAIN = "plain, M = 20"
KEPT = "hull kept"


def section(figures: Figures) -> str:
    """The ablation."""
    default, chosen = figures["default"], best_rows(figures)
    top = max(chosen, key=lambda row: serves(row, figures))
    plain = next(row for row in chosen if row["label"] == PLAIN)
    sweep = [row for row in figures["rows"] if row["label"] == PLAIN]
    at_default = next((row for row in sweep if row["tau"] == default["tau"]), plain)
    minima = zip(figures["minima"]["verified"], at_default["verified"], strict=True)
    return page(
        "## The choices behind the defaults",
        picture("ablation", "What tau does, and each choice at its best tau"),
        prose(
            f"""Each choice with tau found again, over the 20 cells: over pairs, as in Table I, and in a collection of
            {plain["submaps"]} submaps of the same forest, asked {figures["queries"]} times. M is the number of samples,
            the letter's 1 / step. A default is chosen by the mean of *verified* and *collection*, one tau for both:
            observations are looked up one against one and in collections. All are asked the same; chance
            is worth about {number((0.05 * 0.95 / figures["queries"]) ** 0.5, 3)} of *collection*."""
        ),
        table(
            ["choice", "tau", "as there", "inliers", "verified", "collection", "mean", "polygons", "kB a submap"],
            [_row(row, figures) for row in chosen],
        ),
        prose(
            f"""Defaults: {"squared" if default["squared"] else "plain"} distance, M = {default["samples"]}, tau =
            {default["tau"]:g}, |dn| <= {default["vertex_window"]}, hull polygons
            {"kept" if default["keep_hull"] else "dropped"}, at least {default["correspondences"]} correspondences. The
            best mean above is that of "{top["label"]}" at tau = {top["tau"]:g}, {number(serves(top, figures), 3)};
            the defaults' is {number(serves(at_default, figures), 3)}. F1 verified at the defaults by least number of
            correspondences: {", ".join(f"{minimum}: {number(value, 3)}" for minimum, value in minima)}."""
        ),
        _hull(figures, chosen, plain),
        "What tau does, plain distance, M = 20:",
        _tau(sweep, figures),
        prose(
            """Over pairs, verification forgives any tau: the larger, the more correspondences, right and wrong, RANSAC
            has to choose from, until the polygons' descriptor no longer decides anything. In a collection a large tau
            makes every submap a neighbour of every other, and the votes drown."""
        ),
        prose(
            """The rivals are given their best, too. The letter does not say how far its GLARE looks about a landmark,
            nor whether a landmark counts in the bins beside its own. Mean F1 over the 20 cells without the gate, scored
            as in the letter (landmarks nearest to each other) and verified (every landmark with its nearest):"""
        ),
        table(
            ["GLARE", "as there", "verified"],
            [
                [name, number(max(means["glarot"]["letter"])), number(max(means["glarot-local"]["verified"]))]
                for name, means in figures["glare"].items()
            ],
        ),
    )


def _tau(sweep: list[Figures], figures: Figures) -> str:
    columns = ["tau", "as there", "inliers", "verified", "collection"]
    return table(
        columns,
        [
            [
                f"{row['tau']:g}",
                number(max(row["letter"])),
                number(max(row["inliers"])),
                number(verified(row, figures)),
                number(row["collection"]),
            ]
            for row in sweep
        ],
    )


def _row(row: Figures, figures: Figures) -> list[str]:
    return [
        row["label"].replace("|", "\\|"),
        f"{row['tau']:g}",
        number(max(row["letter"])),
        number(max(row["inliers"])),
        number(verified(row, figures), 3),
        number(row["collection"], 3),
        number(serves(row, figures), 3),
        number(row["polygons"], 0),
        f"{row['bytes'] / 1000.0:.1f}",
    ]


def _hull(figures: Figures, chosen: list[Figures], plain: Figures) -> str:
    hull = next((row for row in chosen if row["label"] == KEPT), None)
    if hull is None or figures["default"]["keep_hull"]:
        return ""
    found = figures["hull"]
    return prose(
        f"""Keeping the polygons at the hull is worth {serves(hull, figures) - serves(plain, figures):+.3f} to this
        mode. But every stored submap and the default method pay for it: {hull["polygons"] / plain["polygons"]:.2f}
        times the polygons, {hull["bytes"] / plain["bytes"]:.2f} times the bytes, and a query of the robust method takes
        {found["time_ratio"]:.2f} times as long; it finds {number(100.0 * found["found_kept"], 1)} % of the same
        observations with them and {number(100.0 * found["found_dropped"], 1)} % without. They stay dropped, as in the
        letter."""
    )
