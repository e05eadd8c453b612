"""Poses in answers, with their uncertainty about the frame's origin and about the middle of the trees."""

import numpy as np
from numpy.typing import NDArray

from server.schemas.poses import CandidateTransform, MapPoseAnswer, TreesMiddle
from server.store.submap_records import Place
from urquhart import SE2
from urquhart.pose_covariance import PoseUncertainty, compose


def transform_answer(submap_T_query: SE2, uncertainty: PoseUncertainty) -> CandidateTransform:
    """The pose of a query in a submap's frame."""
    pose = submap_T_query
    covariance = uncertainty.origin_covariance(pose)
    middle = middle_answer(uncertainty)
    return CandidateTransform(x=pose.x, y=pose.y, yaw=pose.yaw, covariance=flat(covariance), middle=middle)


def query_in_map(place: Place, submap_T_query: SE2, uncertainty: PoseUncertainty) -> MapPoseAnswer:
    """map_T_query = map_T_submap @ submap_T_query, with its uncertainty if the submap's pose has a covariance.

    If the covariance of the submap's pose is unknown, so is the query's: the match's alone would claim too much.
    """
    map_T_submap = place_pose(place)
    pose = map_T_submap @ submap_T_query
    covariance = middle = None
    if place.map_covariance is not None:
        given = np.asarray(place.map_covariance, dtype=np.float64).reshape(3, 3)
        composed = compose(map_T_submap, given, submap_T_query, uncertainty)
        covariance, middle = flat(composed.origin_covariance(pose)), middle_answer(composed)
    return MapPoseAnswer(
        frame_id=place.map_frame_id, x=pose.x, y=pose.y, yaw=pose.yaw, covariance=covariance, middle=middle
    )


def place_pose(place: Place) -> SE2:
    """map_T_submap of a stored submap."""
    return SE2(place.map_x, place.map_y, place.map_yaw)


def middle_answer(uncertainty: PoseUncertainty) -> TreesMiddle:
    """The uncertainty of a transform about the middle of the trees."""
    return TreesMiddle(
        source=_point(uncertainty.source),
        target=_point(uncertainty.target),
        covariance=flat(uncertainty.covariance),
        information=flat(uncertainty.information),
    )


def flat(matrix: NDArray[np.float64]) -> list[float]:
    """A matrix as a list, row by row."""
    return [float(value) for value in matrix.ravel()]


def _point(xy: NDArray[np.float64]) -> tuple[float, float]:
    return float(xy[0]), float(xy[1])
