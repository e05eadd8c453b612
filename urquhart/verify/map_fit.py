"""An observation fitted to all trees of a map around it, where a search has found it in one of the map's submaps.

A submap may hold only a part of the observation, or of the trees around it. The map as a whole says which trees of the
observation have a partner, and which trees of the map the observation lacks.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.pose_covariance import PoseUncertainty
from urquhart.se2 import SE2
from urquhart.verify.evidence import evidence_of_pose
from urquhart.verify.landmark_grid import GRID, LandmarkGrid, is_inside, landmark_grid
from urquhart.verify.refinement import verify
from urquhart.verify.uncertainty import pose_uncertainty


@dataclass(frozen=True, slots=True, eq=False)
class MapFit:
    """An observation on a map.

    Attributes:
        transform: `map_T_query`, in the frames as given.
        uncertainty: of the transform, about the middle of the inliers.
        query_indices, map_indices: (K,) int64, the one-to-one inliers.
        residuals: (K,) float64, metres.
        missing: (J,) int64, trees of the map in the footprint of the observation that have no partner.
        scale: factor by which distances between the inliers are larger in the map than in the observation.
        warnings: faults in the coordinates of one side, words of `urquhart.verify.distortion.WARNINGS`.
    """

    transform: SE2
    uncertainty: PoseUncertainty
    query_indices: NDArray[np.int64]
    map_indices: NDArray[np.int64]
    residuals: NDArray[np.float64]
    missing: NDArray[np.int64]
    scale: float
    warnings: tuple[str, ...]

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, metres."""
        return float(np.sqrt((self.residuals**2).mean()))


def fit_to_map(observation: Features, surroundings: Features, start: SE2, config: Config, *, keep: bool) -> MapFit:
    """Pair an observation with all trees of a map around it, and refine its pose on these pairs.

    Args:
        observation: features of the observation.
        surroundings: features of the trees of the map, the footprint of the observation among them.
        start: `map_T_query`, in the frames as given: the pose that was found.
        config: of both sides.
        keep: whether `start` stays as it is, for a pose that was not found by pairs.

    Raises:
        ValueError: fewer than two trees have a partner.
    """
    query, there = landmark_grid(observation, config.reach), landmark_grid(surroundings, config.reach)
    to_map, to_query = SE2.shift(surroundings.origin), SE2.shift(observation.origin)
    centred = to_map.inverse() @ start @ to_query
    if keep:
        found = evidence_of_pose(query, there, centred, GRID.loose * config.reach)
    else:
        found = verify(query, there, centred, config.reach)
    if len(found.residuals) < 2:
        raise ValueError("fewer than two trees have a partner in the map")
    transform = to_map @ found.transform @ to_query.inverse()
    seen = observation.landmarks[found.query] + observation.origin
    stored = surroundings.landmarks[found.submap] + surroundings.origin
    uncertainty, warnings = pose_uncertainty(seen, stored, transform, found.residuals, config, distorted=not keep)
    return MapFit(
        transform=transform,
        uncertainty=uncertainty,
        query_indices=found.query,
        map_indices=found.submap,
        residuals=found.residuals,
        missing=_missing(query, there, found.transform, found.submap),
        scale=_scale(seen, stored, transform),
        warnings=warnings,
    )


def _missing(query: LandmarkGrid, there: LandmarkGrid, pose: SE2, paired: NDArray[np.int64]) -> NDArray[np.int64]:
    """Trees of the map, without those `paired`, whose place lies in the footprint of the query at its `pose`."""
    at = pose.inverse().apply(there.landmarks)
    low, high = query.landmarks.min(axis=0), query.landmarks.max(axis=0)
    near = np.flatnonzero(((at >= low) & (at <= high)).all(axis=1))
    inside = [tree for tree in np.setdiff1d(near, paired).tolist() if is_inside(query, at[tree, 0], at[tree, 1])]
    return np.asarray(inside, dtype=np.int64)


def _scale(seen: NDArray[np.float64], stored: NDArray[np.float64], transform: SE2) -> float:
    """The least-squares scale of `stored` (K, 2) against `seen` (K, 2), metres, about their middles."""
    a = SE2(0.0, 0.0, transform.yaw).apply(seen - seen.mean(axis=0))
    b = stored - stored.mean(axis=0)
    return float((a * b).sum() / max(float((a * a).sum()), 1e-12))
