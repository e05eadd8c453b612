"""Which trusted constraints are left out because others contradict them.

Odometry is a measurement with a covariance: a wheel slips, or a robot is carried. So each odometry edge is compared
with all ways beside it (`ways`). Those that contradict it prove it wrong only if they agree with each other, because
false matches scatter, and if they share neither a constraint nor a submap, because one false match can spoil many ways.
An edge with enough of them is refused. Where odometry contradicts only itself, the edge with most ways against it is
refused; where these are equally many, nothing tells which edge is wrong, and all of them are left out.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from urquhart.mapping.agreement import NOBODY
from urquhart.mapping.odometry.ways import SLACK, Ways, find_ways
from urquhart.mapping.pose_arrays import compose, compose_covariances, inverse, squared_distances
from urquhart.mapping.pose_graph import CentredGraph

Outcome = Literal["refused", "undecided"]


class OdometryNumbers(NamedTuple):
    """What proves odometry wrong. Chosen by hand; `python -m benchmarks.maps --only maps_graphs` shows what they do."""

    witnesses: int = 3
    """Independent ways that must agree against an edge, beyond those for it."""
    weight: int = 2
    """A way for an edge counts as much as this many against it."""
    hopeless: int = 4
    """Edges with one way for them to this many against them are not looked at: false matches scatter."""
    group: int = 5
    """Matches without a common submap that must agree before a chain of odometry that opposes them is named."""
    asked: int = 10
    """Matches of such a group whose chains are compared: more cost time only."""
    certain: float = 1.0 - 1e-6
    """Share of right odometry that passes where nothing but odometry contradicts it: 5.5 standard deviations."""
    separate: int = 4
    """Ways through a whole map that share no submap and contradict an edge: three false matches that agree are not
    enough."""
    pulled: float = 0.2
    """An edge is looked at if its residual is this share of what is certainly wrong: the rest is in its neighbours."""
    compared: int = 60
    """Ways of an edge that are compared with each other, the shortest and most precise ones: more cost time only."""


ODOMETRY: Final = OdometryNumbers()


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Constraints that cannot all be right within their covariances.

    Attributes:
        edges: the trusted constraints, of which at least one is wrong.
        against: the constraints that contradict them and agree with each other; empty if `edges` contradict each other.
        witnesses: how many ways, which share no constraint and no submap, contradict `edges`.
        sigmas: how far both sides are apart, in standard deviations (Mahalanobis distance).
        outcome: `refused` if `edges` were left out; `undecided` if nothing tells which side is wrong.
    """

    edges: tuple[int, ...]
    against: tuple[int, ...]
    witnesses: int
    sigmas: float
    outcome: Outcome


class Judgement(NamedTuple):
    """What was found of trusted constraints.

    Attributes:
        refused, undecided: (E,) bool, those that are wrong, and those of which nothing tells which is wrong.
        contradictions: why.
        doubtful: of others, which the ways beside them contradict with too little proof.
    """

    refused: NDArray[np.bool_]
    undecided: NDArray[np.bool_]
    contradictions: list[Contradiction]
    doubtful: list[Contradiction]


class _Sides(NamedTuple):
    """Independent ways beside an edge: those for it, and those against it that agree with each other."""

    good: list[int]
    bad: list[int]

    @property
    def score(self) -> int:
        return len(self.bad) - ODOMETRY.weight * len(self.good)


def certain_gate() -> float:
    """The largest squared Mahalanobis distance that odometry may be off where no match says anything."""
    return 2.0 * float(gammaincinv(1.5, ODOMETRY.certain))


def judge_odometry(graph: CentredGraph, gate: float) -> Judgement:
    """Compare trusted constraints between submaps with the ways beside them.

    `gate`: largest squared Mahalanobis distance of ways that agree.
    """
    asked = np.flatnonzero(graph.trusted & ~graph.is_prior)
    bench = _Bench(graph, find_ways(graph, asked), gate)
    bench.refuse_contradicted()
    bench.resolve_cycles()
    return Judgement(bench.refused, bench.undecided, bench.contradictions, bench.even_evidence())


