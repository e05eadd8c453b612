"""Poses of submaps from relative poses, some of which may be false: one consistent map, or several parts of one.

1. Constraints that close short cycles confirm each other (`agreement`).
2. Constraints that confirm each other form groups, which are added to the trusted ones, the largest first, as long as
   they agree (`consistency`). Graduated non-convexity then leaves out single outliers (`graph_solver`).
3. What is left over may join parts that nothing connects (`joining`), and is otherwise judged by the poses so far.
4. Everything that was kept is optimised together, and gives covariances.

Parts that no constraint connects stay frames of their own: nothing is known of how they lie to each other.
"""

from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from urquhart.mapping.agreement import Agreements, find_agreements
from urquhart.mapping.consistency import consistent_groups
from urquhart.mapping.graph_solver import GraphSolver, optimiser, residuals
from urquhart.mapping.joining import Judge, join
from urquhart.mapping.pose_arrays import (
    Covariances,
    Poses,
    adjoints,
    compose,
    congruent,
    inverse,
    rotations,
    squared_distances,
)
from urquhart.mapping.pose_graph import CentredGraph, PoseConstraints, centred
from urquhart.mapping.start_poses import anchors, parts
from urquhart.pose_covariance import PoseUncertainty
from urquhart.se2 import SE2

Refusal = Literal["contradicted", "unconfirmed"]
"""Why a constraint is left out: it is off from what the others say, or nothing says whether it is right."""


class MappingNumbers(NamedTuple):
    """What a constraint must pass. Chosen by hand; `make bench-maps` shows what they do."""

    probability: float = 0.999
    """Share of right constraints that pass the gate: a squared Mahalanobis distance of 16.3."""
    agreeing: int = 2
    """Constraints that must agree before any of them is believed; 1 believes whatever contradicts nothing."""
    false_share: float = 0.01
    """Where more of the constraints that can be checked are false, those that cannot be checked are refused."""
    contradictions: int = 3
    """Cycles that do not close, and none that does, from which on a constraint counts as checked and false."""
    sharp: float = 2.0
    """Metres: poses known to this standard deviation can tell whether a constraint is right; others cannot."""
    honest: float = 1.5
    """Covariances are taken as they are unless cycles are off by more than this many times their variance. Cycles have
    constraints in common: with 200 honest constraints, the median was 1.25 times too large."""
    rounds: int = 5
    """Most times that constraints beyond the gate are left out and the rest is optimised again."""


MAPPING: Final = MappingNumbers()


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
    gate = _chi_squared(numbers.probability)
    graph = centred(count, constraints)
    cycles = find_agreements(graph, gate)
    scale = _scale(cycles)
    graph = _scaled(graph, scale)
    support = cycles.support(len(constraints))
    believed, poses = consistent_groups(graph, cycles, support, gate, numbers.agreeing - 1)
    poses, kept = _without_outliers(graph, believed, poses, gate)
    false = (support == 0) & (cycles.compared(len(constraints)) >= numbers.contradictions) & ~graph.trusted
    false |= believed & ~kept
    share = false.sum() / max(int((false | (kept & ~graph.trusted)).sum()), 1)
    judge = Judge(gate, numbers.sharp, numbers.agreeing == 1 or bool(share <= numbers.false_share))
    joined, poses = join(graph, kept, ~kept & ~false & ~graph.secondary, poses, judge)
    kept |= joined
    solver, poses = _solve(graph, kept, poses)
    more = _confirmed(graph, solver, poses, ~kept, judge)
    if more.any():
        kept |= more
        solver, poses = _solve(graph, kept, poses)
    for _ in range(numbers.rounds):
        off = kept & ~graph.trusted & (squared_distances(residuals(graph, poses), graph.covariances) > gate)
        if not off.any():
            break
        kept &= ~off
        solver, poses = _solve(graph, kept, poses)
    return _result(graph, solver, poses, _Outcome(kept, false, support, scale, gate))


def _chi_squared(probability: float) -> float:
    """The quantile of the chi-squared distribution with three degrees of freedom."""
    return 2.0 * float(gammaincinv(1.5, probability))


