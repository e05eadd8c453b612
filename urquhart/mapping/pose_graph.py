"""A pose graph: relative poses of submaps, from matches and odometry, and priors of where a submap lies in the map.

The uncertainty of a constraint is given about a point among the trees that it was fitted to, as `PoseUncertainty` has
it. About an origin far away (UTM coordinates), double precision no longer resolves the yaw.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart.mapping.pose_arrays import Covariances, Poses, congruent, moved, rotations, swung
from urquhart.pose_covariance import PoseUncertainty
from urquhart.se2 import SE2

MAP: Final = -1
"""Stands for the map frame where a constraint names its first submap: the constraint is then a prior."""


class PoseGraphError(ValueError):
    """A pose graph that cannot be optimised; the message names the constraint and what is wrong with it."""


@dataclass(frozen=True, slots=True)
class PoseConstraint:
    """One relative pose: `pose`, first_T_second, takes points of submap `second` to the frame of submap `first`.

    Attributes:
        first: number of a submap, or `MAP` for a prior: then `pose` is map_T_second.
        second: number of a submap.
        uncertainty: of `pose`.
        trusted: whether it is right within its uncertainty (odometry). A match between places may be a false one.
        secondary: whether it counts only where others confirm it: a match that was not the best of its search, and so
            was not compared with all rivals. In rows of trees, such matches are often off by a row.
    """

    first: int
    second: int
    pose: SE2
    uncertainty: PoseUncertainty
    trusted: bool = False
    secondary: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class PoseConstraints:
    """Constraints as arrays, for graphs of any size.

    Attributes:
        first, second: (E,) int64, numbers of submaps; `first` is `MAP` for a prior.
        poses: (E, 3) float64, x, y (metres), yaw (radians) of `first_T_second`.
        about: (E, 2) float64, metres, frame of `second`: the point that the covariance is about.
        covariances: (E, 3, 3) float64 over (x, y, yaw): of the transformed point `about` along the axes of `first`,
            square metres, and of the yaw, square radians.
        trusted: (E,) bool, whether a constraint is right within its uncertainty; others may be false.
        secondary: (E,) bool, whether it counts only where others confirm it.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    poses: Poses
    about: NDArray[np.float64]
    covariances: Covariances
    trusted: NDArray[np.bool_]
    secondary: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.first)

    @staticmethod
    def of(constraints: Sequence[PoseConstraint]) -> "PoseConstraints":
        """The arrays of single constraints."""
        size = len(constraints)
        return PoseConstraints(
            np.array([one.first for one in constraints], np.int64),
            np.array([one.second for one in constraints], np.int64),
            np.array([_numbers(one.pose) for one in constraints], np.float64).reshape(size, 3),
            np.array([one.uncertainty.source for one in constraints], np.float64).reshape(size, 2),
            np.array([one.uncertainty.covariance for one in constraints], np.float64).reshape(size, 3, 3),
            np.array([one.trusted for one in constraints], np.bool_),
            np.array([one.secondary for one in constraints], np.bool_),
        )

    def since(self, number: int) -> "PoseConstraints":
        """The constraints from a number on."""
        return PoseConstraints(*(getattr(self, column.name)[number:] for column in fields(self)))

    def with_more(self, more: "PoseConstraints") -> "PoseConstraints":
        """These constraints, then others."""
        columns = [(getattr(self, column.name), getattr(more, column.name)) for column in fields(self)]
        return PoseConstraints(*(np.concatenate(pair) for pair in columns))

    def check(self, count: int) -> None:
        """Refuse what cannot be optimised as the graph of `count` submaps. Raises PoseGraphError."""
        for ends, least in ((self.first, MAP), (self.second, 0)):
            outside = np.flatnonzero((ends < least) | (ends >= count))
            if len(outside):
                e = int(outside[0])
                raise PoseGraphError(f"constraint {e} names submap {ends[e]}, but there are only {count} submaps")
        same = np.flatnonzero(self.first == self.second)
        if len(same):
            raise PoseGraphError(f"constraint {same[0]} joins submap {self.first[same[0]]} with itself: leave it out")
        numbers = np.column_stack([self.poses, self.about, self.covariances.reshape(len(self), 9)])
        infinite = np.flatnonzero(~np.isfinite(numbers).all(axis=1))
        if len(infinite):
            raise PoseGraphError(f"constraint {infinite[0]} has a number that is not finite")
        flat = np.flatnonzero(~_is_positive(self.covariances))
        if len(flat):
            raise PoseGraphError(
                f"the covariance of constraint {flat[0]} is not symmetric and positive definite: give every "
                "direction a variance above 0 (for a position without a heading, a yaw variance of 10)"
            )


