"""Submaps that fit alike, and whose poses in one map put the query at different places: then neither is to be used.

Re-surveyed stands, maps of several robots under one name, and trajectories that drifted come out like this.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.queries.poses import place_pose
from server.store.repositories.submaps import Place
from urquhart import SE2, Candidate, Recognition, Rival
from urquhart.se2 import wrap
from urquhart.uncertainty import compose

REASON: Final = "contradicting_maps"
COMPARED: Final = 5
"""Candidates that are compared at least, however few are asked for."""
_UNKNOWN: Final = np.diag([3.0, 3.0, math.radians(5.0)]) ** 2
"""Covariance of a submap's pose that was posted without one: what satellite positioning in the open gives."""
_FLOOR: Final = np.diag([0.25, 0.25, math.radians(1.0)]) ** 2
"""Covariance that the difference of two poses has at least: trees are no points, and grow."""
_GATE: Final = 16.27
"""Squared Mahalanobis distance that one of a thousand pairs of right poses exceeds (chi-square, three numbers)."""


def without_contradictions(
    found: Recognition, places: Mapping[int, Place], xy: NDArray[np.float64], most: int
) -> Recognition:
    """The answer with `most` candidates, those refused that contradict another accepted one of the same map frame.

    If the first is among them, the answer is `ambiguous`, and the others are named among its rivals, too.

    Args:
        places: where submaps are in a map, by key.
        xy: (N, 2) float64, metres: the query's landmarks.
    """
    accepted = [one for one in found.candidates if one.refused is None and one.key in places]
    middle = xy.mean(axis=0) if len(xy) else np.zeros(2)
    against = set[int]()
    for one, other in combinations(accepted, 2):
        if _contradict(one, places[one.key], other, places[other.key], middle):
            against |= {one.key, other.key}
    candidates = tuple(replace(one, refused=REASON) if one.key in against else one for one in found.candidates)
    shown = replace(found, candidates=candidates[:most])
    if not candidates or candidates[0].key not in against or found.verdict != "matched":
        return shown
    named = [Rival(one.key, one.transform, one.evidence, len(one.residuals)) for one in candidates[1:]]
    rivals = [one for one in named if one.key in against] + list(found.rivals)
    rivals.sort(key=lambda rival: -rival.evidence)
    return replace(shown, verdict="ambiguous", reason=REASON, rivals=tuple(rivals))


def _contradict(one: Candidate, there: Place, other: Candidate, yonder: Place, middle: NDArray[np.float64]) -> bool:
    """Whether two candidates put the query at places of one map that their covariances cannot explain."""
    if there.map_frame_id != yonder.map_frame_id:
        return False
    (first, sure), (second, surely) = _in_map(one, there, middle), _in_map(other, yonder, middle)
    off = np.append(
        first.apply(middle[None])[0] - second.apply(middle[None])[0],
        wrap(first.yaw - second.yaw),
    )
    return float(off @ np.linalg.solve(sure + surely + _FLOOR, off)) > _GATE


def _in_map(one: Candidate, place: Place, middle: NDArray[np.float64]) -> tuple[SE2, NDArray[np.float64]]:
    """The query's pose in the map, and its covariance (3, 3) about `middle` of its trees."""
    given = _UNKNOWN if place.map_covariance is None else np.reshape(place.map_covariance, (3, 3))
    map_T_submap = place_pose(place)
    pose = map_T_submap @ one.transform
    uncertainty = compose(map_T_submap, np.asarray(given, np.float64), one.transform, one.uncertainty)
    return pose, uncertainty.covariance_about(pose, middle)
