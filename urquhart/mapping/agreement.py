"""Which constraints confirm each other: constraints that close a short cycle must compose to the identity.

A false loop closure contradicts the true ones around it: the submaps before and after saw other places. So for each
constraint, other constraints are looked for that lead from the neighbourhood of its first submap to the neighbourhood
of its second one. A neighbour is reached by one constraint, or by up to `NEIGHBOURS.steps` trusted ones in a row. Two
constraints that close such a cycle within its uncertainty confirm each other.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

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


class NeighbourNumbers(NamedTuple):
    """How far cycles reach. Chosen by hand; `make bench-maps` shows what they find."""

    steps: int = 3
    """Trusted constraints in a row that lead to a neighbour."""
    most: int = 12
    """Neighbours of each submap, the most precise ones, so that dense graphs stay cheap."""
    slack: tuple[float, float] = (0.15, 0.009)
    """Metres and radians (0.5 degrees): added to what a cycle may be off, because submaps are not perfectly rigid."""
    batch: int = 500_000
    """Pairs of neighbours that are composed at once."""


NEIGHBOURS: Final = NeighbourNumbers()
NOBODY: Final = -1


class NeighbourSteps(NamedTuple):
    """Ways from a vertex to a neighbour, sorted by vertex.

    Attributes:
        start: (count + 1,) int64; the ways from vertex v are `start[v]:start[v + 1]`.
        end: (H,) int64, the neighbour.
        poses: (H, 3), `vertex_T_neighbour`.
        covariances: (H, 3, 3).
        through: (H,) int64, the constraint that may be false and was used; `NOBODY` if there is none.
    """

    start: NDArray[np.int64]
    end: NDArray[np.int64]
    poses: Poses
    covariances: Covariances
    through: NDArray[np.int64]


class Agreements(NamedTuple):
    """Cycles of two constraints that may be false.

    Attributes:
        one, other: (C,) int64, the constraints of each cycle, that may be false and are not of the same two submaps.
        distances: (C,) float64, squared Mahalanobis distance of the cycle from the identity, without slack.
        close: (C,) bool, whether the cycle closes within its uncertainty and the slack.
        plain: (C,) bool, whether the cycle has no trusted constraint and no prior.
    """

    one: NDArray[np.int64]
    other: NDArray[np.int64]
    distances: NDArray[np.float64]
    close: NDArray[np.bool_]
    plain: NDArray[np.bool_]

    def support(self, size: int) -> NDArray[np.int64]:
        """For each of `size` constraints, how many others confirm it (size,)."""
        return self._partners(self.close, size)

    def compared(self, size: int) -> NDArray[np.int64]:
        """For each of `size` constraints, with how many others it is in a cycle (size,)."""
        return self._partners(np.ones(len(self.one), np.bool_), size)

    def _partners(self, which: NDArray[np.bool_], size: int) -> NDArray[np.int64]:
        low, high = np.minimum(self.one, self.other)[which], np.maximum(self.one, self.other)[which]
        pairs = np.unique(low * size + high)
        ends = np.concatenate([pairs // max(size, 1), pairs % max(size, 1)])
        return np.bincount(ends, minlength=size).astype(np.int64)


def find_agreements(graph: CentredGraph, gate: float) -> Agreements:
    """All short cycles. `gate`: largest squared Mahalanobis distance of a cycle that closes."""
    loops = np.flatnonzero(~graph.trusted)
    steps = neighbourhoods(graph)
    ends = np.sort(np.column_stack([graph.first, graph.second])[loops], axis=1)
    codes = ends[:, 0] * graph.count + ends[:, 1]
    order = np.argsort(codes, kind="stable")
    keys, asked = codes[order], loops[order]
    degree = np.diff(steps.start)
    work = degree[graph.first[loops]] * degree[graph.second[loops]]
    parts = np.cumsum(work) // NEIGHBOURS.batch
    found = [_cycles(graph, steps, loops[parts == part], (keys, asked), gate) for part in np.unique(parts)]
    if not found:
        nothing = np.empty(0, np.bool_)
        return Agreements(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), nothing, nothing)
    return Agreements(*(np.concatenate(column) for column in zip(*found, strict=True)))


def cycles_through(graph: CentredGraph, asked: NDArray[np.int64], gate: float) -> Agreements:
    """The short cycles through the constraints `asked` (A,), which may be false, as `other`. What lies farther away is
    not looked at, so this takes no longer in a large graph.

    `gate`: largest squared Mahalanobis distance of a cycle that closes.
    """
    ends = np.unique([graph.first[asked], graph.second[asked]])
    near, beside = np.zeros(graph.count, np.bool_), np.zeros(graph.count, np.bool_)
    near[ends] = beside[ends] = True
    for _ in range(NEIGHBOURS.steps):
        step = graph.trusted & (near[graph.first] | near[graph.second])
        near[graph.first[step]] = near[graph.second[step]] = True
    touching = beside[graph.first] | beside[graph.second]
    near[graph.first[touching]] = near[graph.second[touching]] = True
    some = np.flatnonzero(touching | (near[graph.first] & near[graph.second]))
    local = graph.only(some)
    loops = np.flatnonzero(~local.trusted)
    ends = np.sort(np.column_stack([local.first, local.second])[loops], axis=1)
    codes = ends[:, 0] * graph.count + ends[:, 1]
    order = np.argsort(codes, kind="stable")
    sought = (codes[order], loops[order])
    cycles = _cycles(local, neighbourhoods(local), np.searchsorted(some, asked), sought, gate)
    return cycles._replace(one=some[cycles.one], other=some[cycles.other])


def neighbourhoods(graph: CentredGraph) -> NeighbourSteps:
    """The neighbours of each vertex, itself included."""
    edges = np.arange(len(graph.first))
    there, back = graph.poses, inverse(graph.poses)
    back_covariances = inverse_covariances(graph.poses, graph.covariances)
    start = np.concatenate([graph.first, graph.second])
    end = np.concatenate([graph.second, graph.first])
    poses = np.concatenate([there, back])
    covariances = np.concatenate([graph.covariances, back_covariances])
    through = np.tile(np.where(graph.trusted, NOBODY, edges), 2)
    single = _sorted(graph.count, start, end, poses, covariances, through)
    known = through == NOBODY
    hop = _sorted(graph.count, start[known], end[known], poses[known], covariances[known], through[known])
    chain, parts = hop, [single]
    for _ in range(NEIGHBOURS.steps - 1):
        chain = _longer(graph, chain, hop)
        parts.append(chain)
    starts = [np.repeat(np.arange(graph.count), np.diff(part.start)) for part in parts]
    start = np.concatenate(starts)
    columns = [np.concatenate([getattr(part, name) for part in parts]) for name in NeighbourSteps._fields[1:]]
    size = np.linalg.det(columns[2])
    order = np.lexsort((size, start))
    rank = np.arange(len(start)) - np.searchsorted(start[order], start[order])
    kept = order[rank < NEIGHBOURS.most]
    own = np.arange(graph.count)
    return _sorted(
        graph.count,
        np.concatenate([own, start[kept]]),
        np.concatenate([own, columns[0][kept]]),
        np.concatenate([np.zeros((graph.count, 3)), columns[1][kept]]),
        np.concatenate([np.zeros((graph.count, 3, 3)), columns[2][kept]]),
        np.concatenate([np.full(graph.count, NOBODY), columns[3][kept]]),
    )


def _sorted(count: int, start: NDArray[np.int64], *columns: NDArray[np.generic]) -> NeighbourSteps:
    order = np.argsort(start, kind="stable")
    begins = np.concatenate([[0], np.cumsum(np.bincount(start, minlength=count))]).astype(np.int64)
    end, poses, covariances, through = (column[order] for column in columns)
    return NeighbourSteps(begins, end, poses, covariances, through)  # type: ignore[arg-type]


def _longer(graph: CentredGraph, chain: NeighbourSteps, hop: NeighbourSteps) -> NeighbourSteps:
    """Chains of trusted constraints with one more of them, without those through the map frame or back to the start."""
    start = np.repeat(np.arange(graph.count), np.diff(chain.start))
    which, how = expand(hop.start[chain.end], np.diff(hop.start)[chain.end])
    fresh = (hop.end[how] != start[which]) & (chain.end[which] != graph.map_vertex) & (start[which] != graph.map_vertex)
    which, how = which[fresh], how[fresh]
    poses = compose(chain.poses[which], hop.poses[how])
    covariances = compose_covariances(chain.covariances[which], hop.poses[how], hop.covariances[how])
    return _sorted(graph.count, start[which], hop.end[how], poses, covariances, np.full(len(how), NOBODY))


def expand(starts: NDArray[np.int64], counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For ranges `starts[i]`, `starts[i] + 1`, ... of `counts[i]` numbers: i, and the number, of all of them."""
    which = np.repeat(np.arange(len(starts)), counts)
    before = np.cumsum(counts) - counts
    return which, np.arange(len(which)) - before[which] + starts[which]


