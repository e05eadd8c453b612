"""From an observation to verified poses: four ways to propose a transform, one way to verify it."""

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import Budget, OutOfTime
from urquhart.features.describe import Features
from urquhart.index.collection_index import CollectionIndex
from urquhart.paper.matching import match_landmarks
from urquhart.paper.ransac import ransac
from urquhart.propose.correlation import glance
from urquhart.propose.polygon_votes import Votes, vote_polygons
from urquhart.propose.quad_consensus import TURN, Consensus, Room
from urquhart.propose.submaps import Submaps
from urquhart.trace import Stages
from urquhart.verify.evidence import Verified, best_hypotheses, settle_rough, verify, verify_best, weigh_settled
from urquhart.verify.pairing import Pattern

Level = Literal["polygons", "quads", "sweep", "paper", "given"]

TIGHT: Final = 2.0
"""Usual errors of a coordinate that a length of a quad may be off by, and a polygon's vertex,"""
WIDE: Final = 3.0
"""and where nothing has been found so."""
_POSES: Final = 8
"""Distinct poses of a submap that quads propose,"""
_SETTLED: Final = 4
"""and those of them, or of the peaks of a sweep, that are verified."""
_PEAKS: Final = 8
"""Peaks of a sweep over all rotations that are refined;"""
_FEWER: Final = 6
"""of one over a few."""
_CIRCLE: Final = 12.0
"""A sweep under every rotation takes as long as so many near a single one."""
_REACHED: Final = 0.02
"""Least share of a collection that a survey must reach to be worth its time: in a larger one the right place, where
neither polygons nor quads find it, is hardly ever among the first few hundred."""
_READ: Final = 32
"""Submaps that are read together: far cheaper than one by one, and 0.1 s at most for the largest."""
_SURVEYED: Final = 500_000
"""Landmarks of submaps after which a sweep reads no more of them: they take 100 MB."""
_EACH: Final = 4
"""Quad hits for each submap of a collection that are enough beside `Config.quad_hits`."""


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
        index: what it is looked for in.
        submaps: of the index, as far as the look-up has to do with them.
        volume: logarithm of the volume of all poses there are to choose from; see `confidence.log_volume`.
        budget: until when, and for whom, the look-up goes on.
    """

    features: Features
    pattern: Pattern
    index: CollectionIndex
    submaps: Submaps
    volume: float
    budget: Budget

    def read(self, keys: Iterable[int]) -> None:
        """Read submaps, a few at a time. Raises OutOfTime where the deadline passes meanwhile."""
        wanted = list(keys)
        for begin in range(0, len(wanted), _READ):
            self.budget.check()
            self.submaps.read(wanted[begin : begin + _READ])


def search_quads(query: Sighting, errors: float, room: Room) -> Consensus:
    """A search for the query's quads whose lengths may be off by so many usual errors of a coordinate.

    One that began earlier in the same `room` is over.
    """
    config, index = query.index.config, query.index
    most = config.quad_hits + _EACH * len(index)
    features = query.features
    quads = features.tessellation.quads
    return Consensus(index.lots(), features.landmarks, quads, errors * config.sigma, most, room, query.budget)


def propose_by_quads(query: Sighting, search: Consensus, share: float, count: int, stages: Stages) -> list[Proposal]:
    """The `count` submaps in which quads agree best on a pose, when `share` of the query's have been looked for."""
    with stages.timed("search quads") as counts:
        before = search.hits
        search.advance(share)
        leaders = search.leaders(count, _POSES)
        counts["hits"] = search.hits - before
        if search.is_cut_short:
            stages.skip("quad_hits")
        if search.passed_over:
            stages.skip("common_quads")
    with stages.timed("verify quads") as counts:
        keys = query.index.keys_of(leaders.slots)
        proposals = []
        with suppress(OutOfTime):
            query.read(keys)
            for key, votes, poses in zip(keys, leaders.votes.tolist(), leaders.poses, strict=True):
                proposals.append(Proposal(key, "quads", votes, _settled(query, key, poses[~np.isnan(poses[:, 0])])))
        counts["candidates"] = len(proposals)
    return proposals


def propose_by_polygons(query: Sighting, stages: Stages) -> list[Proposal]:
    """Polygons with the same number of vertices and a near descriptor, each aligned into a transform."""
    features, config = query.features, query.index.config
    with stages.timed("search polygons") as counts:
        vertex_counts = features.tessellation.vertex_counts()
        hits_by_count = query.index.search_polygons(vertex_counts, features.descriptors, config.neighbours)
        found = list(query.budget.unless_spent(hits_by_count))
        counts["hits"] = sum(len(hits.keys) for hits in found)
    with stages.timed("vote polygons") as counts:
        votes = vote_polygons(features, query.budget.unless_spent(found), TIGHT * config.sigma)
        counts["submaps"] = len(votes.keys)
    with stages.timed("verify polygons") as counts:
        keys: NDArray[np.int64] = votes.keys[: config.candidates]
        proposals = []
        with suppress(OutOfTime):
            query.read(keys.tolist())
            for i, key in enumerate(keys.tolist()):
                proposals.append(_aligned(query, votes, i, key))
        counts["candidates"] = len(proposals)
    return proposals


