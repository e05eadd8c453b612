"""The section of docs/reliability.md on submaps alone and robots at one place at the same time."""

from benchmarks.experiments import Figures
from benchmarks.markdown import number, page, prose, table


def meeting_faults(figures: Figures) -> list[str]:
    """What falls short, a sentence each."""
    together = figures["together"]
    found = [
        f"alone, {kind}: {missed['reason']} for a submap of {missed['landmarks']} landmarks"
        for kind, one in figures["alone"].items()
        for missed in one["missed"]
    ]
    if together["untold"]:
        found.append(f"meetings: {len(together['untold'])} pairs of robots were not told of each other")
    return found + [f"meetings, the log: {line}" for line in together["logged"]]


def meetings_section(figures: Figures) -> str:
    """The section, from the figures alone."""
    together = figures["together"]
    rows = [
        [kind, f"{one['submaps']:,}", f"{one['found']:,}", number(one["most_metres"], 3)]
        for kind, one in figures["alone"].items()
    ]
    return page(
        "## Submaps alone, and robots that meet",
        prose(
            """Each submap is stored in a collection of its own and looked up again, turned by any angle and moved. The
            worst pose is how far the answer was from the truth at most."""
        ),
        table(["forest", "submaps", "found", "worst pose, m"], rows),
        prose(
            f"""{together["pairs"]:,} times two robots stored a view of one place at the same moment, through two
            processes on one database, and asked with it for what the other had stored.
            In {len(together["untold"])} cases neither robot was told of the other."""
        ),
    )
