"""Other ways between the two ends of a trusted constraint: one to three constraints in a row that do not use it."""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from urquhart.mapping.agreement import NEIGHBOURS, NOBODY, NeighbourSteps, expand, neighbourhoods
from urquhart.mapping.pose_arrays import (
    Covariances,
    Poses,
    compose,
    compose_covariances,
    inverse,
    inverse_covariances,
    squared_distances,
)
from urquhart.mapping.pose_graph import CentredGraph

SLACK: Final = np.diag(np.square([NEIGHBOURS.slack[0], NEIGHBOURS.slack[0], NEIGHBOURS.slack[1]]))
"""Square metres and radians, added to what a cycle may be off, because submaps are not perfectly rigid."""


class Ways(NamedTuple):
    """Ways beside trusted constraints, sorted by constraint.

    Attributes:
        edge: (W,) int64, the trusted constraint whose ends a way joins.
        used: (W, 3) int64, the constraints of the way; `NOBODY` where it has fewer.
        between: (W, 2) int64, the vertices that it passes; `NOBODY` where it passes fewer.
        poses: (W, 3), what it says `first_T_second` of the constraint is.
        covariances: (W, 3, 3).
        distances: (W,) float64, squared Mahalanobis distance of the constraint from it, with slack.
    """

    edge: NDArray[np.int64]
    used: NDArray[np.int64]
    between: NDArray[np.int64]
    poses: Poses
    covariances: Covariances
    distances: NDArray[np.float64]


def find_ways(graph: CentredGraph, asked: NDArray[np.int64]) -> Ways:
    """The ways beside the constraints `asked` (A,).

    From each end, a way leaves by one of the most precise constraints there (`NEIGHBOURS.most`).
    """
    steps = neighbourhoods(replace(graph, trusted=np.zeros(len(graph.first), np.bool_)))
    low, high = np.sort(np.column_stack([graph.first, graph.second]), axis=1).T
    codes = low * graph.count + high
    order = np.argsort(codes, kind="stable")
    size = max(1, NEIGHBOURS.batch // (NEIGHBOURS.most + 1) ** 2)
    parts = [
        _ways(graph, steps, asked[begin : begin + size], (codes[order], order))
        for begin in range(0, max(len(asked), 1), size)
    ]
    return Ways(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _ways(
    graph: CentredGraph,
    steps: NeighbourSteps,
    asked: NDArray[np.int64],
    known: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> Ways:
    """`known`: codes of vertex pairs, sorted, and the constraint of each."""
    codes, edges = known
    degree = np.diff(steps.start)
    at, left = expand(steps.start[graph.first[asked]], degree[graph.first[asked]])
    again, right = expand(steps.start[graph.second[asked]][at], degree[graph.second[asked]][at])
    edge, left = asked[at[again]], left[again]
    k, m = steps.end[left], steps.end[right]
    begin = np.searchsorted(codes, np.minimum(k, m) * graph.count + np.maximum(k, m))
    end = np.searchsorted(codes, np.minimum(k, m) * graph.count + np.maximum(k, m), side="right")
    which, place = expand(begin, end - begin)
    edge, left, right, middle = edge[which], left[which], right[which], edges[place]
    one, other, k, m = steps.through[left], steps.through[right], k[which], m[which]
    # Of a way of two constraints, the first one is the middle, so that it is found once.
    fresh = (k != m) & ((one == NOBODY) | (other != NOBODY))
    fresh &= (middle != edge) & (one != edge) & (other != edge) & (middle != one) & (middle != other)
    fresh &= ((one == NOBODY) | (k != graph.second[edge])) & ((other == NOBODY) | (m != graph.first[edge]))
    edge, left, right, middle, one, other, k, m = (a[fresh] for a in (edge, left, right, middle, one, other, k, m))
    step, spread = graph.poses[middle].copy(), graph.covariances[middle].copy()
    flipped = graph.first[middle] != k
    spread[flipped] = inverse_covariances(step[flipped], spread[flipped])
    step[flipped] = inverse(step[flipped])
    back, back_spread = inverse(steps.poses[right]), inverse_covariances(steps.poses[right], steps.covariances[right])
    poses = compose(compose(steps.poses[left], step), back)
    covariances = compose_covariances(steps.covariances[left], step, spread)
    covariances = compose_covariances(covariances, back, back_spread)
    errors = compose(inverse(graph.poses[edge]), poses)
    total = compose_covariances(graph.covariances[edge], errors, covariances) + SLACK
    between = np.column_stack([np.where(one == NOBODY, NOBODY, k), np.where(other == NOBODY, NOBODY, m)])
    used = np.column_stack([middle, one, other])
    return Ways(edge, used, between, poses, covariances, squared_distances(errors, total))


def shortest_way(graph: CentredGraph, some: NDArray[np.int64], start: int, end: int) -> list[int]:
    """The constraints of the shortest way along `some` between two vertices; empty if there is none."""
    first, second = graph.first[some], graph.second[some]
    shape = (graph.count, graph.count)
    rows, columns = np.concatenate([first, second]), np.concatenate([second, first])
    network = csr_array((np.ones(len(rows), np.int8), (rows, columns)), shape=shape)
    _, before = breadth_first_order(network, start, directed=True)
    way, place = list[int](), end
    while place != start:
        previous = int(before[place])
        if previous < 0:
            return []
        ends = (graph.first[some] == place) & (graph.second[some] == previous)
        ends |= (graph.first[some] == previous) & (graph.second[some] == place)
        way.append(int(some[np.flatnonzero(ends)[0]]))
        place = previous
    return way
