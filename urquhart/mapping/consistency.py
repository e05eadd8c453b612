"""The largest consistent set of constraints that confirm each other, found before anything is optimised with all.

Constraints that confirm each other in short cycles form groups. The true ones of a drive form few and large groups;
several false ones that agree, because one place was taken for another more than once, form a small one. So groups are
added one after the other, the largest first. Each must agree with the poses that the constraints so far give, under
their covariance, and after each the poses are optimised again: one true group corrects the drift that hid how false
another one is. A start from all constraints at once ends in a folded map: with 30 % of false loops in groups of three,
graduated non-convexity alone refused most of the right ones (`python -m benchmarks.maps`).
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from urquhart.mapping.agreement import Agreements
from urquhart.mapping.graph_solver import GraphSolver, residuals
from urquhart.mapping.pose_arrays import Poses, squared_distances
from urquhart.mapping.pose_graph import CentredGraph
from urquhart.mapping.start_poses import anchors, parts, start_poses


class GroupNumbers(NamedTuple):
    """How groups are added. Chosen by hand; `make bench-maps` shows what they do."""

    asked: int = 9
    """Constraints of a group that are compared with the poses, the most confirmed ones: more cost time only."""
    together: float = 0.5
    """Groups of at least this share of the size of the largest one left are compared with the same poses."""


GROUPS: Final = GroupNumbers()


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