def _cycles(
    graph: CentredGraph,
    steps: NeighbourSteps,
    others: NDArray[np.int64],
    sought: tuple[NDArray[np.int64], NDArray[np.int64]],
    gate: float,
) -> Agreements:
    """The cycles through `others`. `sought`: codes of submap pairs, sorted, and the constraint of each."""
    keys, asked = sought
    degree = np.diff(steps.start)
    at, left = expand(steps.start[graph.first[others]], degree[graph.first[others]])
    again, right = expand(steps.start[graph.second[others]][at], degree[graph.second[others]][at])
    other, left = others[at[again]], left[again]
    i, j = steps.end[left], steps.end[right]
    code = np.minimum(i, j) * graph.count + np.maximum(i, j)
    begin = np.searchsorted(keys, code)
    which, place = expand(begin, np.searchsorted(keys, code, side="right") - begin)
    one, other, left, right = asked[place], other[which], left[which], right[which]
    pair = np.sort(np.column_stack([graph.first, graph.second]), axis=1)
    proper = (pair[one] != pair[other]).any(axis=1) & (one != steps.through[left]) & (one != steps.through[right])
    proper &= (other != steps.through[left]) & (other != steps.through[right])
    one, other, left, right = one[proper], other[proper], left[proper], right[proper]
    # i_T_j = (first_T_i)^-1 first_T_second second_T_j
    poses = compose(inverse(steps.poses[left]), graph.poses[other])
    covariances = inverse_covariances(steps.poses[left], steps.covariances[left])
    covariances = compose_covariances(covariances, graph.poses[other], graph.covariances[other])
    covariances = compose_covariances(covariances, steps.poses[right], steps.covariances[right])
    poses = compose(poses, steps.poses[right])
    flipped = graph.first[one] != steps.end[left]
    covariances[flipped] = inverse_covariances(poses[flipped], covariances[flipped])
    poses[flipped] = inverse(poses[flipped])
    errors = compose(inverse(graph.poses[one]), poses)
    covariances = compose_covariances(graph.covariances[one], errors, covariances)
    slack = np.diag([NEIGHBOURS.slack[0] ** 2, NEIGHBOURS.slack[0] ** 2, NEIGHBOURS.slack[1] ** 2])
    close = squared_distances(errors, covariances + slack) <= gate
    plain = _is_plain(graph, steps, left) & _is_plain(graph, steps, right)
    plain &= ~graph.is_prior[one] & ~graph.is_prior[other]
    return Agreements(one, other, squared_distances(errors, covariances), close, plain)


def _is_plain(graph: CentredGraph, steps: NeighbourSteps, which: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether ways are no ways at all, or one constraint that may be false and is no prior."""
    through = steps.through[which]
    stays = np.searchsorted(steps.start, which, side="right") - 1 == steps.end[which]
    return np.asarray(stays | ((through != NOBODY) & ~graph.is_prior[through]))
