"""Least squares on a pose graph that grows: a few vertices and constraints at a time, without solving it again.

Most of the graph, the base, is factorised once. What is new joins a few vertices of the base, and under the base alone
their joint covariance is known. So it stands for the whole base in a small dense problem of these vertices and the new
ones, and what that problem moves is spread over the base. This is exact as far as the base is linear. When
it has moved too far for that, or the small problem has grown, the base is factorised again.
"""

from typing import Final, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU

from urquhart.mapping.graph_solver import FIXED, normal_equations, residuals
from urquhart.mapping.pose_arrays import Covariances, Poses, adjoints, compose, congruent, inverse
from urquhart.mapping.pose_graph import CentredGraph


class GrowthNumbers(NamedTuple):
    """When a base is factorised again. Chosen by hand; `python -m benchmarks.maps --only maps_online` times it."""

    vertices: int = 80
    """Vertices of the small problem: its cost grows with their square."""
    neglected: float = 0.005
    """Metres: by so much the positions of the base may be off because it is taken as linear. That is at most how far a
    position has moved, times the radians that a yaw has."""
    rounds: int = 6
    """Most Gauss-Newton steps; two or three are taken, because the poses are nearly right."""
    settled: float = 1e-3
    """Metres, and a hundredth of it in radians: a smaller step ends them."""


GROWTH: Final = GrowthNumbers()


