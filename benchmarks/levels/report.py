"""The section about the levels of the search, written from the JSON alone."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from benchmarks.experiments import Figures, provenance
from benchmarks.levels.asking import NAMES
from benchmarks.markdown import number, page, prose, table

NAME: Final = "levels"


def write_report(results: Mapping[str, Figures]) -> str:
    """The part of the page, from the figures by name."""
    return page(
        "# Results: what each level of the search adds",
        prose(
            """Made by `make bench-levels` (`ARGS=--quick` for a small version): questions of the other benchmarks,
            fewer of each kind, asked level by level. The [levels](architecture/method.md#propose) run in the order of
            the tables; a search ends as soon as a pose is certain. A level *added* a right answer if the answer was not
            `matched` and right before it, and is after it; in brackets, how many right answers it undid. *Missed
            without* counts the right answers that are lost if this level alone is left out: later levels find some of
            the others. It is not measured for the levels that begin a search which later ones go on with. Times are
            milliseconds of the level with verification and ranking: the median where it ran, then the mean over all
            questions of the world, whether it ran or not; for places that are stored / for others."""
        ),
        provenance(results),
        *(write(results[name]) for name, write in SECTIONS.items() if name in results),
    )


def levels_section(figures: Figures) -> str:
    """All worlds together, then each."""
    worlds: dict[str, Any] = figures["worlds"]
    totals = []
    for name in NAMES:
        found = [world["levels"][name] for world in worlds.values() if name in world["levels"]]
        if found:
            totals.append([name, *(str(_sum(found, key)) for key in ("answered", "added")), *_without(found)])
    sums = {key: _sum(list(worlds.values()), key) for key in ("stored", "elsewhere", "right", "wrong", "false")}
    useless = [row[0] for row in totals if row[2] == row[3] == "0"]
    return page(
        "## All worlds",
        prose(
            f"""{sums["stored"]} questions about places that are stored, {sums["right"]} of them answered right and
            {sums["wrong"]} wrong; {sums["elsewhere"]} about others, {sums["false"]} of them matched. Levels without
            which no right answer of any world is missed, and that added none: {", ".join(useless) or "none"}."""
        ),
        table(["level", "answered", "added", "missed without", "gained without"], totals),
        *(_world(name, world) for name, world in worlds.items()),
    )


def _world(name: str, figures: dict[str, Any]) -> str:
    rows = []
    for level, found in figures["levels"].items():
        rows.append(
            [
                level,
                f"{found['ran']} / {found['ran_elsewhere']}",
                str(found["answered"]),
                f"{found['added']} ({found['removed']})" if found["removed"] else str(found["added"]),
                _without([found])[0],
                f"{number(found['milliseconds'], 1)} / {number(found['milliseconds_elsewhere'], 1)}",
                f"{number(found['each'], 1)} / {number(found['each_elsewhere'], 1)}",
            ]
        )
    spent = f"{number(figures['milliseconds'], 1)} / {number(figures['milliseconds_elsewhere'], 1)} ms a question"
    return page(
        f"### {name[0].upper()}{name[1:]}",
        prose(
            f"""{figures["stored"]} stored, {figures["right"]} right, {figures["wrong"]} wrong; {figures["elsewhere"]}
            not stored, {figures["false"]} false; {spent} on average."""
        ),
        table(["level", "ran", "answered", "added", "missed without", "ms where it ran", "ms a question"], rows),
    )


def _without(found: list[dict[str, Any]]) -> list[str]:
    """Right answers missed and gained without a level, over all of `found`; dashes where that is not measured."""
    if any(one["missed_without"] is None for one in found):
        return ["-", "-"]
    return [str(_sum(found, key)) for key in ("missed_without", "gained_without")]


def _sum(found: list[dict[str, Any]], key: str) -> int:
    return sum(int(one[key]) for one in found)


SECTIONS: Final[dict[str, Callable[[Figures], str]]] = {NAME: levels_section}
