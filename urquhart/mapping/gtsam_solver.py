"""Least squares on a pose graph by GTSAM (https://gtsam.org, BSD): the only module that imports it.

GTSAM is an extra, `pip install 'urquhart[maps]'`: its wheel has 34 MB, and only maps need it. It has wheels for Linux
(x86-64, aarch64) and macOS.
"""

from collections.abc import Sequence
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart.mapping.pose_arrays import Covariances, Poses, compose, inverse
from urquhart.mapping.pose_graph import CentredGraph

_FIXED: Final = (1e-5, 1e-5, 1e-7)
"""Metres, metres, radians: standard deviations of a pose that is held where it is."""
_LOOSE: Final = (1e5, 1e5, 1e3)
"""Those of a prior that only keeps the equations solvable while constraints are being weighted down to nothing."""


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
        self._factorised: Any = None
        self._vertices = np.unique(np.concatenate([graph.first[used], graph.second[used], np.array(held, np.int64)]))
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
        fixed = model.Diagonal.Sigmas(np.array(_FIXED))
        for vertex in held:
            self._factors.add(self._gtsam.PriorFactorPose2(vertex, self._gtsam.Pose2(*start[vertex].tolist()), fixed))
        self._values = self._as_values(start)

    def solve(self) -> Poses:
        """The optimum (V, 3) from the present poses; vertices without a constraint keep theirs."""
        optimum = self._gtsam.LevenbergMarquardtOptimizer(self._factors, self._values).optimize()
        self._values, self._factorised = optimum, None
        return self._as_poses(optimum)

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
        self._values, self._factorised = solver.optimize(), None
        weights = np.asarray(solver.getWeights())[: len(self._used)]
        return self._as_poses(self._values), np.asarray((weights > 0.5) | known)

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
        found = np.zeros((self._graph.count, 3, 3))
        marginals = self._marginals()
        for vertex in self._vertices.tolist():
            found[vertex] = marginals.marginalCovariance(vertex)
        found[self._held] = 0.0
        return found

    def relative_covariance(self, first: int, second: int) -> Covariances:
        """The covariance (3, 3) of first_T_second at the present poses, of an error in the frame of `second`."""
        joint = self._marginals().jointMarginalCovariance([first, second])
        there, back = self._values.atPose2(first), self._values.atPose2(second)
        adjoint = back.between(there).AdjointMap()
        swing = np.concatenate([-adjoint, np.eye(3)], axis=1)
        blocks = [[joint.at(a, b) for b in (first, second)] for a in (first, second)]
        return np.asarray(swing @ np.block(blocks) @ swing.T)

    def _marginals(self) -> Any:
        """GTSAM's factorisation of the equations at the present poses."""
        if self._factorised is None:
            self._factorised = self._gtsam.Marginals(self._factors, self._values)
        return self._factorised

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


def residuals(graph: CentredGraph, poses: Poses) -> Poses:
    """How far each constraint (E, 3) is from the poses (V, 3): the error in the frame of its second vertex."""
    relative = compose(inverse(poses[graph.first]), poses[graph.second])
    return compose(inverse(graph.poses), relative)
