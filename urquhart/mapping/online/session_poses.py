"""Poses of a drive while it goes on: judged and optimised at once now and then, brought up to date in between.

The whole search for a consistent set of constraints (`optimise`) takes seconds for 1,000 submaps. So its result is
kept, and what comes afterwards is judged by it: odometry is believed, and a match is used where the poses so far are
known well enough to tell that it is right. Whatever that does not decide waits for the next whole search: matches that
close a long drive, that contradict the poses and are confirmed by others, or that join parts. Waiting costs accuracy,
never a false loop.
"""

from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.mapping.agreement import cycles_through
from urquhart.mapping.consistency import MAPPING, chi_squared
from urquhart.mapping.graph_solver import residuals
from urquhart.mapping.joining import Judge, join
from urquhart.mapping.odometry.judging import certain_gate
from urquhart.mapping.online.growing_system import GrowingSystem
from urquhart.mapping.optimisation import OptimisedPoses, Refusal
from urquhart.mapping.pose_arrays import (
    Covariances,
    Poses,
    compose,
    congruent,
    inverse,
    moved,
    rotations,
    squared_distances,
    swung,
)
from urquhart.mapping.pose_graph import CentredGraph, PoseConstraints, centred, centred_about, centres_of
from urquhart.mapping.start_poses import anchors, parts

Standing = Literal["used", "pending"] | Refusal
"""What became of a constraint. `pending`: the next whole search decides."""


class OnlineNumbers(NamedTuple):
    """When the whole search is due. Chosen by hand; `python -m benchmarks.maps --only maps_online` shows how often."""

    growth: float = 1.25
    """Times the submaps of the last search: what little the poses differ from a whole search does not add up."""
    least: int = 30
    """Submaps that must have come for that reason: of a short drive, more would cost time only."""
    against: int = 4
    """Matches that contradict the poses and must confirm another one: fewer are seen where one place is taken for
    another more than once, and did not change the map."""


ONLINE: Final = OnlineNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class CurrentPoses:
    """Poses of all submaps so far.

    Attributes:
        poses: (S, 3) float64, x, y (metres), yaw (radians) of each submap in the frame of its part.
        covariances: (S, 3, 3) float64 over (x, y, yaw): of the submap's origin along the axes of that frame, square
            metres, and of the yaw. All 0 for the submap whose frame a part has.
        part: (S,) int64, the part of each submap, numbered from 0 by its first submap.
        frame_of: (K,) int64, the submap whose frame each part has: the one that it began with.
        standings: (E,) what became of each constraint.
        search_due: whether a whole search might decide what waits, or is due because the drive has grown.
    """

    poses: Poses
    covariances: Covariances
    part: NDArray[np.int64]
    frame_of: NDArray[np.int64]
    standings: tuple[Standing, ...]
    search_due: bool


