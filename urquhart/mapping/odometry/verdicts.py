"""The largest consistent set of constraints without odometry that it proves wrong."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from urquhart.mapping.consistency import Found, MappingNumbers, SolvedGraph, chi_squared, largest_consistent
from urquhart.mapping.odometry.chains import opposed_groups
from urquhart.mapping.odometry.judging import Contradiction
from urquhart.mapping.odometry.snooping import compare, regained, suspects
from urquhart.mapping.pose_graph import CentredGraph


def judged_map(
    graph: CentredGraph,
    rest: NDArray[np.bool_],
    doubtful: list[Contradiction],
    gate: float,
    numbers: MappingNumbers,
) -> tuple[Found, tuple[list[Contradiction], list[Contradiction]]]:
    """The largest consistent set of `rest` (E,), the odometry in it that is wrong, and what stays open."""
    found, cycles = largest_consistent(graph, rest, gate, numbers)
    opposed = opposed_groups(graph, cycles, found.solved, gate)
    open_ones = [one for one in (*doubtful, *opposed) if rest[list(one.edges)].all()]
    asked = suspects(graph, found.solved) > 0.0
    asked[[edge for one in open_ones for edge in one.edges]] = True
    if not asked.any():
        return found, ([], open_ones)
    without, _ = largest_consistent(graph, rest & ~asked, gate, numbers)
    wrong, unproven = compare(graph, np.flatnonzero(asked), found.solved, without.solved, gate)
    named = {edge for one in open_ones for edge in one.edges}
    open_ones += [one for one in unproven if named.isdisjoint(one.edges)]
    if not wrong:
        open_ones.sort(key=lambda one: (len(one.edges), -one.witnesses))
        narrowed = (_narrowed(graph, rest, one, found.solved, numbers) for one in open_ones[: numbers.narrowed])
        wrong = [one for one in narrowed if one is not None][:1]
    return found, (wrong, open_ones)


def _narrowed(
    graph: CentredGraph, rest: NDArray[np.bool_], open_one: Contradiction, solved: SolvedGraph, numbers: MappingNumbers
) -> Contradiction | None:
    """The one odometry edge of a contradiction that is wrong; None if nothing tells which one.

    It is sought by halving: without it, the map keeps many more matches. The same holds without a neighbour of it,
    because both may bend the chain. So the last few edges are compared with the map without all of these.
    `rest`: (E,) bool, the constraints of the map `solved`.
    """
    gate = chi_squared(numbers.probability)

    def without(edges: tuple[int, ...]) -> tuple[int, NDArray[np.int64], SolvedGraph]:
        left = rest.copy()
        left[list(edges)] = False
        found, _ = largest_consistent(graph, left, gate, numbers)
        return *regained(graph, solved.kept, found.kept), found.solved

    edges = open_one.edges
    best = without(edges)
    if not best[0]:
        return None
    while len(edges) > numbers.beside and best[0]:
        middle = len(edges) // 2
        tried = {some: without(some) for some in (edges[:middle], edges[middle:])}
        edges = max(tried, key=lambda some: tried[some][0])
        best = tried[edges]
    at = [open_one.edges.index(edges[k]) for k in (0, -1)]
    beside = open_one.edges[max(0, at[0] - numbers.beside) : at[1] + numbers.beside + 1]
    wrong, more = compare(graph, np.array(beside), solved, without(beside)[2], gate)
    single = [one for one in (*wrong, *more) if len(one.edges) == 1]
    if len(single) != 1:
        return None
    count, gained, _ = without(single[0].edges)
    if not count:
        return None
    return replace(single[0], against=tuple(gained.tolist()), witnesses=count, outcome="refused")
