"""Queries of one kind, and what their answers are worth."""

import time
from collections import Counter
from statistics import median
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.scale.database import COLLECTION, index_of, opened
from benchmarks.scale.measurement import Figures, Measurement, Steps, memory, spread
from benchmarks.scale.measurement_plan import COMPARED
from benchmarks.scale.observations import Observations
from benchmarks.scale.simulate import WARMING
from benchmarks.scale.tiled_forest import KINDS, Kind, questions_of
from server.index.live_indexes import LiveIndexes
from server.platform.thread_limits import pin_threads
from urquhart import SE2, Config, Recognition, warm_up
from urquhart.options import Effort

SHIFT: Final = 1.0
"""Metres, and"""
TURN: Final = float(np.radians(3.0))
"""radians: a pose is right when it is no farther from the true one."""


def run(measurement: Measurement) -> Figures:
    """Ask all queries of a kind one after the other: verdicts, poses, times, and the memory at the end."""
    kind, submaps, queries = (
        KINDS[measurement.part],
        Observations.load(measurement.room, measurement.submaps_name),
        Observations.load(measurement.room, questions_of(measurement.part)),
    )
    pin_threads()
    warm_up(Config())
    empty = memory()
    rows: list[dict[str, Any]] = []
    with opened(measurement.database) as indexes:
        for last in range(1, WARMING + 1):
            answer(indexes, queries.xy(len(queries) - last), kind.effort)
        steps = Steps(f"asked, {kind}", measurement.asked)
        for number in range(measurement.asked):
            rows.append(_ask(indexes, submaps, queries, number, kind))
            steps.done(number + 1)
        used = memory()
    return summarize(rows, inside=kind.inside) | {"memory": used, "memory_before": empty}


def answer(indexes: LiveIndexes, xy: NDArray[np.float64], effort: Effort = "fast") -> Recognition:
    """Look landmarks (N, 2) float64, metres, up in the collection, as a query of the service does."""
    with indexes.view(COLLECTION) as view:
        return view.recognizer.locate(xy, effort=effort)


def is_right(submap: SE2, found: SE2, truth: SE2) -> bool:
    """Whether a pose in a submap (`submap_T_query`) is the true one (`map_T_query`), given the submap's own."""
    shift, turn = (submap @ found).distance(truth)
    return shift <= SHIFT and turn <= TURN


def _ask(indexes: LiveIndexes, submaps: Observations, queries: Observations, number: int, kind: Kind) -> dict[str, Any]:
    xy, truth = queries.xy(number), queries.pose(number)
    start = time.perf_counter()
    with indexes.view(COLLECTION) as view:
        found = view.recognizer.locate(xy, effort=kind.effort)
        milliseconds = 1e3 * (time.perf_counter() - start)
        best = found.candidates[0] if found.candidates else None
        submap = None if best is None else index_of(view, best.key)
    right = (
        kind.inside
        and best is not None
        and submap is not None
        and is_right(submaps.pose(submap), best.transform, truth)
    )
    stages: dict[str, float] = {}
    for stage in found.stages:
        stages[stage.name] = stages.get(stage.name, 0.0) + stage.milliseconds
    return {
        "number": number,
        "milliseconds": milliseconds,
        "verdict": found.verdict,
        "right": right,
        "submap": submap,
        "confidence": 0.0 if best is None else best.confidence,
        "stages": stages,
    }


def summarize(rows: list[dict[str, Any]], *, inside: bool) -> Figures:
    """What became of the queries, and their times.

    `recall` is the share whose first candidate is right, whatever the verdict; `wrong` and `false` count what was
    reported as matched and is not so, `mistaken` names those queries. `first` is for the comparison with rivals, which
    are asked no more than that.
    """
    verdicts = Counter(row["verdict"] for row in rows)
    matched = [row for row in rows if row["verdict"] == "matched"]
    right = sum(row["right"] for row in matched)
    names = dict.fromkeys(name for row in rows for name in row["stages"])
    spent = {name: [row["stages"][name] for row in rows if name in row["stages"]] for name in names}
    return {
        "asked": len(rows),
        "recall": sum(row["right"] for row in rows) / len(rows) if inside else None,
        "matched_right": right,
        "wrong": len(matched) - right if inside else 0,
        "false": 0 if inside else len(matched),
        "ambiguous": verdicts["ambiguous"],
        "no_match": verdicts["no_match"],
        "mistaken": [[row["number"], row["submap"], row["confidence"]] for row in matched if not row["right"]],
        "milliseconds": spread([row["milliseconds"] for row in rows]),
        "first": {str(count): _first(rows[:count]) for count in COMPARED if inside and count <= len(rows)},
        "stages": {name: median(values) for name, values in spent.items()},
        "reached": {name: len(values) / len(rows) for name, values in spent.items()},
    }


def _first(rows: list[dict[str, Any]]) -> Figures:
    return {
        "recall": sum(row["right"] for row in rows) / len(rows),
        "milliseconds": spread([row["milliseconds"] for row in rows]),
    }
