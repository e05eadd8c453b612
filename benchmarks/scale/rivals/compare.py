"""A rival on the database's submaps and the first queries from inside: what it finds, and what that costs."""

import time
from collections.abc import Callable
from typing import Final

import numpy as np

from benchmarks.scale.asking import is_right
from benchmarks.scale.measurement import Figures, Measurement, Steps, memory, spread
from benchmarks.scale.observations import Observations
from benchmarks.scale.rivals.brute import ExhaustiveRival
from benchmarks.scale.rivals.quads import QuadRival
from benchmarks.scale.rivals.rival import CONFIG, REACHED, Described, RivalMethod, RivalRanking
from benchmarks.scale.rivals.triangles import TriangleRival
from benchmarks.scale.tiled_forest import KINDS, PLAIN, World
from server.platform.thread_limits import pin_threads
from urquhart import SE2, describe, warm_up
from urquhart.verify.evidence import PoseEvidence
from urquhart.verify.refinement import best_hypotheses, verify_best

_MADE: Final[dict[str, Callable[[], RivalMethod]]] = {
    "rival-quads": QuadRival,
    "rival-triangles": TriangleRival,
    "rival-exhaustive": ExhaustiveRival,
}


def run(measurement: Measurement) -> Figures:
    """Build the rival's index of all submaps and ask it."""
    submaps = Observations.load(measurement.room, measurement.submaps_name)
    rival = _MADE[measurement.part]()
    warm_up(CONFIG)
    begun, steps = time.perf_counter(), Steps("taken in", len(submaps))
    for i in range(len(submaps)):
        rival.add(describe(submaps.xy(i), CONFIG))
        steps.done(i)
    rival.build()
    built = time.perf_counter() - begun
    pin_threads()
    kinds = [kind for kind in PLAIN if KINDS[kind].inside]
    return {
        "asked": measurement.asked,
        "build_seconds": built,
        "bytes": rival.nbytes() / len(submaps),
        "kinds": {kind: _ask_all(measurement, rival, submaps, kind) for kind in kinds},
        "memory": memory(),
    }


def _ask_all(measurement: Measurement, rival: RivalMethod, submaps: Observations, kind: str) -> Figures:
    queries, world = Observations.load(measurement.room, kind), World(measurement.submaps, measurement.seed)
    listed, right = 0, 0
    search, verification, whole = list[float](), list[float](), list[float]()
    steps = Steps(f"asked, {measurement.part}", measurement.asked)
    # The first query pays for compiling: it is asked once more, and counted only then.
    for count, number in enumerate([0, *range(measurement.asked)]):
        truth = queries.pose(number)
        start = time.perf_counter()
        query = Described.of(describe(queries.xy(number), CONFIG))
        looked = time.perf_counter()
        ranking = rival.rank(query, CONFIG.candidates)
        ranked = time.perf_counter()
        # Any real system has these features at hand.
        there = [Described.of(describe(submaps.xy(k), CONFIG)) for k in ranking.submaps.tolist()]
        again = time.perf_counter()
        best = _verify(rival, query, ranking, there)
        verified = time.perf_counter()
        if count == 0:
            continue
        search.append(1e3 * (ranked - looked))
        verification.append(1e3 * (verified - again))
        whole.append(1e3 * (ranked - start + verified - again))
        listed += int(world.nearest(truth.x, truth.y) in ranking.submaps)
        if best is not None:
            at, found = best
            pose = SE2.shift(there[at].features.origin) @ found.transform @ SE2.shift(query.features.origin).inverse()
            right += int(is_right(submaps.pose(int(ranking.submaps[at])), pose, truth))
        steps.done(number)
    return {
        "listed": listed / measurement.asked,
        "recall": right / measurement.asked,
        "search": spread(search),
        "verify": spread(verification),
        "milliseconds": spread(whole),
    }


def _verify(
    rival: RivalMethod, query: Described, ranking: RivalRanking, there: list[Described]
) -> tuple[int, PoseEvidence] | None:
    """The pose with most evidence in any of the submaps of a ranking, and which of them that is."""
    best: tuple[int, PoseEvidence] | None = None
    for at, submap in enumerate(there):
        poses = rival.poses(query, ranking, at, submap)
        if len(poses):
            starts = best_hypotheses(query.grid, submap.grid, np.ascontiguousarray(poses), REACHED, rival.refined)
            found = verify_best(query.grid, submap.grid, starts, REACHED)
            if best is None or found.evidence > best[1].evidence:
                best = at, found
    return best
