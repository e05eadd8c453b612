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
from server.schemas.common import Members
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction
from server.store.submap_records import FoundSubmap, Place
from urquhart import SE2, Candidate
from urquhart.pose_covariance import PoseUncertainty, compose


def transform_answer(submap_T_query: SE2, uncertainty: PoseUncertainty) -> Members:
    """The pose of a query in a submap's frame: members of a `CandidateTransform`."""
    pose = submap_T_query
    return {
        "x": pose.x,
        "y": pose.y,
        "yaw": pose.yaw,
        "covariance": flat(uncertainty.origin_covariance(pose)),
        "covariance_frame": "submap",
        "about": "query_origin",
        "middle": middle_answer(uncertainty),
    }


def query_in_map(place: Place, submap_T_query: SE2, uncertainty: PoseUncertainty) -> Members:
    """map_T_query = map_T_submap @ submap_T_query, with its uncertainty if the submap's pose has a covariance: members
    of a `MapPoseAnswer`.

    If the covariance of the submap's pose is unknown, so is the query's: the match's alone would claim too much.
    """
    map_T_submap = place_pose(place)
    pose = map_T_submap @ submap_T_query
    covariance = middle = None
    if place.map_covariance is not None:
        given = np.asarray(place.map_covariance, dtype=np.float64).reshape(3, 3)
        composed = compose(map_T_submap, given, submap_T_query, uncertainty)
        covariance, middle = flat(composed.origin_covariance(pose)), middle_answer(composed)
    return {
        "x": pose.x,
        "y": pose.y,
        "yaw": pose.yaw,
        "covariance": covariance,
        "frame_id": place.map_frame_id,
        "covariance_frame": "map",
        "about": "query_origin",
        "middle": middle,
    }


def survey_poses(
    tx: ReadTransaction,
    collection: CollectionRecord,
    candidates: Sequence[Candidate],
    rows: Mapping[int, FoundSubmap],
    query_xy: NDArray[np.float64],
) -> list[Members]:
    """The poses as surveyors give them: members of a `SurveyPose` each. `query_xy`: (N, 2) float64, metres, the query's
    landmarks, at least one.
    """
    places = [rows[candidate.key].place for candidate in candidates]
    frames = {place.map_frame_id for place in places if place is not None}
    systems = frame_systems(tx, collection, frames) if frames else {}
    centre = query_xy.mean(axis=0) if len(query_xy) else np.zeros(2)
    return [survey_pose(candidate, place, systems, centre) for candidate, place in zip(candidates, places, strict=True)]


def survey_pose(
    candidate: Candidate, place: Place | None, systems: Mapping[str, FrameSystem], centre: NDArray[np.float64]
) -> Members:
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
) -> Members:
    position = uncertainty.position_of(pose, centre)
    shift = uncertainty.shift_of(pose, centre)
    covariance = uncertainty.covariance_about(pose, centre)
    x, y, yaw = (math.sqrt(float(covariance[axis, axis])) for axis in range(3))
    return {
        "frame_id": system.frame_id or None,
        "crs": system.name,
        "crs_unit": None if system.crs is None else system.unit,
        "metres_per_unit": None if system.crs is None else system.metres_per_unit,
        "crs_position": None if system.crs is None else system.full(position[None])[0].tolist(),
        "crs_shift": None if system.crs is None else (shift + np.asarray(system.origin)).tolist(),
        "axes": system.axes,
        "centre": centre.tolist(),
        "position": position.tolist(),
        "shift": shift.tolist(),
        "turn_degrees": math.degrees(math.remainder(pose.yaw, 2.0 * math.pi)),
        "turn_positive": "counter_clockwise",
        "covariance": flat(covariance) if is_known else None,
        "covariance_frame": "map" if system.frame_id else "submap",
        "about": "query_centre",
        "shift_sigma": (x, y) if is_known else None,
        "turn_sigma_degrees": math.degrees(yaw) if is_known else None,
    }


def place_pose(place: Place) -> SE2:
    """map_T_submap of a stored submap."""
    return SE2(place.map_x, place.map_y, place.map_yaw)


def middle_answer(uncertainty: PoseUncertainty) -> Members:
    """The uncertainty of a transform about the middle of the trees: members of a `TreesMiddle`."""
    return {
        "source": uncertainty.source.tolist(),
        "target": uncertainty.target.tolist(),
        "covariance": flat(uncertainty.covariance),
        "information": flat(uncertainty.information),
    }


def flat(matrix: NDArray[np.float64]) -> list[float]:
    """A matrix as a list, row by row."""
    values: list[float] = matrix.ravel().tolist()
    return values