class GrowingSystem:
    """Poses (V, 3) and covariances (V, 3, 3) of vertices under the constraints that were added so far.

    A vertex is known once a constraint has joined it to others; until then it keeps its pose, and its covariance is 0.
    An error of a pose is one in the vertex's own frame.
    """

    def __init__(self, graph: CentredGraph, used: NDArray[np.int64], held: NDArray[np.int64], poses: Poses) -> None:
        """Factorise the constraints `used` (U,) at their optimum `poses`; the vertices `held` do not move."""
        self.graph, self.poses = graph, poses.copy()
        self.covariances: Covariances = np.zeros((graph.count, 3, 3))
        self._used, self._held = list[int](used.tolist()), list[int](held.tolist())
        self._base = self._touched = np.empty(0, np.int64)
        self._fresh, self._fresh_held, self._edges = list[int](), list[int](), list[int]()
        self._columns: NDArray[np.float64] = np.empty((0, 0))
        self._at, self._factors = self.poses, cast(SuperLU, None)  # there is none without constraints
        self.rebase()

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which vertices (V,) constraints have joined to others."""
        mask = np.zeros(self.graph.count, np.bool_)
        mask[[*self._base.tolist(), *self._fresh]] = True
        return mask

    @property
    def held(self) -> NDArray[np.int64]:
        """The vertices that do not move, one for each part that constraints connect."""
        return np.array(self._held, np.int64)

    def take_covariances(self, covariances: Covariances) -> None:
        """Take the covariances (V, 3, 3) of the base from whoever has found its optimum."""
        self.covariances, self._alone = covariances.copy(), covariances.copy()

    def grow(self, graph: CentredGraph) -> None:
        """Take a graph with the same constraints and vertices, and more of both; the map frame stays the last."""
        old, more = self.graph.count - 1, graph.count - self.graph.count
        home = np.column_stack([graph.centres, np.zeros(graph.count)])[old:]
        self.poses = np.concatenate([self.poses[:old], home])
        self._at = np.concatenate([self._at[:old], home])
        self.covariances = np.concatenate([self.covariances[:old], np.zeros((more + 1, 3, 3))])
        self.graph = graph

    def begin(self, vertex: int) -> None:
        """Hold a vertex that no constraint has joined: others will be joined to it."""
        self._held.append(vertex)
        self._fresh.append(vertex)
        self._fresh_held.append(vertex)
        self._at[vertex] = self.poses[vertex]

    def join(self, vertex: int, pose: NDArray[np.float64]) -> None:
        """Take a vertex that the next constraints join to known ones. `pose`: (3,), where it is about."""
        self._fresh.append(vertex)
        self._at[vertex] = self.poses[vertex] = pose

    def touch(self, vertices: NDArray[np.int64]) -> None:
        """Make vertices of the base part of the small problem, so that constraints may join them."""
        new = np.setdiff1d(np.intersect1d(vertices, self._base), self._touched)
        if not len(new):
            return
        rows = 3 * np.searchsorted(self._base, new)[:, None] + np.arange(3)
        right = np.zeros((3 * len(self._base), 3 * len(new)))
        right[rows.ravel(), np.arange(3 * len(new))] = 1.0
        self._columns = np.asarray(np.hstack([self._columns, self._factors.solve(right)]))
        self._touched = np.concatenate([self._touched, new])
        self._solve()

    def add(self, edges: NDArray[np.int64]) -> None:
        """Add constraints between known vertices, and solve for their ends."""
        self._used += edges.tolist()
        self._edges += edges.tolist()
        self.touch(np.concatenate([self.graph.first[edges], self.graph.second[edges]]))
        self._solve()

    def drop(self, edges: NDArray[np.int64]) -> None:
        """Take back constraints that were added since the base was factorised, and solve."""
        gone = set(edges.tolist())
        self._used = [one for one in self._used if one not in gone]
        if gone <= set(self._edges):
            self._edges = [one for one in self._edges if one not in gone]
            self._solve()
        else:
            self.rebase()

    def settle(self) -> None:
        """Bring all vertices up to date. The base is factorised again if it is time for that."""
        neglected = self._spread()
        if neglected > GROWTH.neglected or len(self._touched) + len(self._fresh) > GROWTH.vertices:
            self.rebase()

    def relative_covariances(self, edges: NDArray[np.int64]) -> Covariances:
        """The covariances (K, 3, 3) of first_T_second of constraints between known vertices, which are touched."""
        first, second = self.graph.first[edges], self.graph.second[edges]
        self.touch(np.concatenate([first, second]))
        back = -adjoints(compose(inverse(self.poses[second]), self.poses[first]))
        a, b = self._local(first), self._local(second)
        blocks = self._joint.reshape(len(self._joint) // 3, 3, -1, 3).transpose(0, 2, 1, 3)
        mixed = back @ blocks[a, b]
        found = congruent(back, blocks[a, a]) + mixed + mixed.transpose(0, 2, 1) + blocks[b, b]
        return 0.5 * (found + found.transpose(0, 2, 1))

    def rebase(self) -> None:
        """Factorise all constraints at the optimum: the small problem is empty afterwards."""
        used, held = np.array(self._used, np.int64), np.array(self._held, np.int64)
        self._base = np.unique(np.concatenate([self.graph.first[used], self.graph.second[used], held]))
        self._touched, self._fresh, self._fresh_held = np.empty(0, np.int64), list[int](), list[int]()
        self._edges, self._columns = list[int](), np.empty((3 * len(self._base), 0))
        for _ in range(GROWTH.rounds if len(used) else 0):
            self._factors, right = normal_equations(self.graph, used, self.poses, held)
            step = self._factors.solve(right).reshape(-1, 3)
            if np.abs(step * (1.0, 1.0, 100.0)).max() < GROWTH.settled:
                break
            self.poses[self._base] = compose(self.poses[self._base], step)
        self._at, self._alone = self.poses.copy(), self.covariances.copy()
        self._moved, self._joint = np.empty(0), np.empty((0, 0))

    def _local(self, vertices: NDArray[np.int64]) -> NDArray[np.int64]:
        """The places of vertices in the small problem."""
        places = np.full(self.graph.count, -1, np.int64)
        members = np.concatenate([self._touched, np.array(self._fresh, np.int64)])
        places[members] = np.arange(len(members))
        return places[vertices]

    def _solve(self) -> None:
        """Solve the small problem: poses, covariances and joint covariance of its vertices."""
        touched, fresh = self._touched, np.array(self._fresh, np.int64)
        rows, size = 3 * len(touched), 3 * (len(touched) + len(fresh))
        prior = np.zeros((size, size))
        prior[:rows, :rows] = np.linalg.inv(self._apart())
        fixed = 3 * self._local(np.array(self._fresh_held, np.int64))[:, None] + np.arange(3)
        prior[fixed, fixed] = 1.0 / np.square(FIXED)
        delta, members = np.zeros(size), np.concatenate([touched, fresh])
        edges = np.array(self._edges, np.int64)
        for _ in range(GROWTH.rounds):
            self.poses[members] = compose(self._at[members], delta.reshape(-1, 3))
            information, right = self._equations(edges, prior, delta)
            step = np.linalg.solve(information, right)
            delta += step
            if np.abs(step.reshape(-1, 3) * (1.0, 1.0, 100.0)).max(initial=0.0) < GROWTH.settled:
                break
        self.poses[members] = compose(self._at[members], delta.reshape(-1, 3))
        self._joint = np.asarray(np.linalg.inv(information), np.float64)
        self._moved = delta[:rows]
        # New vertices have no base to be linear about: the next steps begin where they are.
        self._at[fresh] = self.poses[fresh]
        for place, vertex in enumerate(members.tolist()):
            self.covariances[vertex] = self._joint[3 * place : 3 * place + 3, 3 * place : 3 * place + 3]

    def _apart(self) -> NDArray[np.float64]:
        """The joint covariance of the vertices of the small problem that belong to the base, under the base alone."""
        rows = (3 * np.searchsorted(self._base, self._touched)[:, None] + np.arange(3)).ravel()
        alone = self._columns[rows]
        return np.asarray(0.5 * (alone + alone.T), np.float64)

    def _spread(self) -> float:
        """Spread over the base what the small problem has moved. Returns what that neglects at most, metres."""
        if not len(self._touched):
            return 0.0
        alone, rows = self._apart(), 3 * len(self._touched)
        weight = np.linalg.inv(alone)
        delta = (self._columns @ (weight @ self._moved)).reshape(-1, 3)
        self.poses[self._base] = compose(self._at[self._base], delta)
        change = self._columns @ (weight @ (self._joint[:rows, :rows] - alone) @ weight)
        blocks = change.reshape(-1, 3, rows) @ self._columns.reshape(-1, 3, rows).transpose(0, 2, 1)
        self.covariances[self._base] = self._alone[self._base] + 0.5 * (blocks + blocks.transpose(0, 2, 1))
        return float(np.abs(delta[:, 2]).max() * np.hypot(*delta[:, :2].T).max())

    def _equations(
        self, edges: NDArray[np.int64], prior: NDArray[np.float64], delta: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Information and right side of the small problem at the present poses, `delta` away from where it began."""
        graph, size = self.graph, len(delta) // 3
        information, right = prior.copy(), (-prior @ delta).reshape(size, 3)
        first, second = graph.first[edges], graph.second[edges]
        back = -adjoints(compose(inverse(self.poses[second]), self.poses[first]))
        weight = np.linalg.inv(graph.covariances[edges])
        from_first = back.transpose(0, 2, 1) @ weight
        errors = residuals(graph.only(edges), self.poses)[:, :, None]
        a, b = self._local(first), self._local(second)
        blocks = information.reshape(size, 3, size, 3).transpose(0, 2, 1, 3)
        for i, j, block in ((a, a, from_first @ back), (a, b, from_first), (b, a, weight @ back), (b, b, weight)):
            np.add.at(blocks, (i, j), block)
        np.add.at(right, a, -(from_first @ errors)[:, :, 0])
        np.add.at(right, b, -(weight @ errors)[:, :, 0])
        return information, right.ravel()
