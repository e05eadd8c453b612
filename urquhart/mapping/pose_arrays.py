"""Many transforms of the plane at once: arrays (N, 3) of x, y (metres) and yaw (radians), with covariances (N, 3, 3).

A covariance here is that of a small motion in the source frame: the true transform is `pose` followed by an error
(x, y, yaw) along the axes of the source frame, about its origin. Pose graphs weight their edges in the same way.
"""

import numpy as np
from numpy.typing import NDArray

Poses = NDArray[np.float64]
Covariances = NDArray[np.float64]


def wrapped(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same angles, radians, in [-pi, pi)."""
    return np.asarray((angles + np.pi) % (2.0 * np.pi) - np.pi)


def compose(a_T_b: Poses, b_T_c: Poses) -> Poses:
    """a_T_c (N, 3) of two arrays of transforms."""
    c, s = np.cos(a_T_b[:, 2]), np.sin(a_T_b[:, 2])
    x = a_T_b[:, 0] + c * b_T_c[:, 0] - s * b_T_c[:, 1]
    y = a_T_b[:, 1] + s * b_T_c[:, 0] + c * b_T_c[:, 1]
    return np.column_stack([x, y, wrapped(a_T_b[:, 2] + b_T_c[:, 2])])


def inverse(a_T_b: Poses) -> Poses:
    """b_T_a (N, 3)."""
    c, s = np.cos(a_T_b[:, 2]), np.sin(a_T_b[:, 2])
    x = -c * a_T_b[:, 0] - s * a_T_b[:, 1]
    y = s * a_T_b[:, 0] - c * a_T_b[:, 1]
    return np.column_stack([x, y, wrapped(-a_T_b[:, 2])])


def moved(poses: Poses, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (N, 2), metres, source frame of the pose with the same number, in its target frame."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + c * points[:, 0] - s * points[:, 1]
    y = poses[:, 1] + s * points[:, 0] + c * points[:, 1]
    return np.column_stack([x, y])


def rotations(angles: NDArray[np.float64]) -> Covariances:
    """Matrices (N, 3, 3) that turn (x, y, yaw) errors by `angles` (N,), radians."""
    turn = np.zeros((len(angles), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angles)
    turn[:, 1, 0] = np.sin(angles)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    return turn


def adjoints(poses: Poses) -> Covariances:
    """Matrices (N, 3, 3) that take an error in the source frame to the same motion seen in the target frame."""
    adjoint = rotations(poses[:, 2])
    adjoint[:, 0, 2], adjoint[:, 1, 2] = poses[:, 1], -poses[:, 0]
    return adjoint


def swung(covariances: Covariances, arms: NDArray[np.float64]) -> Covariances:
    """Covariances (N, 3, 3) about points that are `arms` (N, 2), metres, away from those they were about."""
    swing = np.tile(np.eye(3), (len(arms), 1, 1))
    swing[:, 0, 2], swing[:, 1, 2] = -arms[:, 1], arms[:, 0]
    return congruent(swing, covariances)


def congruent(matrices: Covariances, covariances: Covariances) -> Covariances:
    """M C M^T of each pair of matrices (N, 3, 3)."""
    return np.asarray(matrices @ covariances @ matrices.transpose(0, 2, 1))


def compose_covariances(first: Covariances, b_T_c: Poses, second: Covariances) -> Covariances:
    """The covariances of a_T_b @ b_T_c if the errors of both are independent."""
    return congruent(adjoints(inverse(b_T_c)), first) + second


def inverse_covariances(a_T_b: Poses, covariances: Covariances) -> Covariances:
    """The covariances of b_T_a."""
    return congruent(adjoints(a_T_b), covariances)


def squared_distances(errors: Poses, covariances: Covariances) -> NDArray[np.float64]:
    """Squared Mahalanobis distances (N,) of errors (N, 3)."""
    return np.asarray((errors * np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]).sum(axis=1))
