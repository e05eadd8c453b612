"""Poses proposed by quads, in the submaps in which many quads of the query agree on one pose."""

from contextlib import suppress
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import DeadlinePassed
from urquhart.index.collection_index import CollectionIndex
from urquhart.index.quad_table import measure_quads
from urquhart.propose.hit_buffer import HitBuffer
from urquhart.propose.quad_consensus import QuadConsensus
from urquhart.propose.query import Proposal, Query
from urquhart.verify.evidence import PoseEvidence, evidence_of_row
from urquhart.verify.refinement import refine_rough


class QuadLevelNumbers(NamedTuple):
    """How quads are searched and their poses verified. Chosen by hand, not fitted."""

    tight: float = 2.0
    """Tolerance of a quad's lengths, and of the misfit of an aligned polygon, in units of `Config.sigma`."""
    loose: float = 3.0
    """Tolerance of a quad's lengths if nothing was found with `tight`, in units of `Config.sigma`."""
    looser: float = 4.0
    """The same in a last search of a large collection with full effort. With 40 cm of noise and 80 % of the trees, 994
    of 1,000 places among 100,000 submaps are found with `loose`, and the other six with this, ranked first."""
    poses: int = 8
    """Most distinct poses that quads propose in a submap."""
    verified: int = 4
    """Most of these poses that are verified, the most promising first."""
    hits_each: int = 4
    """Quad hits for each submap of a collection after which a search ends, in addition to `Config.quad_hits`."""


QUADS: Final = QuadLevelNumbers()


def search_quads(query: Query, index: CollectionIndex, errors: float, buffer: HitBuffer) -> QuadConsensus:
    """Begin a search for the query's quads.

    Args:
        errors: tolerance of the lengths, in units of `Config.sigma`.
        buffer: memory for the hits. An earlier search with the same buffer must not be used any more.
    """
    most = query.config.quad_hits + QUADS.hits_each * len(index)
    shapes = measure_quads(query.features.landmarks, query.features.tessellation.quads)
    tolerance = errors * query.config.sigma
    return QuadConsensus(index.quad_shards(), shapes, tolerance, most, buffer=buffer, budget=query.budget)


class QuadChoice(NamedTuple):
    """Which quads are searched for, and where the poses that they agree on are verified.

    Attributes:
        share: of the query's quads that are searched for, the rarest first.
        submaps: most submaps in which poses are verified: those in which quads agree best.
        least: quads that agree on the best pose of each of these submaps, or more.
        poses: most distinct poses of a submap.
    """

    share: float
    submaps: int
    least: int = 1
    poses: int = QUADS.poses


def propose_by_quads(query: Query, index: CollectionIndex, search: QuadConsensus, choice: QuadChoice) -> list[Proposal]:
    """Continue a search for quads, and propose poses on which they agree.

    Raises:
        Abandoned: nobody waits for the answer any more.
    """
    with query.trace.timed("search quads") as counts:
        before = search.hits
        search.advance(choice.share, choice.least)
        leaders = search.leaders(choice.submaps, choice.poses, choice.least)
        counts["hits"] = search.hits - before
        if search.is_cut_short:
            query.trace.skip("quad_hits")
        if search.passed_over:
            query.trace.skip("common_quads")
    with query.trace.timed("verify quads") as counts:
        keys = index.keys_of(leaders.slots)
        proposals = []
        with suppress(DeadlinePassed):
            query.read(keys)
            for key, support, poses in zip(keys, leaders.support.tolist(), leaders.poses, strict=True):
                verified = verify_rough(query, key, poses[~np.isnan(poses[:, 0])])
                proposals.append(Proposal(key, "quads", support, verified))
        counts["candidates"] = len(proposals)
    return proposals


def verify_rough(query: Query, key: int, poses: NDArray[np.float64]) -> PoseEvidence:
    """Verify rough poses in submap `key`, and return the best.

    Args:
        poses: (P, 3), P > 0: x, y, yaw of `submap_T_query`, centred frames, right to a metre or two.

    Raises:
        DeadlinePassed: the deadline passed first.
    """
    submap = query.submaps.grid(key)
    scored = refine_rough(query.grid, submap, poses, query.reach, QUADS.verified, query.budget)
    return evidence_of_row(query.grid, submap, scored)
