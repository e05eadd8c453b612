"""The largest consistent set of constraints that confirm each other, found before anything is optimised with all.

Constraints that confirm each other in short cycles form groups. The true ones of a drive form few and large groups;
several false ones that agree, because one place was taken for another more than once, form a small one. So groups are
added one after the other, the largest first. Each must agree with the poses that the constraints so far give, under
their covariance, and after each the poses are optimised again: one true group corrects the drift that hid how false
another one is. A start from all constraints at once ends in a folded map: with 30 % of false loops in groups of three,
graduated non-convexity alone refused most of the right ones (`python -m benchmarks.maps`).
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.special import gammaincinv

from urquhart.mapping.agreement import Agreements, find_agreements
from urquhart.mapping.graph_solver import GraphSolver, residuals
from urquhart.mapping.joining import Judge, contradicting, doubtful_joins, join
from urquhart.mapping.pose_arrays import Poses, adjoints, compose, congruent, inverse, squared_distances
from urquhart.mapping.pose_graph import CentredGraph
from urquhart.mapping.start_poses import anchors, parts, start_poses


class GroupNumbers(NamedTuple):
    """How groups are added. Chosen by hand; `make bench-maps` shows what they do."""

    asked: int = 9
    """Constraints of a group that are compared with the poses, the most confirmed ones: more cost time only."""
    together: float = 0.5
    """Groups of at least this share of the size of the largest one left are compared with the same poses."""


GROUPS: Final = GroupNumbers()


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
    tried: int = 20_000
    """Suspects times constraints up to which each suspect is left out in turn to find the false one."""
    narrowed: int = 2
    """Contradictions of odometry that are narrowed down to one edge: more cost time only."""
    beside: int = 3
    """Odometry edges next to each other that halving does not tell apart."""
    rounds: int = 5
    """Most times that constraints beyond the gate are left out and the rest is optimised again."""


MAPPING: Final = MappingNumbers()


class SolvedGraph(NamedTuple):
    """The optimum under the constraints `kept` (E,) of a graph: the poses (V, 3), and the solver that found them."""

    solver: GraphSolver
    poses: Poses
    kept: NDArray[np.bool_]


class Found(NamedTuple):
    """The poses (V, 3) and what became of constraints (E,): those kept, those known to be false, how many others
    confirm each.
    """

    solver: GraphSolver
    poses: Poses
    kept: NDArray[np.bool_]
    false: NDArray[np.bool_]
    support: NDArray[np.int64]

    @property
    def solved(self) -> SolvedGraph:
        """The optimum."""
        return SolvedGraph(self.solver, self.poses, self.kept)


def consistent_groups(
    graph: CentredGraph, cycles: Agreements, support: NDArray[np.int64], gate: float, least: int
) -> tuple[NDArray[np.bool_], Poses]:
    """Which constraints (E,) are trusted or belong to groups that agree, and poses (V, 3) from these.

    Args:
        graph: vertices and constraints.
        cycles: of the constraints.
        support: (E,) int64, how many others confirm each.
        gate: largest squared Mahalanobis distance of a constraint that agrees with poses.
        least: fewest others that must confirm a constraint.
    """
    kept = graph.trusted.copy()
    pending = _groups(graph, cycles, support, least)
    poses = start_poses(graph, kept, support)
    solver = None
    while pending:
        size = _size(graph, pending[0])
        count = sum(_size(graph, group) >= GROUPS.together * size for group in pending)
        some, pending = pending[:count], pending[count:]
        part = parts(graph, kept)
        accepted = []
        for group in some:
            inside = group[part[graph.first[group]] == part[graph.second[group]]]
            if len(inside) and solver is None:
                solver, poses = _solved(graph, kept, support)
            if solver is None or not len(inside) or _agrees(graph, solver, poses, inside, gate):
                accepted.append(group)
        # Those that were compared with the same poses may contradict each other: the largest corrects the poses first.
        if len(accepted) > 1:
            pending = sorted(accepted[1:] + pending, key=lambda group: _order(graph, group))
            accepted = accepted[:1]
        if accepted:
            kept[accepted[0]] = True
            solver, poses = _solved(graph, kept, support)
    return kept, poses


def _groups(graph: CentredGraph, cycles: Agreements, support: NDArray[np.int64], least: int) -> list[NDArray[np.int64]]:
    """The constraints of each group, most confirmed first; the largest group first."""
    size = len(support)
    one, other = cycles.one[cycles.close], cycles.other[cycles.close]
    links = coo_array((np.ones(len(one), np.int8), (one, other)), shape=(size, size))
    _, labels = connected_components(links, directed=False)
    chosen = np.flatnonzero(~graph.trusted & (support >= least))
    order = chosen[np.lexsort((chosen, -support[chosen], labels[chosen]))]
    begins = np.flatnonzero(np.diff(labels[order], prepend=-1))
    groups = np.split(order, begins[1:]) if len(order) else []
    # Secondary matches in rows of trees are off by one row together, and confirm each other.
    return sorted((group for group in groups if _size(graph, group)), key=lambda group: _order(graph, group))


def _size(graph: CentredGraph, group: NDArray[np.int64]) -> int:
    """The number of constraints of a group that are not secondary."""
    return int((~graph.secondary[group]).sum())


def _order(graph: CentredGraph, group: NDArray[np.int64]) -> tuple[int, int]:
    return -_size(graph, group), int(group.min())


def _solved(graph: CentredGraph, kept: NDArray[np.bool_], support: NDArray[np.int64]) -> tuple[GraphSolver, Poses]:
    start = start_poses(graph, kept, support)
    solver = GraphSolver(graph, np.flatnonzero(kept), anchors(graph, parts(graph, kept)).tolist(), start)
    return solver, solver.solve()


def _agrees(graph: CentredGraph, solver: GraphSolver, poses: Poses, group: NDArray[np.int64], gate: float) -> bool:
    """Whether most of the constraints of a group agree with the poses."""
    asked = group[: GROUPS.asked]
    known = solver.relative_covariances(graph.first[asked], graph.second[asked])
    distances = squared_distances(residuals(graph, poses)[asked], graph.covariances[asked] + known)
    return 2 * int((distances <= gate).sum()) > len(asked)


def largest_consistent(
    whole: CentredGraph, rest: NDArray[np.bool_], gate: float, numbers: MappingNumbers
) -> tuple[Found, Agreements]:
    """The largest consistent set of the constraints `rest` (E,), solved, and the cycles of constraints."""
    graph = whole.only(rest)
    cycles = find_agreements(graph, gate)
    size = len(graph.first)
    support = cycles.support(size)
    believed, poses = consistent_groups(graph, cycles, support, gate, numbers.agreeing - 1)
    poses, kept = _without_outliers(graph, believed, poses, gate)
    false = (support == 0) & (cycles.compared(size) >= numbers.contradictions) & ~graph.trusted
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
    kept, solver, poses = _without_doubtful(graph, SolvedGraph(solver, poses, kept), joined, ~false, gate, numbers)
    for _ in range(numbers.rounds):
        off = kept & ~graph.trusted & (squared_distances(residuals(graph, poses), graph.covariances) > gate)
        if not off.any():
            break
        kept &= ~off
        solver, poses = _solve(graph, kept, poses)
    numbered = np.flatnonzero(rest)
    cycles = cycles._replace(one=numbered[cycles.one], other=numbered[cycles.other])
    return Found(solver, poses, *(_spread(column, rest) for column in (kept, false, support))), cycles


def chi_squared(probability: float) -> float:
    """The quantile of the chi-squared distribution with three degrees of freedom."""
    return 2.0 * float(gammaincinv(1.5, probability))


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


def _without_doubtful(
    graph: CentredGraph,
    solved: SolvedGraph,
    joined: NDArray[np.bool_],
    asked: NDArray[np.bool_],
    gate: float,
    numbers: MappingNumbers,
) -> tuple[NDArray[np.bool_], GraphSolver, Poses]:
    """The constraints that are kept (E,), without those that joined parts alone and are contradicted, and the optimum.

    If all agrees without one of them, and without no other, that one is false: a match across a ring of single matches.
    Otherwise nothing tells which is false, and the parts stay apart.

    `joined`: (E,) bool, what joined parts; `asked`: (E,) bool, what may contradict it, secondary constraints excepted.
    """
    solver, poses, kept = solved
    asked = asked & ~graph.secondary
    against = contradicting(graph, solver, poses, asked & ~kept, gate)
    doubtful = doubtful_joins(graph, kept, joined, against)
    if not doubtful.any():
        return kept, solver, poses
    whole = kept | against
    restored, explained = against, []
    suspects = np.flatnonzero(doubtful | against)
    for edge in suspects.tolist() if len(suspects) * whole.sum() <= numbers.tried else []:
        others = whole.copy()
        others[edge] = False
        there = _solve(graph, others, start_poses(graph, others, others.astype(np.int64)))[1]
        same = others & ~graph.trusted
        if (squared_distances(residuals(graph, there)[same], graph.covariances[same]) <= gate).all():
            explained.append(others)
    kept = explained[0] if len(explained) == 1 else kept
    solver, poses = _solve(graph, kept, start_poses(graph, kept, kept.astype(np.int64)))
    against = contradicting(graph, solver, poses, asked & ~kept, gate)
    # One or several constraints of the path may be false, and nothing tells which.
    kept &= ~doubtful_joins(graph, kept, kept & (joined | restored), against)
    solver, poses = _solve(graph, kept, poses)
    return kept, solver, poses


def _spread(column: NDArray[Any], rest: NDArray[np.bool_]) -> NDArray[Any]:
    """A column of some of the constraints as one of all of them (E,), with 0 for the others."""
    full = np.zeros(len(rest), column.dtype)
    full[rest] = column
    return full
