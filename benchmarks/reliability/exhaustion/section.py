"""The part `exhaustion` on the page: one row an attack, and what exceeds the bounds."""

from typing import Final

from benchmarks.experiments import Figures
from benchmarks.markdown import bullets, number, page, prose, table

LONGEST: Final = 5.0
"""Seconds that a request of an authorised caller may take."""
MEMORY: Final = 500.0
"""MB that an attack may make the service grow by."""
SLOWER: Final = 2.0
"""How many times as long the robot's 99th percentile may become."""
_UNITS: Final = {
    "bytes": "bytes sent",
    "answer_bytes": "bytes in the largest answer",
    "result_bytes": "bytes of results",
}


def exhaustion_section(figures: Figures) -> str:
    """The table, with the bounds above it."""
    rows = [
        [
            name,
            f"{one['requests']:,}",
            number(one["longest_seconds"], 1),
            number(one["megabytes"], 0),
            f"{number(one['before']['p99'], 0)} / {number(one['during']['p99'], 0)}",
            number(one["slower"], 1),
        ]
        for name, one in figures["attacks"].items()
    ]
    head = ["attack", "requests", "longest, s", "memory, MB more", "robot p99, ms: before / during", "ratio"]
    return page(
        "## Callers who exhaust the service",
        prose(
            f"""Each attack uses one valid key against a service of its own with default settings. A robot with another
            key asks one small query after the other, before the attack and during it; attacker, robot and service share
            two cores. The bounds: no request takes more than {number(LONGEST, 0)} s, the service grows by at most
            {number(MEMORY, 0)} MB, and the 99th percentile of the robot's answers at most doubles."""
        ),
        table(head, rows, words=1),
        bullets(
            [
                f"**{name}**: {one['does']}. Answers: {_statuses(one)}{_more(one)}."
                for name, one in figures["attacks"].items()
            ]
        ),
    )


def exhaustion_faults(figures: Figures) -> list[str]:
    """What exceeds a bound, a sentence each."""
    found = []
    for name, one in figures["attacks"].items():
        if one["longest_seconds"] > LONGEST:
            found.append(f"{name}: a request takes {number(one['longest_seconds'], 1)} s")
        if one["megabytes"] > MEMORY:
            found.append(f"{name}: the service grows by {number(one['megabytes'], 0)} MB")
        if one["slower"] > SLOWER:
            found.append(f"{name}: the robot's p99 becomes {number(one['slower'], 1)} times as long")
        found += [f"{name}: the robot got {count} x {what}" for what, count in one["robot_errors"].items()]
        found += [f"{name}, the log: {count} x {line}" for line, count in one["failures"].items()]
    return found


def _statuses(one: Figures) -> str:
    return ", ".join(f"{count:,} x {status}" for status, count in one["statuses"].items()) or "none"


def _more(one: Figures) -> str:
    told = []
    for name, value in one["more"].items():
        if isinstance(value, dict):
            told.append(
                ", ".join(
                    f"{part} {number(count, 2) if isinstance(count, float) else count}" for part, count in value.items()
                )
            )
        elif isinstance(value, str):
            told.append(value)
        else:
            shown = number(value, 2) if isinstance(value, float) else f"{value:,}"
            told.append(f"{_UNITS.get(name, name.replace('_', ' '))} {shown}")
    return "; " + "; ".join(told) if told else ""
