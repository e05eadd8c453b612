"""Submaps that fit equally well, but whose map poses put the query at different places: then neither may be used.

This happens if a stand was surveyed again, if maps of several robots share a name, or if a trajectory drifted. Two
poses are on the same map if they name one map frame, or frames that both have a coordinate reference system.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.collections.georeference import Crossing, Georeference
from server.queries.poses import place_pose
from server.store.records import FrameReference
from server.store.submap_records import Place
from urquhart import SE2, Candidate, Recognition, Rival
from urquhart.pose_covariance import PoseUncertainty, compose
from urquhart.se2 import wrap

REASON: Final = "contradicting_maps"
COMPARED: Final = 5
"""Candidates that are compared at least, even if the query asks for fewer."""
_UNKNOWN: Final = np.diag([3.0, 3.0, math.radians(5.0)]) ** 2
"""Covariance, about its trees, that is assumed for a map pose without one: that of satellite positions in the open."""
_FLOOR: Final = np.diag([0.25, 0.25, math.radians(1.0)]) ** 2
"""Least covariance of the difference of two poses: trees are not points, and they grow."""
_GATE: Final = 16.27
"""Squared Mahalanobis distance that one of a thousand pairs of right poses exceeds (chi-square, three degrees of
freedom).
"""


def without_contradictions(
    found: Recognition, places: Mapping[int, Place], frames: Mapping[str, FrameReference], most: int
) -> Recognition:
    """The answer with `most` candidates, of which those are refused that contradict another accepted one on the same
    map.

    If the first one is among them, the answer is `ambiguous`, and the others are listed among its rivals as well.

    Args:
        places: where submaps are in a map, by key.
        frames: where map frames are on Earth, by name, of those for which that is known.
    """
    accepted = [one for one in found.candidates if one.refused is None and one.key in places]
    against = set[int]()
    for one, other in combinations(accepted, 2):
        if _contradict(one, places[one.key], other, places[other.key], frames):
            against |= {one.key, other.key}
    candidates = tuple(replace(one, refused=REASON) if one.key in against else one for one in found.candidates)
    shown = replace(found, candidates=candidates[:most])
    if not candidates or candidates[0].key not in against or found.verdict != "matched":
        return shown
    named = [Rival(one.key, one.transform, one.evidence, len(one.residuals)) for one in candidates[1:]]
    rivals = [one for one in named if one.key in against] + list(found.rivals)
    rivals.sort(key=lambda rival: -rival.evidence)
    return replace(shown, verdict="ambiguous", reason=REASON, rivals=tuple(rivals))


def _contradict(
    one: Candidate, there: Place, other: Candidate, yonder: Place, frames: Mapping[str, FrameReference]
) -> bool:
    """Whether two candidates put the query at different places of one map, beyond what their covariances explain."""
    first, sure = _in_map(one, there)
    second, surely = _in_map(other, yonder)
    # Compared at the trees that both were fitted to. At the origin of a frame far away, small rotations would dominate.
    middle = (one.uncertainty.source + other.uncertainty.source) / 2
    other_at = second.apply(middle[None])[0]
    crossing = _crossing(there.map_frame_id, yonder.map_frame_id, frames, other_at)
    if crossing is None:
        return False
    turn = np.eye(3)
    turn[:2, :2] = SE2(0.0, 0.0, crossing.transform.yaw).apply(np.eye(2)).T
    covariance = (
        sure.covariance_about(first, middle)
        + turn @ surely.covariance_about(second, middle) @ turn.T
        + np.diag([crossing.sigma, crossing.sigma, 0.0]) ** 2
        + _FLOOR
    )
    second = crossing.transform @ second
    off = np.append(first.apply(middle[None])[0] - second.apply(middle[None])[0], wrap(first.yaw - second.yaw))
    return float(off @ np.linalg.solve(covariance, off)) > _GATE


def _crossing(
    frame_id: str, other_id: str, frames: Mapping[str, FrameReference], at: NDArray[np.float64]
) -> Crossing | None:
    """The transform from a map frame to another about a point (2,) of the other; None if it is unknown."""
    if frame_id == other_id:
        return Crossing(SE2.identity(), 0.0)
    if frame_id not in frames or other_id not in frames:
        return None
    return Georeference(frames[frame_id]).crossing(Georeference(frames[other_id]), *at.tolist())


def _in_map(one: Candidate, place: Place) -> tuple[SE2, PoseUncertainty]:
    """The query's pose in the map with its uncertainty.

    What is assumed for a map pose without a covariance is about the trees, wherever the submap's origin is.
    """
    map_T_submap = place_pose(place)
    pose = map_T_submap @ one.transform
    given = np.zeros((3, 3)) if place.map_covariance is None else np.reshape(place.map_covariance, (3, 3))
    uncertainty = compose(map_T_submap, np.asarray(given, np.float64), one.transform, one.uncertainty)
    return pose, uncertainty.widened(pose, _UNKNOWN) if place.map_covariance is None else uncertainty
