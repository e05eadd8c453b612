"""Parts of a pose graph joined by constraints that no short cycle confirms.

Between two parts, all constraints must tell one relative pose. Most of them must agree on it, and at least two. A
single constraint joins two parts only where the constraints that could be checked were right, and where no constraint
that was left out contradicts it: of two single constraints that contradict each other, either may be the false one.
"""

from collections import defaultdict
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.mapping.agreement import NEIGHBOURS
from urquhart.mapping.graph_solver import GraphSolver, residuals
from urquhart.mapping.pose_arrays import (
    Poses,
    compose,
    compose_covariances,
    inverse,
    squared_distances,
)
from urquhart.mapping.pose_graph import CentredGraph
from urquhart.mapping.start_poses import parts


class JoiningNumbers(NamedTuple):
    """How two parts are joined. Chosen by hand, not fitted."""

    compared: int = 100
    """Constraints between two parts that are compared with each other, the most precise ones."""
    far: float = 4.0
    """Times the gate: a constraint that is farther off is false, or what it contradicts is."""


JOINING: Final = JoiningNumbers()


class Judge(NamedTuple):
    """What a constraint that no cycle confirms must pass.

    Attributes:
        gate: largest squared Mahalanobis distance of a constraint that agrees with another one, or with poses.
        sharp: metres; poses known to this standard deviation can tell whether a constraint is right.
        alone: whether a constraint is believed that nothing confirms and nothing contradicts.
    """

    gate: float
    sharp: float
    alone: bool


def join(
    graph: CentredGraph, kept: NDArray[np.bool_], left: NDArray[np.bool_], poses: Poses, judge: Judge
) -> tuple[NDArray[np.bool_], Poses]:
    """Join parts until no constraint that is left may join any more.

    Args:
        graph: the vertices and constraints.
        kept: (E,) bool, the constraints that connect the parts.
        left: (E,) bool, those that may join them.
        poses: (V, 3), of each vertex in the frame of its part.
        judge: what they must pass.

    Returns:
        The constraints (E,) that joined parts, and the poses (V, 3) in the frames of the joined parts.
    """
    part, poses = parts(graph, kept), poses.copy()
    joined = np.zeros(len(kept), np.bool_)
    open_edges = left & (part[graph.first] != part[graph.second])
    while open_edges.any():
        groups: dict[tuple[int, int], list[int]] = defaultdict(list)
        for edge in np.flatnonzero(open_edges).tolist():
            a, b = int(part[graph.first[edge]]), int(part[graph.second[edge]])
            groups[min(a, b), max(a, b)].append(edge)
        groups = {pair: edges for pair, edges in groups.items() if judge.alone or len(edges) > 1}
        sets = [agreed for edges in groups.values() if (agreed := _agreed(graph, edges, part, poses, judge.gate))]
        if not sets:
            break
        sets.sort(key=lambda edges: (-len(edges), edges[0]))
        for edges in sets:
            first, second = int(graph.first[edges[0]]), int(graph.second[edges[0]])
            if part[first] == part[second]:
                continue  # an earlier set has joined them; what these constraints say is judged later
            joined[edges] = True
            _move(graph, edges[0], part, poses)
        open_edges &= part[graph.first] != part[graph.second]
    return joined, poses


def contradicting(
    graph: CentredGraph, solver: GraphSolver, poses: Poses, left: NDArray[np.bool_], gate: float
) -> NDArray[np.bool_]:
    """Which constraints (E,) of those that are left are far from the poses (V, 3), however well these are known."""
    part = parts(graph, solver.used_mask)
    asked = np.flatnonzero(left & (part[graph.first] == part[graph.second]))
    found = np.zeros(len(left), np.bool_)
    if len(asked):
        known = solver.relative_covariances(graph.first[asked], graph.second[asked])
        distances = squared_distances(residuals(graph, poses)[asked], graph.covariances[asked] + known)
        found[asked] = distances > JOINING.far * gate
    return found


def doubtful_joins(
    graph: CentredGraph, kept: NDArray[np.bool_], joined: NDArray[np.bool_], against: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which constraints (E,) joined parts alone, although a constraint that was left out contradicts them.

    Args:
        graph: the vertices and constraints.
        kept: (E,) bool, the constraints in use.
        joined: (E,) bool, those of them that joined parts.
        against: (E,) bool, those that were left out, contradict the poses, and that nothing else speaks against.
    """
    doubtful = np.zeros(len(kept), np.bool_)
    if not against.any():
        return doubtful
    first, second = graph.first[against], graph.second[against]
    for edge in np.flatnonzero(joined).tolist():
        others = kept.copy()
        others[edge] = False
        part = parts(graph, others)
        doubtful[edge] = bool((part[first] != part[second]).any())
    return doubtful


def _agreed(graph: CentredGraph, edges: list[int], part: NDArray[np.int64], poses: Poses, gate: float) -> list[int]:
    """The largest set of constraints between two parts that agree with one of them; empty if it is too small."""
    if len(edges) == 1:
        return edges
    some = np.array(sorted(edges, key=lambda e: float(np.linalg.det(graph.covariances[e])))[: JOINING.compared])
    size = len(some)
    one, other = (grid.ravel() for grid in np.meshgrid(some, some, indexing="ij"))
    # Constraints may lead from either part to the other.
    flipped = part[graph.first[other]] != part[graph.first[one]]
    a = np.where(flipped, graph.second[other], graph.first[other])
    b = np.where(flipped, graph.first[other], graph.second[other])
    before = compose(inverse(poses[a]), poses[graph.first[one]])
    after = compose(inverse(poses[graph.second[one]]), poses[b])
    predicted = compose(compose(before, graph.poses[one]), after)
    covariance = compose_covariances(graph.covariances[one], after, np.zeros((len(one), 3, 3)))
    seen, seen_covariance = graph.poses[other].copy(), graph.covariances[other].copy()
    seen_covariance[flipped] = compose_covariances(
        seen_covariance[flipped], inverse(seen[flipped]), np.zeros((int(flipped.sum()), 3, 3))
    )
    seen[flipped] = inverse(seen[flipped])
    slack = np.diag([NEIGHBOURS.slack[0] ** 2, NEIGHBOURS.slack[0] ** 2, NEIGHBOURS.slack[1] ** 2])
    errors = compose(inverse(seen), predicted)
    agree = (squared_distances(errors, covariance + seen_covariance + slack) <= gate).reshape(size, size)
    best = int(agree.sum(axis=1).argmax())
    chosen = some[agree[best]].tolist()
    chosen.sort(key=lambda e: e != int(some[best]))
    return chosen if len(chosen) >= 2 and 2 * len(chosen) > size else []


def _move(graph: CentredGraph, edge: int, part: NDArray[np.int64], poses: Poses) -> None:
    """Lay the part of one end of a constraint onto the part of the other, in place. The map frame never moves."""
    first, second = int(graph.first[edge]), int(graph.second[edge])
    a, b, step = first, second, graph.poses[edge : edge + 1]
    stays = part[graph.map_vertex]
    if part[b] == stays or (part[a] != stays and (part == part[b]).sum() > (part == part[a]).sum()):
        a, b, step = second, first, inverse(step)
    target = compose(poses[a : a + 1], step)
    shift = compose(target, inverse(poses[b : b + 1]))
    moving = np.flatnonzero(part == part[b])
    poses[moving] = compose(np.repeat(shift, len(moving), axis=0), poses[moving])
    part[moving] = part[a]
