"""From an observation to verified poses: four ways to propose a transform, one way to verify it."""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from urquhart.collection_index import CollectionIndex
from urquhart.features import Features
from urquhart.matching import match_landmarks
from urquhart.pairing import Pattern
from urquhart.quads import measure
from urquhart.ransac import ransac
from urquhart.stages import Stages
from urquhart.sweep import glance, settle_peaks
from urquhart.verification import LOOSE, Verified, best_hypotheses, verify, verify_best
from urquhart.voting import TURN, Votes, rank_turns, vote_polygons, vote_quads

Level = Literal["polygons", "quads", "sweep", "paper", "given"]

_PEAKS: Final = 8
"""Peaks of a sweep over all rotations that are refined;"""
_FEWER: Final = 6
"""of one over a few;"""
_SWEPT: Final = 2
"""and those of them that are verified."""
_CIRCLE: Final = 12.0
"""A sweep under every rotation takes as long as so many near a single one."""
_LOOSER: Final = 3.0
"""Usual errors of a coordinate that a length of a quad may be off by in a survey."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A verified pose in one submap: the submap's key, what proposed it, how many features voted for it."""

    key: int
    level: Level
    votes: int
    verified: Verified


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """An observation under look-up.

    Attributes:
        features, pattern: what is known of it, and the same laid out for verification.
        excluded: submaps that are not considered.
        volume: logarithm of the volume of all poses there are to choose from; see `confidence.log_volume`.
    """

    features: Features
    pattern: Pattern
    excluded: frozenset[int]
    volume: float


def propose_by_polygons(index: CollectionIndex, query: Sighting, stages: Stages) -> list[Proposal]:
    """Polygons with the same number of vertices and a near descriptor, each aligned into a transform."""
    features, config = query.features, index.config
    with stages.timed("search polygons") as counts:
        vertex_counts = features.tessellation.vertex_counts()
        found = list(index.polygons.search(vertex_counts, features.descriptors, neighbours=config.neighbours))
        counts["hits"] = sum(len(hits.keys) for hits in found)
    with stages.timed("vote polygons") as counts:
        votes = vote_polygons(features, found, 2.0 * config.sigma, query.excluded)
        counts["submaps"] = len(votes.keys)
    return _verify(index, votes, "polygons", query, stages)


def propose_by_quads(index: CollectionIndex, query: Sighting, stages: Stages) -> list[Proposal]:
    """Quads whose five lengths agree within the tolerance, in the submaps where they agree on a rotation."""
    features, config = query.features, index.config
    tolerance = 2.0 * config.sigma
    with stages.timed("search quads") as counts:
        lengths, directions = measure(features.landmarks, features.tessellation.quads)
        hits = index.quads.search(lengths, directions, tolerance, config.quad_hits)
        counts["hits"] = len(hits.keys)
    with stages.timed("vote quads") as counts:
        votes = vote_quads(features, hits, index.features, tolerance, config.candidates, query.excluded)
        counts["submaps"] = len(votes.keys)
    return _verify(index, votes, "quads", query, stages)


def propose_by_sweep(index: CollectionIndex, query: Sighting, stages: Stages) -> list[Proposal]:
    """The query turned and shifted over submaps as a whole, where no feature of either is whole enough.

    Over all of a small collection under every rotation; in a large one near the rotations that quads agree on when each
    length may be off by more, which is no proof of anything but leaves few enough to try.
    """
    with stages.timed("survey") as counts:
        if len(index) * _CIRCLE <= index.config.survey:
            places = [(key, 0.0, math.pi) for key in index if key not in query.excluded]
        else:
            places = _survey(index, query)
        counts["places"] = len(places)
    with stages.timed("sweep") as counts:
        swept = []
        for key, yaw, half in places:
            peaks = glance(query.pattern, index.pattern(key), _PEAKS if half == math.pi else _FEWER, yaw, half)
            if len(peaks):
                swept.append((key, peaks))
        # What stands out by the landmarks as a whole is judged by itself: the votes do not count any more.
        swept.sort(key=lambda found: -found[1][0, 3])
        counts["peaks"] = sum(len(peaks) for _, peaks in swept)
    with stages.timed("verify sweep") as counts:
        proposals = []
        for key, peaks in swept[: index.config.sweeps]:
            laid = index.pattern(key)
            # Peaks are good to a cell: their partners are sought far away first.
            settled = settle_peaks(query.pattern, laid, peaks, LOOSE * index.reach)
            starts = best_hypotheses(query.pattern, laid, settled, index.reach, _SWEPT)
            best = verify_best(query.pattern, laid, starts, index.reach)
            proposals.append(Proposal(key, "sweep", len(peaks), best))
        counts["candidates"] = len(proposals)
    return proposals


