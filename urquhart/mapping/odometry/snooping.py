"""Odometry compared with the map that the other constraints make: what the ways beside a single edge cannot show.

In an optimum, a wrong edge pulls its neighbours along, and right matches are refused. So edges whose residual is more
than their covariance allows are suspects, as in the data snooping of geodesy (Baarda 1968): the map is made again
without them, and each is compared with it. One that is farther off than both covariances allow is refused if enough
ways through that map, which share no submap, join its ends. The others are given back.
"""

import numpy as np
from numpy.typing import NDArray

from urquhart.mapping.consistency import SolvedGraph
from urquhart.mapping.graph_solver import residuals
from urquhart.mapping.odometry.chains import without_common_ends
from urquhart.mapping.odometry.judging import ODOMETRY, Contradiction, certain_gate
from urquhart.mapping.odometry.ways import SLACK, shortest_way
from urquhart.mapping.pose_arrays import squared_distances
from urquhart.mapping.pose_graph import CentredGraph
from urquhart.mapping.start_poses import parts


def suspects(graph: CentredGraph, solved: SolvedGraph) -> NDArray[np.float64]:
    """Squared Mahalanobis distances (E,) of odometry that the rest of an optimum contradicts for certain, 0 for others.

    The distance is from what all other constraints together say, which the edge itself did not pull.
    """
    found = np.zeros(len(graph.first))
    errors = residuals(graph, solved.poses)
    asked = solved.kept & graph.trusted & ~graph.is_prior
    asked &= squared_distances(errors, graph.covariances) > ODOMETRY.pulled * certain_gate()
    edges = np.flatnonzero(asked)
    if len(edges):
        known = solved.solver.relative_covariances(graph.first[edges], graph.second[edges])
        # A residual in an optimum has this covariance; without redundancy it is 0, and nothing can be said.
        left = graph.covariances[edges] - known
        checked = np.linalg.eigvalsh(left)[:, 0] > 0.0
        error = errors[edges[checked]]
        distances = squared_distances(error, left[checked])
        found[edges[checked]] = np.where(distances > certain_gate(), distances, 0.0)
    return found


def compare(
    graph: CentredGraph, asked: NDArray[np.int64], solved: SolvedGraph, without: SolvedGraph, gate: float
) -> tuple[list[Contradiction], list[Contradiction]]:
    """The edges `asked` that the map without them proves wrong, and those that it contradicts with too little proof.

    Edges whose ends nothing else joins are compared with the map that they are in (`solved`), together.
    """
    part = parts(graph, without.kept)
    same = part[graph.first[asked]] == part[graph.second[asked]]
    refused, open_ones = list[Contradiction](), list[Contradiction]()
    edges = asked[same]
    known = without.solver.relative_covariances(graph.first[edges], graph.second[edges])
    errors = residuals(graph, without.poses)[edges]
    distances = squared_distances(errors, graph.covariances[edges] + known + SLACK)
    for edge, distance in zip(edges.tolist(), distances.tolist(), strict=True):
        if distance <= gate:
            continue
        ways = separate_ways(graph, without.kept, edge)
        against = tuple(sorted({one for way in ways for one in way}))
        if len(ways) >= ODOMETRY.separate:
            refused.append(Contradiction((edge,), against, len(ways), float(np.sqrt(distance)), "refused"))
        elif distance > certain_gate():
            open_ones.append(Contradiction((edge,), against, len(ways), float(np.sqrt(distance)), "undecided"))
    pulled = asked[~same][suspects(graph, solved)[asked[~same]] > 0.0]
    if len(pulled):
        own = squared_distances(residuals(graph, solved.poses)[pulled], graph.covariances[pulled])
        ways = separate_ways(graph, solved.kept, int(pulled[own.argmax()]))
        against = tuple(sorted({one for way in ways for one in way} - set(pulled.tolist())))
        sigmas = float(np.sqrt(own.max()))
        open_ones.append(Contradiction(tuple(pulled.tolist()), against, len(ways), sigmas, "undecided"))
    return refused, open_ones


def regained(graph: CentredGraph, before: NDArray[np.bool_], after: NDArray[np.bool_]) -> tuple[int, NDArray[np.int64]]:
    """What a map gains without some odometry: how many matches without a common submap, and all matches (K,) int64.

    `before`, `after`: (E,) bool, the constraints of the map with that odometry and without it. The number is 0 if it is
    too small to prove the odometry wrong, or if the map loses matches too.
    """
    matches = ~graph.trusted & ~graph.is_prior & ~graph.secondary
    gained, lost = np.flatnonzero(matches & after & ~before), np.flatnonzero(matches & before & ~after)
    count = len(without_common_ends(graph, gained))
    least = ODOMETRY.group + ODOMETRY.weight * len(without_common_ends(graph, lost))
    return (count if count >= least else 0), gained


def separate_ways(graph: CentredGraph, kept: NDArray[np.bool_], edge: int) -> list[list[int]]:
    """Ways along `kept` (E,) between the ends of a constraint that share no vertex, the shortest first.

    At most two more than it takes to prove the constraint wrong.
    """
    start, end = int(graph.first[edge]), int(graph.second[edge])
    usable, ways = kept.copy(), list[list[int]]()
    usable[edge] = False
    while len(ways) < ODOMETRY.separate + 2:
        way = shortest_way(graph, np.flatnonzero(usable), start, end)
        if not way:
            break
        ways.append(way)
        usable[way] = False
        passed = np.setdiff1d(np.concatenate([graph.first[way], graph.second[way]]), [start, end])
        usable &= ~np.isin(graph.first, passed) & ~np.isin(graph.second, passed)
    return ways
