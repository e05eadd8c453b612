"""Poses proposed by correlation: the query is laid over whole submaps at every rotation and shift.

It needs no intact feature. A survey chooses the submaps and rotations to try: all of them in a small collection, and in
a larger one those on which quads with loose lengths agree. That agreement proves nothing, but leaves few enough to try.
"""

from contextlib import suppress
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import DeadlinePassed
from urquhart.index.collection_index import CollectionIndex
from urquhart.propose.by_quads import verify_rough
from urquhart.propose.correlation import FULL_TURN, Rotations, correlate
from urquhart.propose.quad_consensus import TURN, QuadConsensus
from urquhart.propose.query import READ_TOGETHER, Proposal, Query


class SurveyNumbers(NamedTuple):
    """How far a survey goes, and when it is worth its time. Chosen by hand, not fitted, unless a field says
    otherwise."""

    peaks: int = 8
    """Peaks that are refined after a correlation over all rotations."""
    fewer_peaks: int = 6
    """Peaks that are refined after a correlation over a few rotations."""
    circle: float = 12.0
    """Cost of a correlation over all rotations, in correlations around a single one."""
    reached: float = 0.02
    """Least share of a collection that a survey must reach. In larger collections, the right place is hardly ever
    among those surveyed if polygons and quads have not found it: measured, 17 of 380 queries with 0.5 to 0.6 m of noise
    in 10,000 submaps; no command repeats it."""
    most_landmarks: int = 500_000
    """Landmarks after which a correlation reads no more submaps: they take 100 MB."""


SURVEY: Final = SurveyNumbers()

SurveyEntry = tuple[int, Rotations]
"""A submap's key, and the rotations to try in it."""
Peaks = tuple[int, NDArray[np.float64]]
"""A submap's key, and the peaks (P, 4) found in it, as `correlation.correlate` returns them."""


def is_large(index: CollectionIndex) -> bool:
    """Whether the index is so large that a survey would reach too few of its submaps."""
    return len(index) * SURVEY.reached > index.config.survey


def is_small(index: CollectionIndex) -> bool:
    """Whether the index is so small that every submap can be tried at every rotation in the time of a survey."""
    return len(index) * SURVEY.circle <= index.config.survey


def propose_by_correlation(query: Query, index: CollectionIndex, quads: QuadConsensus | None) -> list[Proposal]:
    """Propose poses in the submaps in which the correlation peaks stand out most from chance.

    Args:
        quads: the search for quads with loose lengths, which chooses submaps and rotations in a large collection.

    Raises:
        Abandoned: nobody waits for the answer any more.
    """
    with query.trace.timed("survey") as counts:
        surveyed = _survey(query, index, quads)
        counts["places"] = len(surveyed)
    with query.trace.timed("exhaustive") as counts:
        found = _correlate(query, surveyed)
        counts["peaks"] = sum(len(peaks) for _, peaks in found)
    with query.trace.timed("verify exhaustive") as counts:
        proposals = []
        with suppress(DeadlinePassed):
            for key, peaks in found[: query.config.exhaustive_submaps]:
                verified = verify_rough(query, key, np.ascontiguousarray(peaks[:, :3]))
                proposals.append(Proposal(key, "exhaustive", len(peaks), verified))
        counts["candidates"] = len(proposals)
    return proposals


def _survey(query: Query, index: CollectionIndex, quads: QuadConsensus | None) -> list[SurveyEntry]:
    """The submaps and rotations to try, the most promising first."""
    if quads is None or is_small(index):
        return [(key, FULL_TURN) for key in index]
    query.trace.skip("exhaustive_rest")
    slots, rotations = quads.turns(query.config.survey)
    return [(key, Rotations(yaw, TURN)) for key, yaw in zip(index.keys_of(slots), rotations.tolist(), strict=True)]


def _correlate(query: Query, surveyed: list[SurveyEntry]) -> list[Peaks]:
    """The correlation peaks at `surveyed`, the strongest submap first, as far as time and memory allow."""
    found = list[Peaks]()
    with suppress(DeadlinePassed):
        read = 0
        for begin in range(0, len(surveyed), READ_TOGETHER):
            if read > SURVEY.most_landmarks:
                query.trace.skip("exhaustive_rest")
                break
            block = surveyed[begin : begin + READ_TOGETHER]
            query.read(key for key, _ in block)
            for key, rotations in block:
                read += len(query.submaps.features(key).landmarks)
                count = SURVEY.peaks if rotations == FULL_TURN else SURVEY.fewer_peaks
                peaks = correlate(query.grid, query.submaps.grid(key), count, rotations, query.budget)
                if len(peaks):
                    found.append((key, peaks))
    # Peaks are ranked by themselves: the votes of quads only chose where to look.
    return sorted(found, key=lambda one: -one[1][0, 3])
