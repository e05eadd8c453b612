"""One question, level by level: after which level its answer is right, and whether it still is without a level."""

import time
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.robust.known_places import AskedQuery
from urquhart import Features, Recognition, Recognizer
from urquhart.decide.ranking import NOTHING, rank
from urquhart.decide.verdict import decide
from urquhart.features.observation import describe_observation
from urquhart.options import Options
from urquhart.propose.levels import LEVELS, Level, propose_on
from urquhart.propose.query import make_query

_FULL: Final = LEVELS["full"]
NAMES: Final = tuple(level.name for level in _FULL)
SPARED: Final = tuple(name for name in NAMES if name not in ("rare quads", "all quads", "loose quads"))
"""Levels that can be left out. The others begin a search that later levels go on with."""

_EACH: Final = (len(NAMES),)
ROW: Final = np.dtype(
    [
        ("stored", np.bool_),  # whether the place is in the world
        ("ran", np.bool_, _EACH),  # by level: whether the search reached it
        ("milliseconds", np.float32, _EACH),  # of the level and of ranking what it proposed; 0 where it did not run
        ("right", np.bool_, _EACH),  # whether the answer after it is `matched` and right; a skipped level changes none
        ("mistaken", np.bool_, _EACH),  # whether the answer after it is `matched` and wrong, or false
        ("right_without", np.bool_, _EACH),  # the last answer without it, and without it alone
        ("mistaken_without", np.bool_, _EACH),
    ]
)
"""One question."""


class Step(NamedTuple):
    """One level of a search: its name, what it cost (milliseconds), and the answer if the search ended after it."""

    level: str
    milliseconds: float
    answer: Recognition


def search(recognizer: Recognizer, observation: Features, levels: Sequence[Level] = _FULL) -> Iterator[Step]:
    """Search as `Recognizer.recognize` does, level by level."""
    index, source = recognizer.read_view
    query = make_query(observation, recognizer.config, source, len(index), Options())
    ranking = NOTHING
    proposed = propose_on(index, query, 1, lambda: ranking.is_lost(query), levels)
    start = time.perf_counter()
    for level, proposals in proposed:
        ranking = rank(query, proposals, ranking)
        spent = 1e3 * (time.perf_counter() - start)
        yield Step(level.name, spent, decide(query, ranking, 1, "exhausted"))
        if ranking.is_certain(query, level.sees_few):
            return
        start = time.perf_counter()


def ask(question: AskedQuery) -> NDArray[Any] | None:
    """A row of `ROW` about one question; None where too few trees are seen to search for."""
    world, row = question.world.recognizer, np.zeros((), ROW)
    described = describe_observation(question.xy, world.config, question.diameters)
    if not isinstance(described.result, Features):
        return None
    row["stored"] = question.ground is not None
    right = mistaken = False
    steps = {step.level: step for step in search(world, described.result)}
    for number, name in enumerate(NAMES):
        if name in steps:
            row["ran"][number], row["milliseconds"][number] = True, steps[name].milliseconds
            right, mistaken = judge(question, steps[name].answer)
        row["right"][number], row["mistaken"][number] = right, mistaken
    row["right_without"], row["mistaken_without"] = right, mistaken
    for number, name in enumerate(NAMES):
        # A search that never reached a level goes the same way without it.
        if name in steps and name in SPARED:
            others = [level for level in _FULL if level.name != name]
            left = list(search(world, described.result, others))
            ended = judge(question, left[-1].answer) if left else (False, False)
            row["right_without"][number], row["mistaken_without"][number] = ended
    return row


def judge(question: AskedQuery, answer: Recognition) -> tuple[bool, bool]:
    """Whether an answer is `matched` and right, and whether it is `matched` and not right."""
    matched, right = answer.verdict == "matched", question.is_right(answer)
    return matched and right, matched and not right