class _Bench:
    """The edges under judgement, and what was found of them so far."""

    def __init__(self, graph: CentredGraph, ways: Ways, gate: float) -> None:
        self.graph, self.ways, self.gate = graph, ways, gate
        size = len(graph.first)
        self.refused, self.undecided = np.zeros(size, np.bool_), np.zeros(size, np.bool_)
        self.contradictions: list[Contradiction] = []
        self._begin = np.searchsorted(ways.edge, np.arange(size + 1))
        bad = ways.distances > gate
        against = np.bincount(ways.edge[bad], minlength=size)
        favour = np.bincount(ways.edge[~bad], minlength=size)
        suspects = np.flatnonzero((against > 0) & (ODOMETRY.hopeless * favour <= against)).tolist()
        self._sides = {edge: self._judge(edge) for edge in suspects}
        self._beside = defaultdict[int, set[int]](set)
        for edge in suspects:
            for used in np.unique(ways.used[self._of(edge)]).tolist():
                self._beside[used].add(edge)

    def refuse_contradicted(self) -> None:
        """Refuse edges that enough ways contradict, the clearest first: ways through a wrong edge are no evidence."""
        while self._sides:
            edge = max(self._sides, key=lambda one: (self._sides[one].score, -one))
            if self._sides[edge].score < ODOMETRY.witnesses:
                return
            self._leave_out([edge], self._sides[edge].bad, "refused")

    def resolve_cycles(self) -> None:
        """Leave out odometry that contradicts other odometry: in each cycle the edges with most against them."""
        far = certain_gate()
        only = self.graph.trusted[np.maximum(self.ways.used, 0)] | (self.ways.used == NOBODY)
        cycles = np.flatnonzero(only.all(axis=1) & (self.ways.distances > far)).tolist()
        while cycles := [way for way in cycles if self._is_open(way)]:
            members = {way: self._members(way) for way in cycles}
            scores = {edge: self._judge(edge).score for some in members.values() for edge in some}
            worst = max(cycles, key=lambda way: (max(scores[edge] for edge in members[way]), -way))
            most = max(scores[edge] for edge in members[worst])
            blamed = [edge for edge in members[worst] if scores[edge] == most]
            self._leave_out(blamed, [worst], "refused" if len(blamed) == 1 else "undecided")

    def even_evidence(self) -> list[Contradiction]:
        """Edges that more than one way contradicts for certain, and none confirms, where that is too little proof."""
        far, found = certain_gate(), list[Contradiction]()
        for edge, sides in sorted(self._sides.items()):
            clear = [way for way in sides.bad if self.ways.distances[way] > far]
            if not sides.good and len(clear) > 1:
                found.append(self._named((edge,), clear, "undecided"))
        return found

    def _members(self, way: int) -> list[int]:
        """The constraints of the cycle of a way and its edge."""
        return sorted({int(self.ways.edge[way]), *(one for one in self.ways.used[way].tolist() if one != NOBODY)})

    def _is_open(self, way: int) -> bool:
        out = self.refused | self.undecided
        return not any(out[one] for one in self._members(way))

    def _leave_out(self, edges: Sequence[int], bad: Sequence[int], outcome: Outcome) -> None:
        self.contradictions.append(self._named(tuple(edges), bad, outcome))
        (self.refused if outcome == "refused" else self.undecided)[list(edges)] = True
        for edge in edges:
            self._sides.pop(edge, None)
        for other in sorted(set().union(*(self._beside[edge] for edge in edges)) & self._sides.keys()):
            self._sides[other] = self._judge(other)

    def _named(self, edges: tuple[int, ...], bad: Iterable[int], outcome: Outcome) -> Contradiction:
        ways = list(bad)
        used = {int(one) for one in self.ways.used[ways].ravel() if one != NOBODY} - set(edges)
        sigmas = float(np.sqrt(np.median(self.ways.distances[ways])))
        return Contradiction(edges, tuple(sorted(used)), len(ways), sigmas, outcome)

    def _of(self, edge: int) -> NDArray[np.int64]:
        return np.arange(self._begin[edge], self._begin[edge + 1])

    def _judge(self, edge: int) -> _Sides:
        """The independent ways for and against an edge, without those through constraints that were left out."""
        ways, of = self.ways, self._of(edge)
        out = np.append(self.refused | self.undecided, False)  # the last one stands for NOBODY
        of = of[~out[ways.used[of]].any(axis=1)]
        if not len(of):
            return _Sides([], [])
        length = (ways.used[of] != NOBODY).sum(axis=1)
        size = np.linalg.det(ways.covariances[of])
        of = of[np.lexsort((of, size, length))]
        good = self._independent(of[ways.distances[of] <= self.gate])
        bad = of[ways.distances[of] > self.gate][: ODOMETRY.compared]
        if not len(bad):
            return _Sides(good, [])
        one, other = (grid.ravel() for grid in np.meshgrid(bad, bad, indexing="ij"))
        errors = compose(inverse(ways.poses[one]), ways.poses[other])
        spread = compose_covariances(ways.covariances[one], errors, ways.covariances[other]) + SLACK
        agree = (squared_distances(errors, spread) <= self.gate).reshape(len(bad), len(bad))
        # Secondary matches are off by a row of trees together, so they only join in with ways that have none.
        secondary = (self.graph.secondary[np.maximum(ways.used[bad], 0)] & (ways.used[bad] != NOBODY)).any(axis=1)
        count = np.where(secondary, 0, agree.sum(axis=1))
        rows = [row for row in np.argsort(-count, kind="stable")[:3].tolist() if count[row]]
        sets = [self._independent(bad[agree[row]]) for row in rows]
        return _Sides(good, max(sets, key=len, default=[]))

    def _independent(self, ways: NDArray[np.int64]) -> list[int]:
        """Ways, the first ones of those given, that share neither a constraint nor a vertex."""
        chosen, taken = list[int](), set[int]()
        offset = len(self.graph.first)
        for way in ways.tolist():
            parts = {one for one in self.ways.used[way].tolist() if one != NOBODY}
            parts |= {offset + one for one in self.ways.between[way].tolist() if one != NOBODY}
            if taken.isdisjoint(parts):
                taken |= parts
                chosen.append(way)
        return chosen
