"""Poses as text for surveyors: shift and turn at the middle of the observed trees, with axes, units and direction."""

import math
from typing import Final

from server.schemas.candidates import CandidateAnswer
from server.schemas.poses import SurveyPose

_METRE: Final = "metre"


def pose_lines(best: CandidateAnswer) -> list[str]:
    """The pose of a candidate: of the file's origin, then shift, turn and their uncertainty amid the trees."""
    pose, frame = (best.map_pose, best.map_pose.frame_id) if best.map_pose else (best.transform, best.submap_id)
    origin = f"pose in {frame}: x {pose.x:.3f} m, y {pose.y:.3f} m, yaw {math.degrees(pose.yaw):.2f} deg"
    survey = best.survey
    return [origin] if survey is None else [origin, *survey_lines(survey)]


def survey_lines(survey: SurveyPose) -> list[str]:
    """Position and shift of the middle of the trees along named axes, and the turn with its direction."""
    first, second = survey.axes
    lines = [f"middle of the trees: {_place(survey)}"]
    # In the system of the position above: the two must tell the same place.
    east, north = survey.crs_shift or survey.shift
    spread = _spread(survey)
    lines.append(
        f"shift there: {first} {east:+.3f} m, {second} {north:+.3f} m{_in_unit(survey)}; {_turn(survey)}{spread}"
    )
    return lines


def _place(survey: SurveyPose) -> str:
    first, second = survey.axes
    x, y = survey.centre
    there_x, there_y = survey.crs_position or survey.position
    unit = "m" if survey.crs_unit in (None, _METRE) else survey.crs_unit
    system = f" ({survey.crs})" if survey.crs is not None else ""
    return f"{x:.3f}, {y:.3f} m in the file is {first} {there_x:.3f}, {second} {there_y:.3f} {unit}{system}"


def _in_unit(survey: SurveyPose) -> str:
    """The shift in the unit of the system, where that is not the metre."""
    if survey.crs_unit in (None, _METRE) or survey.metres_per_unit is None:
        return ""
    east, north = (value / survey.metres_per_unit for value in survey.crs_shift or survey.shift)
    return f" ({east:+.3f}, {north:+.3f} {survey.crs_unit})"


def _turn(survey: SurveyPose) -> str:
    turn = survey.turn_degrees
    return f"turn {abs(turn):.3f} deg {'counter-clockwise' if turn >= 0 else 'clockwise'}"


def _spread(survey: SurveyPose) -> str:
    """One standard deviation of the shift and the turn, if they are known."""
    if survey.shift_sigma is None or survey.turn_sigma_degrees is None:
        return ""
    x, y = survey.shift_sigma
    return f" (one sigma {x:.3f} m, {y:.3f} m, {survey.turn_sigma_degrees:.3f} deg)"
