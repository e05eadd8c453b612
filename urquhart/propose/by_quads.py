"""Poses proposed by quads: submaps in which many quads of the query agree on one pose."""

from contextlib import suppress
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import OutOfTime
from urquhart.index.collection_index import CollectionIndex
from urquhart.propose.hit_buffer import HitBuffer
from urquhart.propose.quad_consensus import QuadConsensus
from urquhart.propose.query import Proposal, Query
from urquhart.verify.evidence import PoseEvidence, evidence_of_row
from urquhart.verify.refinement import refine_rough


class QuadLevelNumbers(NamedTuple):
    """How quads are searched and their poses verified. Chosen by hand, not fitted."""

    tight: float = 2.0
    """Usual errors of a coordinate (`Config.sigma`) that the lengths of a quad may be off by; so may a polygon's
    vertex."""
    loose: float = 3.0
    """The same where nothing was found with `tight`."""
    poses: int = 8
    """Distinct poses of a submap that quads propose."""
    verified: int = 4
    """Rough poses of a submap that are verified, the most promising first."""
    hits_each: int = 4
    """Quad hits that are enough for each submap of a collection, in addition to `Config.quad_hits`."""


QUADS: Final = QuadLevelNumbers()


def search_quads(query: Query, index: CollectionIndex, errors: float, buffer: HitBuffer) -> QuadConsensus:
    """A search for the query's quads whose lengths may be off by so many usual errors of a coordinate.

    It ends every earlier search in the same `buffer`.
    """
    most = query.config.quad_hits + QUADS.hits_each * len(index)
    landmarks, quads = query.features.landmarks, query.features.tessellation.quads
    tolerance = errors * query.config.sigma
    return QuadConsensus(index.quad_shards(), landmarks, quads, tolerance, most, buffer=buffer, budget=query.budget)


def propose_by_quads(
    query: Query, index: CollectionIndex, search: QuadConsensus, share: float, count: int
) -> list[Proposal]:
    """The `count` submaps in which quads agree best on a pose, after a search for `share` of the query's quads."""
    with query.trace.timed("search quads") as counts:
        before = search.hits
        search.advance(share)
        leaders = search.leaders(count, QUADS.poses)
        counts["hits"] = search.hits - before
        if search.is_cut_short:
            query.trace.skip("quad_hits")
        if search.passed_over:
            query.trace.skip("common_quads")
    with query.trace.timed("verify quads") as counts:
        keys = index.keys_of(leaders.slots)
        proposals = []
        with suppress(OutOfTime):
            query.read(keys)
            for key, support, poses in zip(keys, leaders.support.tolist(), leaders.poses, strict=True):
                verified = verify_rough(query, key, poses[~np.isnan(poses[:, 0])])
                proposals.append(Proposal(key, "quads", support, verified))
        counts["candidates"] = len(proposals)
    return proposals


def verify_rough(query: Query, key: int, poses: NDArray[np.float64]) -> PoseEvidence:
    """The best of `poses` (P, 3) in one submap, good to a metre or two, verified.

    Raises:
        OutOfTime: the deadline passed before all were verified.
    """
    submap = query.submaps.grid(key)
    scored = refine_rough(query.grid, submap, poses, query.reach, QUADS.verified, query.budget)
    return evidence_of_row(query.grid, submap, scored)
