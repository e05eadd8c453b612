"""Parts of a pose graph that constraints connect, and poses to begin an optimisation from."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from urquhart.mapping.pose_arrays import Poses, compose, inverse
from urquhart.mapping.pose_graph import CentredGraph


class StartNumbers(NamedTuple):
    """Which way through a graph the first poses follow. Chosen by hand, not fitted."""

    risk: float = 4.0
    """A way along a constraint that may be false costs (1 + this / its support) times as much."""


START: Final = StartNumbers()
_LEAST: Final = 1e-9
"""Square metres: least cost of a way, because the graph search takes 0 for no way at all."""


def parts(graph: CentredGraph, used: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The number (V,) of the part of each vertex that the constraints `used` (E,) connect, in order of vertices."""
    first, second = graph.first[used], graph.second[used]
    links = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(graph.count, graph.count))
    _, labels = connected_components(links, directed=False)
    return np.asarray(labels, np.int64)


def anchors(graph: CentredGraph, part: NDArray[np.int64]) -> NDArray[np.int64]:
    """The vertex (K,) of each part that is held: the map frame where it belongs to the part, else the first submap."""
    _, first = np.unique(part, return_index=True)
    held = first.astype(np.int64)
    held[part[graph.map_vertex]] = graph.map_vertex
    return held


def start_poses(graph: CentredGraph, used: NDArray[np.bool_], support: NDArray[np.int64]) -> Poses:
    """A pose (V, 3) for each vertex, in the frame of its part: along the most precise way from the part's anchor.

    Args:
        graph: the vertices and constraints.
        used: (E,) bool, which constraints may be followed.
        support: (E,) int64, how many others confirm each.
    """
    poses = np.column_stack([graph.centres, np.zeros(graph.count)])
    edges = np.flatnonzero(used)
    if not len(edges):
        return poses
    # The area of an error at the position, and what the yaw does to the next 10 m.
    spread = graph.covariances[edges]
    cost = spread[:, 0, 0] + spread[:, 1, 1] + 100.0 * spread[:, 2, 2] + _LEAST
    cost = cost * np.where(graph.trusted[edges], 1.0, 1.0 + START.risk / np.maximum(support[edges], 1))
    low, high = np.sort(np.column_stack([graph.first, graph.second])[edges], axis=1).T
    order = np.lexsort((cost, high, low))
    pair = low[order] * graph.count + high[order]
    best = order[np.concatenate([[True], pair[1:] != pair[:-1]])]
    shape = (graph.count, graph.count)
    network = coo_array((cost[best], (low[best], high[best])), shape=shape).tocsr()
    which = coo_array((edges[best] + 1.0, (low[best], high[best])), shape=shape).tocsr()
    held = anchors(graph, parts(graph, used))
    distance, before, _ = dijkstra(network, directed=False, indices=held, min_only=True, return_predecessors=True)
    # By distance, whatever a vertex follows has its pose already.
    for vertex in np.argsort(distance, kind="stable").tolist():
        previous = int(before[vertex])
        if previous < 0:
            continue
        edge = int(which[min(previous, vertex), max(previous, vertex)]) - 1
        step = graph.poses[edge : edge + 1]
        if graph.first[edge] != previous:
            step = inverse(step)
        poses[vertex] = compose(poses[previous : previous + 1], step)[0]
    return poses