def propose_by_sweep(query: Sighting, search: Consensus | None, stages: Stages) -> list[Proposal]:
    """The query turned and shifted over submaps as a whole, where no feature of either is whole enough.

    Over all of a small collection under every rotation; in a large one near the rotations that the quads of `search`
    agree on, which is no proof of anything but leaves few enough to try.
    """
    config = query.index.config
    with stages.timed("survey") as counts:
        if search is None or is_small(query.index):
            places = [(key, 0.0, math.pi) for key in query.index]
        else:
            stages.skip("exhaustive_rest")
            slots, rotations = search.turns(config.survey)
            places = [(key, yaw, TURN) for key, yaw in zip(query.index.keys_of(slots), rotations.tolist(), strict=True)]
        counts["places"] = len(places)
    with stages.timed("sweep") as counts:
        swept = list[tuple[int, NDArray[np.float64]]]()
        with suppress(OutOfTime):
            read = 0
            for begin in range(0, len(places), _READ):
                if read > _SURVEYED:
                    stages.skip("exhaustive_rest")
                    break
                query.read(key for key, _, _ in places[begin : begin + _READ])
                for key, yaw, half in places[begin : begin + _READ]:
                    read += len(query.submaps.features(key).landmarks)
                    count = _PEAKS if half == math.pi else _FEWER
                    peaks = glance(query.pattern, query.submaps.pattern(key), count, yaw, half, query.budget)
                    if len(peaks):
                        swept.append((key, peaks))
        # What stands out by the landmarks as a whole is judged by itself: the votes do not count any more.
        swept.sort(key=lambda found: -found[1][0, 3])
        counts["peaks"] = sum(len(peaks) for _, peaks in swept)
    with stages.timed("verify sweep") as counts:
        proposals = []
        with suppress(OutOfTime):
            for key, peaks in swept[: config.sweeps]:
                settled = _settled(query, key, np.ascontiguousarray(peaks[:, :3]))
                proposals.append(Proposal(key, "sweep", len(peaks), settled))
        counts["candidates"] = len(proposals)
    return proposals


def is_large(index: CollectionIndex) -> bool:
    """Whether a survey would reach too few of the submaps."""
    return len(index) * _REACHED > index.config.survey


def is_small(index: CollectionIndex) -> bool:
    """Whether every submap can be swept under every rotation in the time that a survey may take."""
    return len(index) * _CIRCLE <= index.config.survey


def propose_by_paper(query: Sighting, rng: np.random.Generator, stages: Stages) -> list[Proposal]:
    """The paper's chain; its pose is then verified like any other, because a vote never accepts itself."""
    features, config = query.features, query.index.config
    with stages.timed("search polygons") as counts:
        found = query.index.search_polygons(
            features.tessellation.vertex_counts(), features.descriptors, config.neighbours, config.vertex_window
        )
        near = [hits.keys[hits.distances < config.tau**2] for hits in query.budget.unless_spent(found)]
        keys, votes = np.unique(np.concatenate([np.empty(0, np.int64), *near]), return_counts=True)
        counts["submaps"] = len(keys)
    proposals = []
    with stages.timed("match and verify") as counts:
        chosen = np.argsort(-votes, kind="stable")[: config.candidates].tolist()
        counts["candidates"] = len(chosen)
        with suppress(OutOfTime):
            query.read(keys[chosen].tolist())
            for i in chosen:
                verified = _paper_pose(query, int(keys[i]), rng)
                if verified is not None:
                    proposals.append(Proposal(int(keys[i]), "paper", int(votes[i]), verified))
        counts["poses"] = len(proposals)
    return proposals


def _paper_pose(query: Sighting, key: int, rng: np.random.Generator) -> Verified | None:
    config, submap = query.index.config, query.submaps.features(key)
    first, second = match_landmarks(query.features, submap, config, rng, query.budget)
    if len(first) < config.correspondences:
        return None
    consensus = ransac(
        query.features.landmarks[first],
        submap.landmarks[second],
        rng,
        distance=config.ransac_distance,
        ratio=config.ransac_ratio,
        iterations=config.ransac_iterations,
        budget=query.budget,
    )
    if consensus is None:
        return None
    submap_pattern = query.submaps.pattern(key)
    return verify(query.pattern, submap_pattern, consensus.transform, query.index.reach, query.budget)


def _settled(query: Sighting, key: int, poses: NDArray[np.float64]) -> Verified:
    """The best of rough `poses` (P, 3) in one submap, verified."""
    submap, reach = query.submaps.pattern(key), query.index.reach
    settled = settle_rough(query.pattern, submap, poses, reach, _SETTLED, query.budget)
    return weigh_settled(query.pattern, submap, settled)


def _aligned(query: Sighting, votes: Votes, i: int, key: int) -> Proposal:
    """The best of the transforms that polygons voted for in submap `votes.keys[i]`, verified."""
    submap, reach = query.submaps.pattern(key), query.index.reach
    hypotheses = votes.hypotheses(i)[: query.index.config.hypotheses]
    starts = best_hypotheses(query.pattern, submap, hypotheses, reach, 1, query.budget)
    verified = verify_best(query.pattern, submap, starts, reach, query.budget)
    return Proposal(key, "polygons", int(votes.counts[i]), verified)
