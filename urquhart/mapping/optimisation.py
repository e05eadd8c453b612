"""Poses of submaps from relative poses, some of which may be false: one consistent map, or several parts of one.

1. Constraints that close short cycles confirm each other (`agreement`).
2. Odometry that many independent matches contradict is left out, and so is odometry that contradicts only itself
   (`odometry`).
3. Constraints that confirm each other form groups, which are added to the trusted ones, the largest first, as long as
   they agree (`consistency`). Graduated non-convexity then leaves out single outliers (`graph_solver`).
4. What is left over may join parts that nothing connects (`joining`), and is otherwise judged by the poses so far.
5. Everything that was kept is optimised together, and gives covariances.

Parts that no constraint connects stay frames of their own: nothing is known of how they lie to each other.
"""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.mapping.agreement import Agreements, find_agreements
from urquhart.mapping.consistency import MAPPING, Found, MappingNumbers, chi_squared
from urquhart.mapping.graph_solver import optimiser, residuals
from urquhart.mapping.odometry.chains import unclosed_cycles
from urquhart.mapping.odometry.judging import Contradiction, Judgement, judge_odometry
from urquhart.mapping.odometry.verdicts import judged_map
from urquhart.mapping.pose_arrays import (
    Covariances,
    Poses,
    compose,
    congruent,
    rotations,
    squared_distances,
)
from urquhart.mapping.pose_graph import CentredGraph, PoseConstraints, centred
from urquhart.mapping.start_poses import parts
from urquhart.pose_covariance import PoseUncertainty
from urquhart.se2 import SE2

Refusal = Literal["contradicted", "unconfirmed", "undecided"]
"""Why a constraint is left out: it is off from what the others say; nothing says whether it is right; or it is odometry
that contradicts other odometry, and nothing tells which of them is wrong."""


@dataclass(frozen=True, slots=True, eq=False)
class OptimisedPoses:
    """Poses of all submaps.

    Attributes:
        poses: (S, 3) float64, x, y (metres), yaw (radians) of each submap in the frame of its part.
        part: (S,) int64, the part of each submap, numbered from 0 by its first submap.
        in_map: (K,) bool, whether the frame of a part is the map frame of the priors. Otherwise it is the frame of the
            part's first submap.
        about: (S, 2) float64, metres, submap frame: the point that each covariance is about, among its trees.
        covariances: (S, 3, 3) float64 over (x, y, yaw): of that point along the axes of the frame, and of the yaw. All
            0 for the submap whose frame a part has.
        distances: (E,) float64, the Mahalanobis distance of each constraint from the poses; NaN between two parts.
        offsets: (E, 3) float64, metres and radians: the same as an error in the frame of its second submap.
        refusals: (E,), why a constraint was left out; None for those that were used.
        support: (E,) int64, how many other constraints confirm each in short cycles.
        contradictions: odometry that other constraints contradict. If one of them is `undecided`, the map may be wrong.
        scale: what the covariances of untrusted constraints were multiplied with: the cycles that they close are off by
            the square root of it as much as they say. 1 if the covariances are honest.
    """

    poses: Poses
    part: NDArray[np.int64]
    in_map: NDArray[np.bool_]
    about: NDArray[np.float64]
    covariances: Covariances
    distances: NDArray[np.float64]
    offsets: Poses
    refusals: tuple[Refusal | None, ...]
    support: NDArray[np.int64]
    contradictions: tuple[Contradiction, ...]
    scale: float

    def pose(self, submap: int) -> SE2:
        """`frame_T_submap`, in the frame of the submap's part."""
        return SE2(*self.poses[submap].tolist())

    def uncertainty(self, submap: int) -> PoseUncertainty:
        """The uncertainty of `pose(submap)`."""
        return PoseUncertainty.about_point(self.about[submap], self.pose(submap), self.covariances[submap])


def optimise(count: int, constraints: PoseConstraints, numbers: MappingNumbers = MAPPING) -> OptimisedPoses:
    """The poses of `count` submaps that agree with most of their constraints.

    Raises:
        PoseGraphError: a constraint names no submap, or is not finite, or its covariance is not positive.
        MissingOptimiser: GTSAM is not installed.
    """
    optimiser()
    constraints.check(count)
    gate = chi_squared(numbers.probability)
    graph = centred(count, constraints)
    cycles = find_agreements(graph, gate)
    scale = _scale(cycles)
    graph = _scaled(graph, scale)
    judged = judge_odometry(graph, gate)
    odometry = graph.trusted & ~graph.is_prior & ~judged.refused & ~judged.undecided
    long = unclosed_cycles(graph, odometry)
    judged.undecided[[edge for one in long for edge in one.edges]] = True
    said = [*judged.contradictions, *long]
    while True:
        rest = ~judged.refused & ~judged.undecided
        found, (wrong, open_ones) = judged_map(graph, rest, judged.doubtful, gate, numbers)
        if not wrong:
            break
        judged.refused[[edge for one in wrong for edge in one.edges]] = True
        said += wrong
    return _result(graph, found, _Said(judged, (*said, *open_ones), scale, gate))


def _scale(cycles: Agreements) -> float:
    """How much larger the covariances of untrusted constraints must be for the cycles that they close, at least 1."""
    distances = cycles.distances[cycles.close & cycles.plain]
    scale = float(np.median(distances) / chi_squared(0.5)) if len(distances) else 1.0
    return scale if scale > MAPPING.honest else 1.0


def _scaled(graph: CentredGraph, scale: float) -> CentredGraph:
    """The same graph with covariances of matches, which are neither trusted nor priors, that are `scale` as large."""
    factor = np.where(graph.trusted | graph.is_prior, 1.0, scale)
    return replace(graph, covariances=factor[:, None, None] * graph.covariances)


class _Said(NamedTuple):
    """What was said of odometry, how much larger covariances were made, and the gate."""

    odometry: Judgement
    contradictions: tuple[Contradiction, ...]
    scale: float
    gate: float


def _result(graph: CentredGraph, found: Found, said: _Said) -> OptimisedPoses:
    part, poses = parts(graph, found.kept), found.poses
    own = found.solver.covariances()
    errors = residuals(graph, poses)
    same = part[graph.first] == part[graph.second]
    distances = np.where(same, np.sqrt(squared_distances(errors, graph.covariances)), np.nan)
    off = found.false | said.odometry.refused | (same & (distances**2 > said.gate))
    reasons = np.where(off, "contradicted", "unconfirmed").astype(object)
    reasons[said.odometry.undecided] = "undecided"
    reasons[found.kept] = None
    refusals: tuple[Refusal | None, ...] = tuple(reasons.tolist())
    count = graph.count - 1
    back = np.column_stack([-graph.centres, np.zeros(graph.count)])
    labels, begins, numbers = np.unique(part[:count], return_index=True, return_inverse=True)
    order = np.argsort(begins)
    rank = np.argsort(order)
    in_map = labels[order] == part[graph.map_vertex]
    return OptimisedPoses(
        compose(poses, back)[:count],
        rank[numbers].astype(np.int64),
        np.asarray(in_map),
        graph.centres[:count],
        congruent(rotations(poses[:count, 2]), own[:count]),
        distances,
        np.where(same[:, None], errors, np.nan),
        refusals,
        found.support,
        said.contradictions,
        said.scale,
    )
