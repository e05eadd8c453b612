"""From an observation to verified poses: four ways to propose a transform, one way to verify it."""

from collections.abc import Sequence
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
from urquhart.sweep import sweep
from urquhart.verification import LOOSE, Verified, best_hypotheses, verify
from urquhart.voting import Votes, vote_polygons, vote_quads

Level = Literal["polygons", "quads", "sweep", "paper", "given"]

_PEAKS: Final = 24
"""Peaks of a sweep that are refined, and those of them that are verified."""
_SWEPT: Final = 3


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


def propose_by_sweep(index: CollectionIndex, query: Sighting, keys: Sequence[int], stages: Stages) -> list[Proposal]:
    """Every rotation and shift of the query over each of a few submaps, where no feature of either is whole enough."""
    proposals = []
    with stages.timed("sweep") as counts:
        for key in keys:
            laid = index.pattern(key)
            # Peaks are good to a cell: their partners are sought far away first.
            hypotheses = sweep(query.pattern, laid, _PEAKS, LOOSE * index.reach)
            if len(hypotheses):
                starts = best_hypotheses(query.pattern, laid, hypotheses, index.reach, _SWEPT)
                best = max(
                    (verify(query.pattern, laid, start, index.reach) for start in starts), key=lambda v: v.evidence
                )
                proposals.append(Proposal(key, "sweep", len(hypotheses), best))
        counts["submaps"] = len(keys)
    return proposals


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
            [start] = best_hypotheses(query.pattern, submap, hypotheses, index.reach, 1)
            verified = verify(query.pattern, submap, start, index.reach)
            proposals.append(Proposal(key, level, int(votes.counts[i]), verified))
        counts["candidates"], counts["hypotheses"] = len(keys), tried
    return proposals
