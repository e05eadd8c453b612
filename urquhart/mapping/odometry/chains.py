"""Contradictions of chains of odometry: long cycles that do not close, and groups of matches that a chain opposes.

Nothing tells which link of a chain is wrong, so these are named and not resolved.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from urquhart.mapping.agreement import Agreements
from urquhart.mapping.consistency import SolvedGraph
from urquhart.mapping.graph_solver import GraphSolver, residuals
from urquhart.mapping.odometry.judging import ODOMETRY, Contradiction, certain_gate
from urquhart.mapping.odometry.ways import SLACK, shortest_way
from urquhart.mapping.pose_arrays import squared_distances
from urquhart.mapping.pose_graph import CentredGraph
from urquhart.mapping.start_poses import anchors, parts, start_poses


def unclosed_cycles(graph: CentredGraph, believed: NDArray[np.bool_]) -> list[Contradiction]:
    """Odometry edges whose ends other odometry joins at another pose; the first of `edges` is the one that closes.

    `believed`: (E,) bool, the odometry that is compared.
    """
    edges = np.flatnonzero(believed)
    tree = np.zeros(len(believed), np.bool_)
    tree[_spanning(graph, edges)] = True
    closing = np.flatnonzero(believed & ~tree)
    if not len(closing):
        return []
    poses = start_poses(graph, tree, np.zeros(len(believed), np.int64))
    solver = GraphSolver(graph, np.flatnonzero(tree), anchors(graph, parts(graph, tree)).tolist(), poses)
    known = solver.relative_covariances(graph.first[closing], graph.second[closing])
    errors = residuals(graph, poses)[closing]
    distances = squared_distances(errors, graph.covariances[closing] + known + SLACK)
    return [
        Contradiction((edge,), _way(graph, tree, edge), 1, float(np.sqrt(distance)), "undecided")
        for edge, distance in zip(closing.tolist(), distances.tolist(), strict=True)
        if distance > certain_gate()
    ]


def opposed_groups(graph: CentredGraph, cycles: Agreements, solved: SolvedGraph, gate: float) -> list[Contradiction]:
    """Groups of matches that confirm each other, were left out, and that nothing but odometry contradicts.

    Args:
        graph: the vertices and constraints.
        cycles: of the constraints.
        solved: the map without these groups.
        gate: largest squared Mahalanobis distance of a constraint that agrees with poses.
    """
    size, kept, part = len(graph.first), solved.kept, parts(graph, solved.kept)
    lost = ~kept & ~graph.trusted & ~graph.is_prior & ~graph.secondary & (part[graph.first] == part[graph.second])
    inside = cycles.close & lost[cycles.one] & lost[cycles.other]
    links = np.ones(int(inside.sum()), np.int8)
    _, labels = connected_components(
        coo_array((links, (cycles.one[inside], cycles.other[inside])), shape=(size, size)), directed=False
    )
    by_matches = parts(graph, kept & ~graph.trusted)
    opposed = np.flatnonzero(lost & (by_matches[graph.first] != by_matches[graph.second]))
    if not len(opposed):
        return []
    order = opposed[np.argsort(labels[opposed], kind="stable")]
    errors, found = residuals(graph, solved.poses), list[Contradiction]()
    for group in np.split(order, np.flatnonzero(np.diff(labels[order])) + 1):
        if len(without_common_ends(graph, group)) < ODOMETRY.group:
            continue
        # Of a group that was refused as a whole, those are asked that drift does not explain.
        known = solved.solver.relative_covariances(graph.first[group], graph.second[group])
        distances = squared_distances(errors[group], graph.covariances[group] + known)
        off = distances > gate
        apart = without_common_ends(graph, group[off])
        if len(apart) >= ODOMETRY.group:
            edges = _chain_of(graph, kept & graph.trusted, apart)
            sigmas = float(np.sqrt(np.median(distances[off])))
            found.append(Contradiction(edges, tuple(group[off].tolist()), len(apart), sigmas, "undecided"))
    return found


def _spanning(graph: CentredGraph, edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """The most precise constraints of `edges` that connect the same vertices without a cycle."""
    spread = graph.covariances[edges]
    cost = spread[:, 0, 0] + spread[:, 1, 1] + 100.0 * spread[:, 2, 2]
    low, high = np.sort(np.column_stack([graph.first, graph.second])[edges], axis=1).T
    order = np.lexsort((cost, high, low))
    pair = low[order] * graph.count + high[order]
    best = order[np.concatenate([[True], pair[1:] != pair[:-1]])] if len(order) else order
    shape = (graph.count, graph.count)
    # Ranks instead of costs: all are different, and none is 0, which the search takes for no edge.
    rank = np.argsort(np.argsort(cost[best], kind="stable"), kind="stable") + 1.0
    chosen = minimum_spanning_tree(coo_array((rank, (low[best], high[best])), shape=shape).tocsr())
    ranked = best[np.argsort(rank)]
    return np.asarray(edges[ranked[chosen.data.astype(np.int64) - 1]])


def _way(graph: CentredGraph, used: NDArray[np.bool_], edge: int) -> tuple[int, ...]:
    """The shortest way along the constraints `used` (E,) between the ends of another one; empty if there is none."""
    return tuple(shortest_way(graph, np.flatnonzero(used), int(graph.first[edge]), int(graph.second[edge])))


def _chain_of(graph: CentredGraph, chain: NDArray[np.bool_], group: list[int]) -> tuple[int, ...]:
    """The constraints of a chain that lie between the ends of each match of a group: a wrong one is among them.

    If there is none, more than one is wrong: all those between the ends of any of them.
    """
    ways = [_way(graph, chain, edge) for edge in group[: ODOMETRY.asked]]
    common = set(ways[0]).intersection(*ways[1:])
    return tuple(sorted(common or {step for way in ways for step in way}))


def without_common_ends(graph: CentredGraph, group: NDArray[np.int64]) -> list[int]:
    """Constraints of a group that share no vertex."""
    chosen, taken = list[int](), set[int]()
    for edge in group.tolist():
        ends = {int(graph.first[edge]), int(graph.second[edge])}
        if taken.isdisjoint(ends):
            taken |= ends
            chosen.append(edge)
    return chosen
