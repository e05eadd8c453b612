"""Poses proposed by the paper's own matching (section IV): polygons, correspondences, RANSAC."""

from contextlib import suppress

import numpy as np

from urquhart.budget import DeadlinePassed
from urquhart.index.collection_index import CollectionIndex
from urquhart.paper.matching import match_landmarks
from urquhart.paper.ransac import PointPairs, ransac
from urquhart.propose.query import Proposal, Query
from urquhart.verify.evidence import PoseEvidence
from urquhart.verify.refinement import verify


def propose_by_paper(query: Query, index: CollectionIndex, rng: np.random.Generator) -> list[Proposal]:
    """Propose poses by the paper's matching. They are verified like all others: a vote never accepts itself.

    Raises:
        Abandoned: nobody waits for the answer any more.
    """
    features, config = query.features, query.config
    with query.trace.timed("search polygons") as counts:
        counted = features.tessellation.vertex_counts()
        found = index.search_polygons(
            counted, features.descriptors, config.neighbours, config.vertex_window, query.budget
        )
        near = [hits.keys[hits.distances < config.tau**2] for hits in found]
        keys, votes = np.unique(np.concatenate([np.empty(0, np.int64), *near]), return_counts=True)
        counts["submaps"] = len(keys)
    proposals = []
    with query.trace.timed("match and verify") as counts:
        chosen = np.argsort(-votes, kind="stable")[: config.candidates].tolist()
        counts["candidates"] = len(chosen)
        with suppress(DeadlinePassed):
            query.read(keys[chosen].tolist())
            for i in chosen:
                verified = _paper_pose(query, int(keys[i]), rng)
                if verified is not None:
                    proposals.append(Proposal(int(keys[i]), "paper", int(votes[i]), verified))
        counts["poses"] = len(proposals)
    return proposals


def _paper_pose(query: Query, key: int, rng: np.random.Generator) -> PoseEvidence | None:
    """The pose on which correspondences in submap `key` agree, verified; None if there are too few of them.

    Raises:
        DeadlinePassed: the deadline passed first.
    """
    config, submap = query.config, query.submaps.features(key)
    first, second = match_landmarks(query.features, submap, config, rng, query.budget)
    if len(first) < config.correspondences:
        return None
    consensus = ransac(
        PointPairs(query.features.landmarks[first], submap.landmarks[second], config.ransac_distance),
        rng,
        ratio=config.ransac_ratio,
        iterations=config.ransac_iterations,
        budget=query.budget,
    )
    if consensus is None:
        return None
    return verify(query.grid, query.submaps.grid(key), consensus.transform, query.reach, query.budget)
