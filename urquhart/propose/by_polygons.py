"""Poses proposed by polygons: stored ones with the same number of vertices and a near descriptor, aligned."""

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import DeadlinePassed
from urquhart.index.collection_index import CollectionIndex
from urquhart.propose.by_quads import QUADS
from urquhart.propose.polygon_votes import Votes, vote_polygons
from urquhart.propose.query import Proposal, Query
from urquhart.verify.refinement import best_hypotheses, verify_best


def propose_by_polygons(query: Query, index: CollectionIndex) -> list[Proposal]:
    """Propose poses in the submaps with the most polygon votes: the best of the poses that were voted for.

    Raises:
        Abandoned: nobody waits for the answer any more.
    """
    features, config, trace = query.features, query.config, query.trace
    with trace.timed("search polygons") as counts:
        vertex_counts = features.tessellation.vertex_counts()
        found = list(index.search_polygons(vertex_counts, features.descriptors, config.neighbours, budget=query.budget))
        counts["hits"] = sum(len(hits.keys) for hits in found)
    with trace.timed("vote polygons") as counts:
        votes = vote_polygons(features, query.budget.unless_spent(found), QUADS.tight * config.sigma)
        counts["submaps"] = len(votes.keys)
    with trace.timed("verify polygons") as counts:
        keys: NDArray[np.int64] = votes.keys[: config.candidates]
        proposals = []
        with suppress(DeadlinePassed):
            query.read(keys.tolist())
            for i, key in enumerate(keys.tolist()):
                proposals.append(_best_aligned(query, votes, i, key))
        counts["candidates"] = len(proposals)
    return proposals


def _best_aligned(query: Query, votes: Votes, i: int, key: int) -> Proposal:
    """The best of the poses that polygons voted for in submap `votes.keys[i]`, verified. Raises DeadlinePassed."""
    submap = query.submaps.grid(key)
    hypotheses = votes.hypotheses(i)[: query.config.hypotheses]
    starts = best_hypotheses(query.grid, submap, hypotheses, query.reach, 1, query.budget)
    verified = verify_best(query.grid, submap, starts, query.reach, query.budget)
    return Proposal(key, "polygons", int(votes.counts[i]), verified)
