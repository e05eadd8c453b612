"""The section of docs/reliability.md on the shapes that cost most."""

from typing import Final

from benchmarks.experiments import Figures
from benchmarks.markdown import number, page, prose, table

LATE: Final = 0.25
"""Seconds after its deadline by which a search has to end, and for which it may go on without asking."""
MOST: Final = 500.0
"""MB that a request may take."""


def shape_faults(figures: Figures) -> list[str]:
    """What falls short, a sentence each."""
    found = []
    for name, costs in figures["shapes"].items():
        for cost in costs:
            of = f"shapes, {cost['landmarks']:,} landmarks, {name}"
            if cost["silence"] > LATE:
                found.append(f"{of}: {cost['silence']:.2f} s of computing without asking whether to go on")
            if cost["megabytes"] > MOST:
                found.append(f"{of}: {cost['megabytes']:.0f} MB")
    return found


def shapes_section(figures: Figures) -> str:
    """The section, from the figures alone."""
    shown = (figures["sizes"][0], figures["sizes"][-1])
    rows = [
        [
            name,
            f"{cost['landmarks']:,}",
            number(cost["describe"], 3),
            number(cost["query"], 2),
            number(cost["silence"], 3),
            number(max(cost["megabytes"], 0.0), 0),
            cost["reason"],
        ]
        for name, costs in figures["shapes"].items()
        for cost in costs
        if cost["landmarks"] in shown
    ]
    head = ["shape", "landmarks", "describe, s", "query, s", "unasked, s", "memory, MB", "reason of the verdict"]
    slowest = max(cost["describe"] for costs in figures["shapes"].values() for cost in costs)
    return page(
        "## Shapes that cost most",
        prose(
            f"""Landmarks on circles, in rows, on lattices and at all scales at once, each shape in a process of its
            own. A shape is described, then turned and looked up in a collection of {figures["alike"]} submaps of the
            same shape and of different scales, with the deadline of {figures["deadline"]:.0f} s that the service has by
            default. `describe` and `unasked` are processor seconds, the latter the longest stretch for which the search
            did not ask whether it may go on; `query` is the time until the answer, on a machine that may have had other
            work. The slowest description took {slowest:.2f} s. Figures of all sizes are in the JSON."""
        ),
        table(head, rows),
    )
