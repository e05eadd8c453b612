"""Poses proposed by correlation: the query turned and shifted over whole submaps, where no feature is intact.

A survey chooses the submaps and rotations to try: in a small collection all of them, in a large one those on which
loosely measured quads agree. That agreement proves nothing, but it leaves few enough to try.
"""

import math
from contextlib import suppress
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import OutOfTime
from urquhart.index.collection_index import CollectionIndex
from urquhart.propose.by_quads import verify_rough
from urquhart.propose.correlation import correlate
from urquhart.propose.quad_consensus import TURN, QuadConsensus
from urquhart.propose.query import READ_TOGETHER, Proposal, Query


class SurveyNumbers(NamedTuple):
    """How far a survey goes, and when it is worth its time. Chosen by hand, not fitted, unless a field says
    otherwise."""

    peaks: int = 8
    """Peaks of a correlation over all rotations that are refined."""
    fewer_peaks: int = 6
    """Peaks of a correlation over a few rotations that are refined."""
    circle: float = 12.0
    """A correlation under every rotation takes as long as this many near a single one."""
    reached: float = 0.02
    """Least share of a collection that a survey must reach. In a larger one the right place, which neither polygons nor
    quads found, is hardly ever among those surveyed: measured, 17 of 380 queries with 0.5 to 0.6 m of noise in 10,000
    submaps; no command repeats it."""
    most_landmarks: int = 500_000
    """Landmarks of submaps after which a correlation reads no more of them: they take 100 MB."""


SURVEY: Final = SurveyNumbers()

Place = tuple[int, float, float]
"""A submap's key, and the rotations to try in it: their middle and how far they go to either side, radians."""
Peaks = tuple[int, NDArray[np.float64]]
"""A submap's key, and the poses (P, 4) that stand out in it; see `correlation.correlate`."""


def is_large(index: CollectionIndex) -> bool:
    """Whether a survey would reach too few of the submaps."""
    return len(index) * SURVEY.reached > index.config.survey


def is_small(index: CollectionIndex) -> bool:
    """Whether every submap can be tried under every rotation in the time that a survey may take."""
    return len(index) * SURVEY.circle <= index.config.survey


def propose_by_correlation(query: Query, index: CollectionIndex, quads: QuadConsensus | None) -> list[Proposal]:
    """The submaps in which the query stands out most from chance when it is laid over them as a whole.

    Args:
        quads: a search for loosely measured quads, which chooses rotations in a large collection.
    """
    with query.trace.timed("survey") as counts:
        places = _survey(query, index, quads)
        counts["places"] = len(places)
    with query.trace.timed("exhaustive") as counts:
        found = _correlate(query, places)
        counts["peaks"] = sum(len(peaks) for _, peaks in found)
    with query.trace.timed("verify exhaustive") as counts:
        proposals = []
        with suppress(OutOfTime):
            for key, peaks in found[: query.config.sweeps]:
                verified = verify_rough(query, key, np.ascontiguousarray(peaks[:, :3]))
                proposals.append(Proposal(key, "exhaustive", len(peaks), verified))
        counts["candidates"] = len(proposals)
    return proposals


def _survey(query: Query, index: CollectionIndex, quads: QuadConsensus | None) -> list[Place]:
    """The submaps and rotations to try, the most promising first."""
    if quads is None or is_small(index):
        return [(key, 0.0, math.pi) for key in index]
    query.trace.skip("exhaustive_rest")
    slots, rotations = quads.turns(query.config.survey)
    return [(key, yaw, TURN) for key, yaw in zip(index.keys_of(slots), rotations.tolist(), strict=True)]


def _correlate(query: Query, places: list[Place]) -> list[Peaks]:
    """What stands out at each of `places`, the strongest first, as far as time and memory allow."""
    found = list[Peaks]()
    with suppress(OutOfTime):
        read = 0
        for begin in range(0, len(places), READ_TOGETHER):
            if read > SURVEY.most_landmarks:
                query.trace.skip("exhaustive_rest")
                break
            block = places[begin : begin + READ_TOGETHER]
            query.read(key for key, _, _ in block)
            for key, yaw, half in block:
                read += len(query.submaps.features(key).landmarks)
                count = SURVEY.peaks if half == math.pi else SURVEY.fewer_peaks
                peaks = correlate(query.grid, query.submaps.grid(key), count, yaw, half, query.budget)
                if len(peaks):
                    found.append((key, peaks))
    # What stands out by the landmarks as a whole is judged by itself: the votes of quads no longer count.
    return sorted(found, key=lambda one: -one[1][0, 3])