def _scale(cycles: Agreements) -> float:
    """How much larger the covariances of untrusted constraints must be for the cycles that they close, at least 1."""
    distances = cycles.distances[cycles.close & cycles.plain]
    scale = float(np.median(distances) / _chi_squared(0.5)) if len(distances) else 1.0
    return scale if scale > MAPPING.honest else 1.0


def _scaled(graph: CentredGraph, scale: float) -> CentredGraph:
    """The same graph with covariances of matches, which are neither trusted nor priors, that are `scale` as large."""
    factor = np.where(graph.trusted | graph.is_prior, 1.0, scale)
    return replace(graph, covariances=factor[:, None, None] * graph.covariances)


def _without_outliers(
    graph: CentredGraph, believed: NDArray[np.bool_], poses: Poses, gate: float
) -> tuple[Poses, NDArray[np.bool_]]:
    """Poses (V, 3) from the constraints that are believed, and which (E,) of these are consistent."""
    used = np.flatnonzero(believed)
    if graph.trusted[used].all():
        return poses, believed.copy()
    held = anchors(graph, parts(graph, believed))
    solver = GraphSolver(graph, used, held.tolist(), poses)
    poses, consistent = solver.graduate(0.5 * gate, graph.trusted[used])
    kept = np.zeros(len(believed), np.bool_)
    kept[used[consistent]] = True
    return poses, kept


def _solve(graph: CentredGraph, kept: NDArray[np.bool_], poses: Poses) -> tuple[GraphSolver, Poses]:
    """The optimum under the constraints that are kept, each part in the frame of its anchor."""
    part = parts(graph, kept)
    held = anchors(graph, part)
    home = np.column_stack([graph.centres, np.zeros(graph.count)])[held]
    shift = compose(home, inverse(poses[held]))
    solver = GraphSolver(graph, np.flatnonzero(kept), held.tolist(), compose(shift[part], poses))
    return solver, solver.solve()


def _confirmed(
    graph: CentredGraph, solver: GraphSolver, poses: Poses, left: NDArray[np.bool_], judge: Judge
) -> NDArray[np.bool_]:
    """Which constraints (E,) of those that are left agree with the poses (V, 3), known well enough to tell."""
    part = parts(graph, solver.used_mask)
    asked = np.flatnonzero(left & (part[graph.first] == part[graph.second]))
    found = np.zeros(len(left), np.bool_)
    if not len(asked):
        return found
    # Whatever their correlation, the covariance of a difference is at most twice the sum of the covariances. Most false
    # constraints are farther off than that.
    own, errors = solver.covariances(), residuals(graph, poses)
    back = adjoints(compose(inverse(poses[graph.second[asked]]), poses[graph.first[asked]]))
    widest = 2.0 * (congruent(back, own[graph.first[asked]]) + own[graph.second[asked]])
    asked = asked[squared_distances(errors[asked], graph.covariances[asked] + widest) <= judge.gate]
    known = solver.relative_covariances(graph.first[asked], graph.second[asked])
    distances = squared_distances(errors[asked], graph.covariances[asked] + known)
    is_sharp = np.linalg.eigvalsh(known[:, :2, :2])[:, -1] <= judge.sharp**2
    found[asked] = (distances <= judge.gate) & (is_sharp | judge.alone)
    return found


class _Outcome(NamedTuple):
    """What became of the constraints (E,): those kept, those known to be false, and how many others confirm each."""

    kept: NDArray[np.bool_]
    false: NDArray[np.bool_]
    support: NDArray[np.int64]
    scale: float
    gate: float


def _result(graph: CentredGraph, solver: GraphSolver, poses: Poses, outcome: _Outcome) -> OptimisedPoses:
    part = parts(graph, outcome.kept)
    own = solver.covariances()
    errors = residuals(graph, poses)
    same = part[graph.first] == part[graph.second]
    distances = np.where(same, np.sqrt(squared_distances(errors, graph.covariances)), np.nan)
    off = outcome.false | (same & (distances**2 > outcome.gate))
    refusals: tuple[Refusal | None, ...] = tuple(
        None if used else ("contradicted" if is_off else "unconfirmed")
        for used, is_off in zip(outcome.kept.tolist(), off.tolist(), strict=True)
    )
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
        outcome.support,
        outcome.scale,
    )