def _survey(index: CollectionIndex, query: Sighting) -> list[tuple[int, float, float]]:
    """Submaps, each with a rotation to look about, as loosely measured quads have it; the likeliest first."""
    features, config = query.features, index.config
    tolerance = _LOOSER * config.sigma
    hits = index.quads.search(*measure(features.landmarks, features.tessellation.quads), tolerance, config.quad_hits)
    keys, rotations = rank_turns(hits, tolerance, config.survey, query.excluded)
    return [(key, yaw, TURN) for key, yaw in zip(keys.tolist(), rotations.tolist(), strict=True)]


def propose_by_paper(
    index: CollectionIndex, query: Sighting, rng: np.random.Generator, stages: Stages
) -> list[Proposal]:
    """The paper's chain; its pose is then verified like any other, because a vote never accepts itself."""
    features, config = query.features, index.config
    with stages.timed("search polygons") as counts:
        found = index.polygons.search(
            features.tessellation.vertex_counts(),
            features.descriptors,
            neighbours=config.neighbours,
            window=config.vertex_window,
        )
        near = [hits.keys[hits.distances < config.tau**2] for hits in found]
        keys, votes = np.unique(np.concatenate([np.empty(0, np.int64), *near]), return_counts=True)
        counts["submaps"] = len(keys)
    proposals = []
    with stages.timed("match and verify") as counts:
        ranking = np.argsort(-votes, kind="stable").tolist()
        chosen = [i for i in ranking if int(keys[i]) not in query.excluded][: config.candidates]
        counts["candidates"] = len(chosen)
        for i in chosen:
            verified = _paper_pose(index, int(keys[i]), query, rng)
            if verified is not None:
                proposals.append(Proposal(int(keys[i]), "paper", int(votes[i]), verified))
        counts["poses"] = len(proposals)
    return proposals


def _paper_pose(index: CollectionIndex, key: int, query: Sighting, rng: np.random.Generator) -> Verified | None:
    config, submap = index.config, index.features(key)
    first, second = match_landmarks(query.features, submap, config, rng)
    if len(first) < config.correspondences:
        return None
    consensus = ransac(
        query.features.landmarks[first],
        submap.landmarks[second],
        rng,
        distance=config.ransac_distance,
        ratio=config.ransac_ratio,
        iterations=config.ransac_iterations,
    )
    return None if consensus is None else verify(query.pattern, index.pattern(key), consensus.transform, index.reach)


def _verify(index: CollectionIndex, votes: Votes, level: Level, query: Sighting, stages: Stages) -> list[Proposal]:
    proposals = []
    with stages.timed(f"verify {level}") as counts:
        keys: NDArray[np.int64] = votes.keys[: index.config.candidates]
        tried = 0
        for i, key in enumerate(keys.tolist()):
            submap = index.pattern(key)
            hypotheses = votes.hypotheses(i)[: index.config.hypotheses]
            tried += len(hypotheses)
            starts = best_hypotheses(query.pattern, submap, hypotheses, index.reach, 1)
            verified = verify_best(query.pattern, submap, starts, index.reach)
            proposals.append(Proposal(key, level, int(votes.counts[i]), verified))
        counts["candidates"], counts["hypotheses"] = len(keys), tried
    return proposals
