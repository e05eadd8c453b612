"""Least squares on a pose graph by GTSAM (https://gtsam.org, BSD): the only module that imports it.

GTSAM is an extra, `pip install 'urquhart[maps]'`: its wheel has 34 MB, and only maps need it. It has wheels for Linux
(x86-64, aarch64) and macOS.
"""

from collections.abc import Sequence
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.linalg import SuperLU, splu

from urquhart.mapping.pose_arrays import Covariances, Poses, adjoints, compose, inverse
from urquhart.mapping.pose_graph import CentredGraph

FIXED: Final = (1e-5, 1e-5, 1e-7)
"""Metres, metres, radians: standard deviations of a pose that is held where it is."""
_LOOSE: Final = (1e5, 1e5, 1e3)
"""Those of a prior that only keeps the equations solvable while constraints are being weighted down to nothing."""


_SOLVED: Final = 100
"""Pairs whose covariances are solved for at once: more take more memory, and no less time."""


class MissingOptimiser(ImportError):
    """GTSAM is not installed."""


def optimiser() -> ModuleType:
    """GTSAM. Raises MissingOptimiser if it is not installed."""
    try:
        import gtsam
    except ImportError as error:
        raise MissingOptimiser(
            "maps need GTSAM, which is not installed: pip install 'urquhart[maps]' (there are wheels for Linux and "
            "macOS, Python 3.11 to 3.13)"
        ) from error
    module: ModuleType = gtsam
    return module


class GraphSolver:
    """Poses of the vertices of a graph under some of its constraints, with some vertices held where they are."""

    def __init__(self, graph: CentredGraph, used: NDArray[np.int64], held: Sequence[int], start: Poses) -> None:
        """Build the equations.

        Args:
            graph: the vertices and their constraints.
            used: (U,) int64, the constraints to use.
            held: vertices that stay where they start: one for each part that the constraints connect.
            start: (V, 3) float64, pose of each vertex to start from.

        Raises:
            MissingOptimiser: GTSAM is not installed.
        """
        self._gtsam = optimiser()
        self._graph, self._used, self._start, self._held = graph, used, start, np.array(held, np.int64)
        self._factors_of_information: SuperLU | None = None
        self._marginals: Covariances | None = None
        self._poses = start
        self._vertices = np.unique(np.concatenate([graph.first[used], graph.second[used], np.array(held, np.int64)]))
        self._is_known = np.zeros(graph.count, np.bool_)
        self._is_known[self._vertices] = True
        self._place = np.cumsum(self._is_known) - 1  # of each vertex among those that the equations are of
        self._factors = self._gtsam.NonlinearFactorGraph()
        model = self._gtsam.noiseModel
        for first, second, pose, covariance in zip(
            graph.first[used].tolist(),
            graph.second[used].tolist(),
            graph.poses[used].tolist(),
            graph.covariances[used],
            strict=True,
        ):
            noise = model.Gaussian.Covariance(0.5 * (covariance + covariance.T))
            self._factors.add(self._gtsam.BetweenFactorPose2(first, second, self._gtsam.Pose2(*pose), noise))
        fixed = model.Diagonal.Sigmas(np.array(FIXED))
        for vertex in held:
            self._factors.add(self._gtsam.PriorFactorPose2(vertex, self._gtsam.Pose2(*start[vertex].tolist()), fixed))
        self._values = self._as_values(start)

    def solve(self) -> Poses:
        """The optimum (V, 3) from the present poses; vertices without a constraint keep theirs."""
        optimum = self._gtsam.LevenbergMarquardtOptimizer(self._factors, self._values).optimize()
        self._values, self._factors_of_information, self._marginals = optimum, None, None
        self._poses = self._as_poses(optimum)
        return self._poses

    def graduate(self, inlier_cost: float, known: NDArray[np.bool_]) -> tuple[Poses, NDArray[np.bool_]]:
        """The optimum without the constraints that contradict the largest consistent set of them.

        Graduated non-convexity with truncated least squares (Yang et al. 2020): a constraint that is farther off than
        the gate costs a constant, and the cost is made non-convex little by little.

        Args:
            inlier_cost: half the squared Mahalanobis distance up to which a constraint is kept.
            known: (U,) bool, constraints that are kept whatever they cost.

        Returns:
            The poses (V, 3), and which of the constraints (U,) are kept.
        """
        factors = self._gtsam.NonlinearFactorGraph(self._factors)
        loose = self._gtsam.noiseModel.Diagonal.Sigmas(np.array(_LOOSE))
        for vertex in self._vertices.tolist():
            at = self._gtsam.Pose2(*self._start[vertex].tolist())
            factors.add(self._gtsam.PriorFactorPose2(vertex, at, loose))
        params = self._gtsam.GncLMParams()
        always = np.concatenate([np.flatnonzero(known), np.arange(len(self._used), factors.size())])
        params.setKnownInliers(always.tolist())
        solver = self._gtsam.GncLMOptimizer(factors, self._values, params)
        solver.setInlierCostThresholds(inlier_cost)
        self._values, self._factors_of_information, self._marginals = solver.optimize(), None, None
        self._poses = self._as_poses(self._values)
        weights = np.asarray(solver.getWeights())[: len(self._used)]
        return self._poses, np.asarray((weights > 0.5) | known)

    @property
    def used_mask(self) -> NDArray[np.bool_]:
        """Which constraints (E,) of the graph are used."""
        mask = np.zeros(len(self._graph.first), np.bool_)
        mask[self._used] = True
        return mask

    def covariances(self) -> Covariances:
        """The covariance (V, 3, 3) of each vertex at the present poses, of an error in its own frame.

        0 for vertices that are held, and for those without constraints.
        """
        if self._marginals is None:
            marginals = self._gtsam.Marginals(self._factors, self._values)
            self._marginals = np.zeros((self._graph.count, 3, 3))
            for vertex in np.setdiff1d(self._vertices, self._held).tolist():
                self._marginals[vertex] = marginals.marginalCovariance(vertex)
        return self._marginals

    def relative_covariances(self, first: NDArray[np.int64], second: NDArray[np.int64]) -> Covariances:
        """The covariances (K, 3, 3) of first_T_second at the present poses, of an error in the frame of `second`.

        `first`, `second`: (K,) int64, pairs of vertices of one part each.
        """
        found = np.zeros((len(first), 3, 3))
        known = self._is_known
        for begin in range(0, len(first), _SOLVED):
            some = np.arange(begin, min(begin + _SOLVED, len(first)))
            back = -adjoints(compose(inverse(self._poses[second[some]]), self._poses[first[some]]))
            right = np.zeros((len(some), 3, 3 * len(self._vertices)))
            for ends, blocks in ((first[some], back), (second[some], np.tile(np.eye(3), (len(some), 1, 1)))):
                columns = 3 * self._place[ends][:, None] + np.arange(3)
                numbers = np.flatnonzero(known[ends])
                for row in range(3):
                    right[numbers[:, None], row, columns[numbers]] += blocks[numbers, row]
            flat = right.reshape(3 * len(some), 3 * len(self._vertices))
            solved = self._factorised().solve(np.ascontiguousarray(flat.T))
            found[some] = np.einsum("kiv,vkj->kij", right, solved.reshape(-1, len(some), 3))
        return 0.5 * (found + found.transpose(0, 2, 1))

    def _factorised(self) -> SuperLU:
        """The information matrix of all vertices at the present poses, factorised.

        For a pair of poses it is faster than GTSAM's marginals, which take 70 ms for each pair of 1,000 poses.
        """
        if self._factors_of_information is None:
            self._factors_of_information, _ = normal_equations(self._graph, self._used, self._poses, self._held)
        return self._factors_of_information

    def _as_values(self, poses: Poses) -> Any:
        values = self._gtsam.Values()
        for vertex in self._vertices.tolist():
            values.insert(vertex, self._gtsam.Pose2(*poses[vertex].tolist()))
        return values

    def _as_poses(self, values: Any) -> Poses:
        poses = self._start.copy()
        poses[self._vertices] = self._gtsam.utilities.extractPose2(values)  # in the order of the keys
        poses[self._held] = self._start[self._held]  # held to 10 micrometres, and wanted exactly
        return poses


