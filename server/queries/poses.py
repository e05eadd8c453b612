"""Poses in answers, with their uncertainty about the frame's origin and about the middle of the trees.

Surveyors read a pose as shift and turn about the middle of the query's trees. Coordinates may be millions of metres
from the origin. So shift and covariance are moved there from the middle of the inliers, a few metres away, and never
from the origin.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from server.collections.frame_systems import FrameSystem, frame_systems
from server.schemas.candidates import CandidateAnswer
from server.schemas.poses import CandidateTransform, MapPoseAnswer, SurveyPose, TreesMiddle
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction
from server.store.submap_records import FoundSubmap, Place
from urquhart import SE2, Candidate
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


def with_survey_poses(
    tx: ReadTransaction,
    collection: CollectionRecord,
    answers: Sequence[CandidateAnswer],
    candidates: Sequence[Candidate],
    rows: Mapping[int, FoundSubmap],
    query_xy: NDArray[np.float64],
) -> list[CandidateAnswer]:
    """The answers with `survey`. `query_xy`: (N, 2) float64, metres, the query's landmarks, at least one."""
    places = [rows[candidate.key].place for candidate in candidates]
    systems = frame_systems(tx, collection, {place.map_frame_id for place in places if place is not None})
    centre = query_xy.mean(axis=0) if len(query_xy) else np.zeros(2)
    return [
        answer.model_copy(update={"survey": survey_pose(candidate, place, systems, centre)})
        for answer, candidate, place in zip(answers, candidates, places, strict=True)
    ]


def survey_pose(
    candidate: Candidate, place: Place | None, systems: Mapping[str, FrameSystem], centre: NDArray[np.float64]
) -> SurveyPose:
    """The pose about `centre` (2,), metres, query frame: in the submap's map frame, or in its own if it has no pose.

    The covariance is None if that of the submap's pose is unknown.
    """
    if place is None:
        return _about(centre, candidate.transform, candidate.uncertainty, FrameSystem("", None, None), is_known=True)
    map_T_submap = place_pose(place)
    # Without a covariance of the submap's pose, only the shift is taken from this one.
    given = np.zeros((3, 3)) if place.map_covariance is None else np.reshape(place.map_covariance, (3, 3))
    uncertainty = compose(map_T_submap, np.asarray(given, np.float64), candidate.transform, candidate.uncertainty)
    pose = map_T_submap @ candidate.transform
    system = systems[place.map_frame_id]
    return _about(centre, pose, uncertainty, system, is_known=place.map_covariance is not None)


def _about(
    centre: NDArray[np.float64], pose: SE2, uncertainty: PoseUncertainty, system: FrameSystem, *, is_known: bool
) -> SurveyPose:
    position = uncertainty.position_of(pose, centre)
    shift = uncertainty.shift_of(pose, centre)
    covariance = uncertainty.covariance_about(pose, centre)
    sigmas = np.sqrt(np.diag(covariance)).tolist()
    return SurveyPose(
        frame_id=system.frame_id or None,
        crs=system.name,
        crs_unit=None if system.crs is None else system.unit,
        metres_per_unit=None if system.crs is None else system.metres_per_unit,
        crs_position=None if system.crs is None else _point(system.full(position[None])[0]),
        axes=system.axes,
        centre=_point(centre),
        position=_point(position),
        shift=_point(shift),
        turn_degrees=math.degrees(math.remainder(pose.yaw, 2.0 * math.pi)),
        covariance=flat(covariance) if is_known else None,
        covariance_frame="map" if system.frame_id else "submap",
        shift_sigma=(sigmas[0], sigmas[1]) if is_known else None,
        turn_sigma_degrees=math.degrees(sigmas[2]) if is_known else None,
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
