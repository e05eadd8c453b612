"""Poses with covariance, composed to first order."""

import numpy as np
from numpy.typing import NDArray

from server.schemas.candidates import MapPoseAnswer
from server.schemas.common import PoseWithCovariance
from server.store.submaps import Place
from urquhart import SE2


def with_covariance(pose: SE2, covariance: NDArray[np.float64] | None) -> PoseWithCovariance:
    """A pose, and its covariance (3, 3) float64 over (x, y, yaw) in m², m rad, rad², for an answer."""
    return PoseWithCovariance(x=pose.x, y=pose.y, yaw=pose.yaw, covariance=_flat(covariance))


def query_in_map(place: Place, submap_T_query: SE2, covariance: NDArray[np.float64]) -> MapPoseAnswer:
    """map_T_query = map_T_submap @ submap_T_query; its covariance where the submap's pose has one.

    With a submap pose of unknown covariance the query's is unknown too: the match's alone would claim too much.
    """
    map_T_submap = SE2(place.map_x, place.map_y, place.map_yaw)
    pose = map_T_submap @ submap_T_query
    composed = None
    if place.map_covariance is not None:
        first = np.asarray(place.map_covariance, dtype=np.float64).reshape(3, 3)
        composed = compose_covariance(map_T_submap, first, submap_T_query, covariance)
    return MapPoseAnswer(frame_id=place.map_frame_id, x=pose.x, y=pose.y, yaw=pose.yaw, covariance=_flat(composed))


def compose_covariance(
    a_T_b: SE2, covariance_ab: NDArray[np.float64], b_T_c: SE2, covariance_bc: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariance (3, 3) of a_T_c = a_T_b @ b_T_c over (x, y, yaw), the two errors being independent.

    x_ac = x_ab + R(yaw_ab) x_bc, so the yaw of the first swings the second's offset round.
    """
    cos, sin = np.cos(a_T_b.yaw), np.sin(a_T_b.yaw)
    by_first = np.array(
        [
            [1.0, 0.0, -sin * b_T_c.x - cos * b_T_c.y],
            [0.0, 1.0, cos * b_T_c.x - sin * b_T_c.y],
            [0.0, 0.0, 1.0],
        ]
    )
    by_second = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    composed: NDArray[np.float64] = by_first @ covariance_ab @ by_first.T + by_second @ covariance_bc @ by_second.T
    return composed


def _flat(covariance: NDArray[np.float64] | None) -> list[float] | None:
    return None if covariance is None else [float(value) for value in covariance.ravel()]