def normal_equations(
    graph: CentredGraph, used: NDArray[np.int64], poses: Poses, held: NDArray[np.int64]
) -> tuple[SuperLU, NDArray[np.float64]]:
    """The information matrix of vertices at the poses (V, 3), factorised, and the right side of the normal equations.

    The vertices are those of the constraints `used` (U,) and of `held`, in order, each with 3 rows: an error in its own
    frame. The solution is the Gauss-Newton step towards the optimum.
    """
    vertices = np.unique(np.concatenate([graph.first[used], graph.second[used], held]))
    first, second = (np.searchsorted(vertices, ends[used]) for ends in (graph.first, graph.second))
    relative = compose(inverse(poses[graph.first[used]]), poses[graph.second[used]])
    back = -adjoints(inverse(relative))
    weight = np.linalg.inv(graph.covariances[used])
    from_first = back.transpose(0, 2, 1) @ weight
    anchored = np.searchsorted(vertices, held)
    fixed = np.tile(np.diag(1.0 / np.square(FIXED)), (len(held), 1, 1))
    rows = np.concatenate([first, first, second, second, anchored])
    columns = np.concatenate([first, second, first, second, anchored])
    blocks = np.concatenate([from_first @ back, from_first, weight @ back, weight, fixed])
    i = np.broadcast_to(3 * rows[:, None, None] + np.arange(3)[:, None], blocks.shape)
    j = np.broadcast_to(3 * columns[:, None, None] + np.arange(3), blocks.shape)
    size = 3 * len(vertices)
    matrix = coo_array((blocks.ravel(), (i.ravel(), j.ravel())), shape=(size, size)).tocsc()
    symmetric = {"SymmetricMode": True}
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
    errors = compose(inverse(graph.poses[used]), relative)
    right = np.zeros((len(vertices), 3))
    np.add.at(right, first, -(from_first @ errors[:, :, None])[:, :, 0])
    np.add.at(right, second, -(weight @ errors[:, :, None])[:, :, 0])
    return factors, right.ravel()


def residuals(graph: CentredGraph, poses: Poses) -> Poses:
    """How far each constraint (E, 3) is from the poses (V, 3): the error in the frame of its second vertex."""
    relative = compose(inverse(poses[graph.first]), poses[graph.second])
    return compose(inverse(graph.poses), relative)
