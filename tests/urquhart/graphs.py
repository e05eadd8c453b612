"""Simulated pose graphs whose truth is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urquhart.mapping.pose_arrays import compose, congruent, inverse, rotations, wrapped
from urquhart.mapping.pose_graph import PoseConstraints

ODOMETRY = np.array([0.3, 0.3, 0.01])
LOOP = np.array([0.05, 0.05, 0.003])


@dataclass(frozen=True, slots=True, eq=False)
class TrueGraph:
    """Constraints, the poses (S, 3) that they measure, and which constraints (E,) are false."""

    constraints: PoseConstraints
    truth: NDArray[np.float64]
    false: NDArray[np.bool_]


def drive(rng: np.random.Generator, submaps: int, false: float = 0.0, odometry: bool = True) -> TrueGraph:
    """A robot that drives a circle of 70 m again and again, with loops among submaps within 20 m of each other."""
    angle = np.arange(submaps) * 2.0 * np.pi / 30.0
    truth = np.column_stack(
        [70.0 * np.cos(angle), 70.0 * np.sin(angle) + angle, wrapped(np.asarray(angle + np.pi / 2.0))]
    )
    chain = np.column_stack([np.arange(submaps - 1), np.arange(1, submaps)])
    first, second = np.triu_indices(submaps, 2 if odometry else 1)
    near = np.hypot(*(truth[first] - truth[second])[:, :2].T) < 20.0
    pairs = np.column_stack([first, second])[near]
    pairs = pairs[rng.random(len(pairs)) < 0.5] if odometry else pairs
    pairs = np.concatenate([chain, pairs]) if odometry else pairs
    trusted = np.arange(len(pairs)) < (len(chain) if odometry else 0)
    is_false = ~trusted & (rng.random(len(pairs)) < false)
    return measured(rng, truth, pairs, trusted, is_false)


def measured(
    rng: np.random.Generator,
    truth: NDArray[np.float64],
    pairs: NDArray[np.int64],
    trusted: NDArray[np.bool_],
    false: NDArray[np.bool_],
) -> TrueGraph:
    """Constraints between pairs (E, 2) with the noise that their covariances tell; false ones join random submaps."""
    first, second = pairs.T.copy()
    poses = compose(inverse(truth[first]), truth[second])
    sigma = np.where(trusted[:, None], ODOMETRY, LOOP)
    poses = compose(poses, rng.normal(size=poses.shape) * sigma)
    count = int(false.sum())
    second[false] = (first[false] + rng.integers(1, len(truth), count)) % len(truth)
    poses[false] = np.column_stack([rng.uniform(-20.0, 20.0, (count, 2)), rng.uniform(-np.pi, np.pi, count)])
    covariances = congruent(rotations(poses[:, 2]), sigma[:, :, None] ** 2 * np.eye(3))
    given = PoseConstraints(first, second, poses, np.zeros((len(pairs), 2)), covariances, trusted, trusted & ~trusted)
    return TrueGraph(given, truth, false)