@dataclass(frozen=True, slots=True, eq=False)
class CentredGraph:
    """The same constraints between the centres of submaps, points among their trees; the map frame is one more vertex.

    Attributes:
        count: number of vertices: submaps, then the map frame.
        centres: (count, 2) float64, metres, in each submap's frame; 0 for the map frame.
        first, second: (E,) int64, vertices.
        poses: (E, 3) float64, of the frame about the centre of `second` in the one about the centre of `first`.
        covariances: (E, 3, 3) float64, of an error in the frame about the centre of `second` (`pose_arrays`).
        trusted, secondary: (E,) bool.
    """

    count: int
    centres: NDArray[np.float64]
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    poses: Poses
    covariances: Covariances
    trusted: NDArray[np.bool_]
    secondary: NDArray[np.bool_]

    @property
    def map_vertex(self) -> int:
        """The vertex of the map frame."""
        return self.count - 1

    @property
    def is_prior(self) -> NDArray[np.bool_]:
        """Which constraints (E,) are priors."""
        return np.asarray(self.first == self.map_vertex)

    def only(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> "CentredGraph":
        """The same vertices with some of the constraints: a mask (E,), or their numbers in order."""
        return replace(
            self,
            first=self.first[which],
            second=self.second[which],
            poses=self.poses[which],
            covariances=self.covariances[which],
            trusted=self.trusted[which],
            secondary=self.secondary[which],
        )


def centred(count: int, given: PoseConstraints) -> CentredGraph:
    """The constraints of `count` submaps between the centres of what they were fitted to."""
    return centred_about(centres_of(count, given), given)


def centres_of(count: int, given: PoseConstraints) -> NDArray[np.float64]:
    """For each of `count` submaps the mean of the points that its constraints were fitted to, in its frame; 0 for the
    map frame, which comes last (count + 1, 2).
    """
    first = np.where(given.first == MAP, count, given.first)
    there = moved(given.poses, given.about)
    at = np.concatenate([given.second, first[first < count]])
    points = np.concatenate([given.about, there[first < count]])
    seen = np.maximum(np.bincount(at, minlength=count + 1), 1)
    sums = [np.bincount(at, points[:, k], minlength=count + 1) for k in range(2)]
    centres = np.column_stack(sums) / seen[:, None]
    centres[count] = 0.0
    return centres


def centred_about(centres: NDArray[np.float64], given: PoseConstraints) -> CentredGraph:
    """Constraints between given centres (count + 1, 2) of submaps and of the map frame."""
    count = len(centres) - 1
    first = np.where(given.first == MAP, count, given.first)
    there = moved(given.poses, given.about)
    offset = moved(given.poses, centres[given.second])
    poses = np.column_stack([offset - centres[first], given.poses[:, 2]])
    back = rotations(-given.poses[:, 2])
    covariances = congruent(back, swung(given.covariances, offset - there))
    return CentredGraph(count + 1, centres, first, given.second, poses, covariances, given.trusted, given.secondary)


def _numbers(pose: SE2) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.yaw


def _is_positive(covariances: Covariances) -> NDArray[np.bool_]:
    """Which matrices (N, 3, 3) are symmetric and positive definite. They are scaled first: metres and radians."""
    diagonal = np.diagonal(covariances, axis1=1, axis2=2)
    proper = (diagonal > 0.0).all(axis=1)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = covariances / scale[:, :, None] / scale[:, None, :]
    even = np.abs(scaled - scaled.transpose(0, 2, 1)).max(axis=(1, 2), initial=0.0) < 1e-6
    return np.asarray(proper & even & (np.linalg.eigvalsh(scaled)[:, 0] > 1e-12))