class GrowingPoses:
    """The poses of a drive after a whole search, and what came since."""

    def __init__(self, count: int, constraints: PoseConstraints, searched: OptimisedPoses) -> None:
        """Begin with the result of `optimise(count, constraints)`, without priors."""
        graph = centred(count, constraints)
        self._scale, self._searched, self._due = searched.scale, count, False
        self._graph = self._scaled(graph)
        self._standings = np.array([reason or "used" for reason in searched.refusals], object)
        kept = self._standings == "used"
        part = parts(self._graph, kept)
        held = anchors(self._graph, part)
        held = held[np.bincount(part, minlength=len(held)) > 1]
        poses = np.column_stack([graph.centres, np.zeros(graph.count)])
        poses[:count] = compose(searched.poses, poses[:count])
        self._system = GrowingSystem(self._graph, np.flatnonzero(kept), held, poses)
        turned = congruent(rotations(-searched.poses[:, 2]), searched.covariances)
        self._system.take_covariances(np.concatenate([turned, np.zeros((1, 3, 3))]))

    @property
    def submaps(self) -> int:
        """The number of submaps."""
        return self._graph.count - 1

    @property
    def constraints(self) -> int:
        """The number of constraints."""
        return len(self._standings)

    def add(self, count: int, more: PoseConstraints) -> None:
        """Take the submaps up to `count`, and more constraints between all of them. Raises PoseGraphError."""
        more.check(count)
        begin = len(self._standings)
        self._grow(count, more)
        new = np.arange(begin, len(self._standings))
        self._follow_odometry(new[self._graph.trusted[new]])
        self._judge(np.flatnonzero(~self._graph.trusted & np.isin(self._standings, ("pending", "unconfirmed"))), begin)
        self._check_odometry(new)
        self._system.settle()
        if count > max(ONLINE.growth * self._searched, self._searched + ONLINE.least):
            self._due = True

    def current(self) -> CurrentPoses:
        """The poses as they are now."""
        graph, system, count = self._graph, self._system, self._graph.count - 1
        part = parts(graph, self._standings == "used")[:count]
        _, begins, numbers = np.unique(part, return_index=True, return_inverse=True)
        rank = np.argsort(np.argsort(begins))
        own, centres = system.poses[:count], graph.centres[:count]
        back = np.column_stack([-centres, np.zeros(count)])
        poses = compose(own, back)
        about = congruent(rotations(own[:, 2]), system.covariances[:count])
        # The covariance about the middle of the trees becomes that of the submap's origin.
        about = swung(about, poses[:, :2] - moved(poses, centres))
        numbered = rank[numbers].astype(np.int64)
        frames = np.sort(begins)
        frames[numbered[system.held]] = system.held
        about[frames] = 0.0
        return CurrentPoses(poses, about, numbered, frames, tuple(self._standings.tolist()), self._due)

    def _scaled(self, graph: CentredGraph) -> CentredGraph:
        factor = np.where(graph.trusted, 1.0, self._scale)
        return replace(graph, covariances=factor[:, None, None] * graph.covariances)

    def _grow(self, count: int, more: PoseConstraints) -> None:
        old, before = self._graph, self._graph.count - 1
        centres = centres_of(count, more)
        centres[:before] = old.centres[:before]
        added = self._scaled(centred_about(centres, more))
        self._graph = CentredGraph(
            added.count,
            added.centres,
            np.concatenate([old.first, added.first]),
            np.concatenate([old.second, added.second]),
            np.concatenate([old.poses, added.poses]),
            np.concatenate([old.covariances, added.covariances]),
            np.concatenate([old.trusted, added.trusted]),
            np.concatenate([old.secondary, added.secondary]),
        )
        pending = np.full(len(more), "pending", object)
        self._standings = np.concatenate([self._standings, pending])
        self._system.grow(self._graph)

    def _follow_odometry(self, odometry: NDArray[np.int64]) -> None:
        """Believe odometry that leads to new submaps; the rest of it waits."""
        graph, system, left = self._graph, self._system, odometry.tolist()
        used = list[int]()
        while True:
            known, later = system.known, list[int]()
            for edge in left:
                a, b = int(graph.first[edge]), int(graph.second[edge])
                if known[a] and known[b]:
                    later.append(edge)
                    continue
                if not known[a] and not known[b]:
                    later.append(edge)
                    continue
                step = graph.poses[edge : edge + 1]
                if known[a]:
                    system.join(b, compose(system.poses[a : a + 1], step)[0])
                else:
                    system.join(a, compose(system.poses[b : b + 1], inverse(step))[0])
                known[a] = known[b] = True
                used.append(edge)
            apart = [edge for edge in later if not known[graph.first[edge]] and not known[graph.second[edge]]]
            if apart:
                system.begin(int(min(graph.first[apart[0]], graph.second[apart[0]])))
            elif len(later) == len(left):
                break
            left = later
        if used:
            self._use(np.array(used, np.int64))
        if left:  # closes a cycle of odometry, or joins two parts
            self._due = True

    def _judge(self, asked: NDArray[np.int64], begin: int) -> None:
        """Use matches that agree with poses which are known well enough to tell. `begin`: the first new constraint."""
        graph, system = self._graph, self._system
        if not len(asked):
            return
        judge = Judge(chi_squared(MAPPING.probability), MAPPING.sharp, alone=False)
        self._attach(asked, judge)
        part, known = parts(graph, self._standings == "used"), system.known
        new = asked[asked >= begin]
        inside = part[graph.first[asked]] == part[graph.second[asked]]
        inside &= known[graph.first[asked]] & known[graph.second[asked]]
        if (~inside[asked >= begin]).any():
            self._due = True
        asked = asked[inside & ((asked >= begin) | self._beside(asked, new))]
        if not len(asked):
            return
        spread = system.relative_covariances(asked)
        distances = squared_distances(residuals(graph.only(asked), system.poses), graph.covariances[asked] + spread)
        sharp = np.linalg.eigvalsh(spread[:, :2, :2])[:, -1] <= judge.sharp**2
        agrees = distances <= judge.gate
        self._use(asked[agrees & sharp])
        off = squared_distances(residuals(graph.only(asked), system.poses), graph.covariances[asked]) > judge.gate
        dropped = asked[agrees & sharp & off]
        if len(dropped):
            system.drop(dropped)
            self._standings[dropped] = "contradicted"
        self._standings[asked[~agrees & sharp]] = "contradicted"
        self._standings[asked[~sharp]] = "unconfirmed"
        fresh = asked >= begin
        self._weigh(asked[~agrees & sharp & fresh], ONLINE.against, judge.gate)
        self._weigh(asked[~sharp & fresh], 1, judge.gate)

    def _weigh(self, left: NDArray[np.int64], least: int, gate: float) -> None:
        """Let a whole search decide of matches that were not used, if `least` others that were not confirm one."""
        if not len(left):
            return
        cycles = cycles_through(self._graph, left, gate)
        unused = cycles.close & (self._standings[cycles.one] != "used")
        pairs = np.unique(np.column_stack([cycles.other, cycles.one])[unused], axis=0)
        waits = left[np.bincount(pairs[:, 0], minlength=len(self._standings))[left] >= least]
        if len(waits):
            self._standings[waits] = "pending"
            self._due = True

    def _attach(self, asked: NDArray[np.int64], judge: Judge) -> None:
        """Join submaps that nothing has joined yet by several matches that agree with each other."""
        graph, system = self._graph, self._system
        loose = ~system.known
        left = np.zeros(len(self._standings), np.bool_)
        left[asked] = loose[graph.first[asked]] != loose[graph.second[asked]]
        left &= ~graph.secondary
        if not left.any():
            return
        joined, poses = join(graph, self._standings == "used", left, system.poses, judge)
        edges = np.flatnonzero(joined)
        fresh = np.unique(np.concatenate([graph.first[edges], graph.second[edges]]))
        for vertex in fresh[loose[fresh]].tolist():
            system.join(vertex, poses[vertex])
        self._use(edges)

    def _check_odometry(self, new: NDArray[np.int64]) -> None:
        """Let a whole search decide of odometry that the matches pull away from what it says."""
        odometry = new[self._graph.trusted[new] & (self._standings[new] == "used")]
        errors = residuals(self._graph.only(odometry), self._system.poses)
        if (squared_distances(errors, self._graph.covariances[odometry]) > certain_gate()).any():
            self._due = True

    def _beside(self, asked: NDArray[np.int64], new: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which matches (A,) have an end in common with new ones, which may have made its pose more certain."""
        ends = np.concatenate([self._graph.first[new], self._graph.second[new]])
        return np.isin(self._graph.first[asked], ends) | np.isin(self._graph.second[asked], ends)

    def _use(self, edges: NDArray[np.int64]) -> None:
        if len(edges):
            self._system.add(edges)
            self._standings[edges] = "used"
