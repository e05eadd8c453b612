"""A slow, independent way to the same polygons: the faces of the Urquhart graph, walked in a planar embedding."""

import math
from collections import Counter

import networkx as nx
import numpy as np
from numpy.typing import NDArray

Cycle = tuple[int, ...]


def urquhart_polygons(landmarks: NDArray[np.float64], triangles: NDArray[np.int32]) -> tuple[set[Cycle], int, int]:
    """Interior polygons as counter-clockwise cycles from their lowest landmark, non-simple faces, dangling edges."""
    uses: Counter[frozenset[int]] = Counter()
    longest: set[frozenset[int]] = set()
    for a, b, c in triangles.tolist():
        edges = [frozenset(pair) for pair in ((a, b), (b, c), (c, a))]
        uses.update(edges)
        longest.add(max(edges, key=lambda edge: (_length(landmarks, edge), max(edge), min(edge))))
    hull = {edge for edge, count in uses.items() if count == 1}
    graph: nx.Graph[int] = nx.Graph()
    graph.add_edges_from((min(edge), max(edge)) for edge in uses if edge not in longest or edge in hull)

    embedding: nx.PlanarEmbedding[int] = nx.PlanarEmbedding()
    for v in graph:
        around = sorted(
            graph[v], key=lambda w: -math.atan2(landmarks[w, 1] - landmarks[v, 1], landmarks[w, 0] - landmarks[v, 0])
        )
        for before, w in zip([None, *around], around, strict=False):
            embedding.add_half_edge(v, w, ccw=before)
    polygons: set[Cycle] = set()
    non_simple = dangling = 0
    marked: set[tuple[int, int]] = set()
    for v, w in list(embedding.edges()):
        if (v, w) in marked:
            continue
        walk = embedding.traverse_face(v, w, marked)
        sides = list(zip(walk, walk[1:] + walk[:1], strict=True))
        twice = {side for side in sides if side[::-1] in sides}
        dangling += len(twice) // 2
        boundary = [side for side in sides if side not in twice]
        if any(frozenset(side) in hull for side in boundary):
            continue
        follow = dict(boundary)
        cycle = [boundary[0][0]]
        while follow[cycle[-1]] != cycle[0] and len(cycle) < len(boundary):
            cycle.append(follow[cycle[-1]])
        if len(follow) != len(boundary) or len(cycle) != len(boundary):
            non_simple += 1
        else:
            polygons.add(canonical(landmarks, cycle))
    return polygons, non_simple, dangling


def canonical(landmarks: NDArray[np.float64], cycle: list[int]) -> Cycle:
    """The cycle counter-clockwise from its lowest landmark."""
    x, y = landmarks[cycle].T
    if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) < 0.0:
        cycle = cycle[::-1]
    start = cycle.index(min(cycle))
    return tuple(cycle[start:] + cycle[:start])


def _length(landmarks: NDArray[np.float64], edge: frozenset[int]) -> float:
    low, high = sorted(edge)
    dx, dy = landmarks[high] - landmarks[low]
    return float(dx * dx + dy * dy)
