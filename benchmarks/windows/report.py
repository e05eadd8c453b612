"""What the page says of searches within a prior, written from the JSON and from the calibration's file alone."""

from collections.abc import Callable, Mapping
from typing import Final

from benchmarks.experiments import Figures, provenance
from benchmarks.markdown import number, page, prose, table
from benchmarks.windows.calibrate import read as read_calibration

_COUNTS: Final = ("inside", "first", "right", "wrong", "outside", "false")


def write_report(results: Mapping[str, Figures]) -> str:
    """The part of the page, from the figures of the experiments that were run, by name."""
    sections = [write(results[name]) for name, write in SECTIONS.items() if name in results]
    return page("# Results: searches within a prior", provenance(results), *sections, _calibration())


def windows_section(figures: Figures) -> str:
    """What is found in windows that hold the plot, and in others."""
    parts = figures["parts"]
    sums = {name: sum(part[name] for part in parts) for name in _COUNTS}
    rows = [
        [
            f"{part['group']}, {part['noise']:g} m, heading {'known' if part['heading'] else 'unknown'}",
            *(str(part[name]) for name in ("inside", "first", "right", "wrong", "ambiguous")),
            f"{part['false']} / {part['outside']}",
            number(part["seconds"], 1),
        ]
        for part in parts
    ]
    return page(
        "## Plots in maps of tree tops",
        prose(
            f"""Plots of 6 to 20 m radius and {sums["inside"]} windows that hold them, in maps that have the thicker 60
            to 90 % of the stems, each off by the noise along each axis, and up to 15 % false trees. The position is
            known to 2, 4 or 6 m (one standard deviation), the heading to 2 degrees or not at all. Forests:
            {", ".join(figures["forests"])}; none of them is among those of the fit. The
            share of wrong priors, 10 %, was chosen among four values when a part of these figures was known, so it is
            not held out. *Tree tops*: 12 plots and simulated
            tops that others made. {sums["wrong"]} wrong matches, and {sums["false"]} in {sums["outside"]} windows that
            do not hold the plot. *First*: the best pose is right, reported or not (within 1.5 m and 6 degrees). Seconds
            are medians of a whole search, one thread, on a machine that had other work to do."""
        ),
        table(["map, noise", "inside", "first", "right", "wrong", "ambiguous", "false", "s"], rows),
    )


def _calibration() -> str:
    held = read_calibration()
    fit, (chance, rival) = held["fit"], (held["in_use"][name] for name in ("chance", "rival"))
    return page(
        "## Where the confidence within a prior comes from",
        prose(
            f"""`{fit["command"]}` (seed {fit["seed"]}, last on {fit["date"]}) fits two straight lines by maximum
            likelihood to {fit["windows"]} windows in {len(fit["forests"])} forests, of which {fit["with_the_plot"]}
            hold the plot; {100 * fit["wrong_priors"]:.0f} % of priors are taken to be wrong. Chance: slope
            {number(chance["slope"], 3)}, zero at {number(chance["even"])}; rival: slope {number(rival["slope"], 3)},
            zero at {number(rival["even"])}. With trees that are independent, the theory gives a slope of 1.
            {fit["result"]["accepted"]} of these windows are `matched`, {fit["result"]["wrong"]} of them wrong.
            `urquhart/prior/calibration.json` has the lines, and a digest of everything that the fit depends on; a test
            fails when one of these changes."""
        ),
    )


SECTIONS: Final[dict[str, Callable[[Figures], str]]] = {"windows": windows_section}
