"""The poses that a prior leaves possible: a grid over them, and the probability of each."""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.features.describe import Features
from urquhart.prior.prior import Prior
from urquhart.se2 import SE2


class RegionNumbers(NamedTuple):
    """How the poses of a prior are laid out. Chosen by hand, not fitted."""

    wide: float = 3.5
    """Half the extent of a window, in standard deviations: of the position at a given yaw in every direction, and of
    the yaw. Beyond lie 2 positions in 1,000. The bounds are separate: jointly a pose may be 4.9 off."""
    step: float = 0.5
    """Most metres between the shifts that are tried, and between trees at the rim of the observation from turn to
    turn."""
    apart: float = 3.0
    """Metres between two windows beside each other."""
    most_poses: int = 2_000_000
    """Most poses of a window: 150 MB, and 10 to 60 seconds."""


REGION: Final = RegionNumbers()


class WindowTooLarge(ValueError):
    """A prior so vague, or about so many submaps, that its window cannot be searched pose by pose."""


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """What a prior says of the poses of an observation whose middle is the origin of its frame.

    Attributes:
        prior: as it was given.
        offset: (2,) float64, metres, frame of the observation: from the point that the prior is about to the middle.
        map_origin: (2,) float64, metres, map frame: the origin of the centred map frame.
        yaw_sigma: radians, standard deviation of the yaw; infinite if nothing is known of it.
        slope: (2,) float64, metres for each radian: how the position depends on the yaw.
        spread: (2, 2) float64, square metres: covariance of the position at a given yaw.
    """

    prior: Prior
    offset: NDArray[np.float64]
    map_origin: NDArray[np.float64]
    yaw_sigma: float
    slope: NDArray[np.float64]
    spread: NDArray[np.float64]

    @staticmethod
    def of(prior: Prior, observation: Features, map_origin: NDArray[np.float64]) -> "Region":
        """The region of a prior.

        Args:
            observation: features of the observation.
            map_origin: (2,), metres, map frame: where the centred frame of the map's trees has its origin.
        """
        known, offset = prior.known_covariance, observation.origin - np.asarray(prior.about)
        sigma = math.inf if prior.yaw is None else math.sqrt(float(known[2, 2]))
        if REGION.wide * sigma >= math.pi:
            return Region(prior, offset, map_origin, math.inf, np.zeros(2), known[:2, :2])
        slope = known[:2, 2] / known[2, 2]
        return Region(prior, offset, map_origin, sigma, slope, known[:2, :2] - np.outer(slope, known[2, :2]))

    @property
    def half_turn(self) -> float:
        """Radians: the largest turn from the prior's yaw; infinite if every rotation is possible."""
        return REGION.wide * self.yaw_sigma

    @property
    def beside(self) -> NDArray[np.float64]:
        """The shortest shift (2,), metres, to a window beside this one that has no pose in common with it."""
        variances, axes = np.linalg.eigh(self.spread)
        return np.asarray(axes[:, 0] * _width(float(variances[0])))

    def grid(self, radius: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Poses (P, 3), x, y, yaw of `map_T_query` between centred frames, metres and radians, and the logarithms (P,)
        of their probabilities, which add up to 1.

        Args:
            radius: metres from the middle of the observation to its farthest tree.

        Raises:
            WindowTooLarge: there would be more than `REGION.most_poses`.
        """
        turns = self._turns(radius)
        deviations, axes = np.linalg.eigh(self.spread)
        deviations = np.sqrt(np.maximum(deviations, 0.0))
        counts = np.maximum(np.ceil(REGION.wide * deviations / REGION.step), 1.0)
        if len(turns) * float(np.prod(2.0 * counts + 1.0)) > REGION.most_poses:
            heading = "a heading or " if math.isinf(self.yaw_sigma) else ""
            raise WindowTooLarge(
                f"a position known to {self.prior.reach:.3g} m (one standard deviation) leaves more than "
                f"{REGION.most_poses:,} poses to try: give {heading}a smaller standard deviation, or "
                "search without a prior"
            )
        lines = [np.arange(-count, count + 1.0) / count * REGION.wide for count in counts.tolist()]
        u, v = (axis.ravel() for axis in np.meshgrid(*lines, indexing="ij"))
        kept = u * u + v * v <= REGION.wide**2 * (1.0 + 1e-9)
        shifts = np.column_stack([u[kept], v[kept]]) * deviations @ axes.T
        stacked = np.empty((len(turns), len(shifts), 3))
        stacked[:, :, :2], stacked[:, :, 2] = shifts + self._middles(turns)[:, None], turns[:, None]
        poses = stacked.reshape(-1, 3)
        log = self.log_density(poses)
        return poses, log - np.logaddexp.reduce(log)

    def log_density(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Logarithm (P,) of the probability density of poses (P, 3), up to a constant; minus infinity outside of the
        window."""
        position, turn = self._squared(poses, np.zeros((3, 3)))
        outside = np.maximum(position, turn) > REGION.wide**2 * (1.0 + 1e-6)
        return np.where(outside, -math.inf, -0.5 * (position + turn))

    def free_density(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Logarithm (P,) of the probability density of poses (P, 3), up to the constant of `log_density`, outside of
        the window as well."""
        return np.asarray(-0.5 * sum(self._squared(poses, np.zeros((3, 3)))))

    def allows(self, pose: NDArray[np.float64], covariance: NDArray[np.float64]) -> bool:
        """Whether a pose (3,) estimated without the prior, with a covariance (3, 3), agrees with the window."""
        return max(float(one[0]) for one in self._squared(pose[None], covariance)) <= REGION.wide**2 * (1.0 + 1e-6)

    def _squared(
        self, poses: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Squared standard deviations (P,) from the prior of poses (P, 3): of the position at their yaw, and the yaw.

        `covariance`: (3, 3), of the poses themselves, which adds to the prior's.
        """
        away = poses[:, :2] - self._middles(poses[:, 2])
        position = np.einsum("pi,ij,pj->p", away, np.linalg.inv(self.spread + covariance[:2, :2]), away)
        return position, self._turned(poses[:, 2]) ** 2 / (self.yaw_sigma**2 + float(covariance[2, 2]))

    def _turned(self, yaws: NDArray[np.float64]) -> NDArray[np.float64]:
        """Radians (R,) from the prior's yaw; 0 if nothing is known of it."""
        if math.isinf(self.yaw_sigma) or self.prior.yaw is None:
            return np.zeros(len(yaws))
        return np.asarray((yaws - self.prior.yaw + math.pi) % (2.0 * math.pi) - math.pi)

    def _middles(self, yaws: NDArray[np.float64]) -> NDArray[np.float64]:
        """The most likely position (R, 2) of the observation's middle at each yaw, metres, centred map frame."""
        known = np.array([self.prior.x, self.prior.y]) - self.map_origin + self._turned(yaws)[:, None] * self.slope
        c, s = np.cos(yaws), np.sin(yaws)
        x, y = self.offset.tolist()
        return np.asarray(known + np.column_stack([c * x - s * y, s * x + c * y]))

    def _turns(self, radius: float) -> NDArray[np.float64]:
        """Rotations (R,), radians, of a window."""
        step = 2.0 * REGION.step / max(radius, 2.0 * REGION.step)
        if math.isinf(self.yaw_sigma) or self.prior.yaw is None:
            count = math.ceil(2.0 * math.pi / step)
            return 2.0 * math.pi * np.arange(count) / count
        steps = math.ceil(self.half_turn / step)
        return self.prior.yaw + np.linspace(-self.half_turn, self.half_turn, 2 * steps + 1)


def _width(variance: float) -> float:
    """Metres from a window to one beside it; `variance`: of the position in that direction, square metres."""
    return 2.0 * REGION.wide * math.sqrt(max(variance, 0.0)) + REGION.apart


def window_extent(prior: Prior, observation: Features) -> tuple[NDArray[np.float64], float]:
    """Where in the map trees are needed to search a window and those beside it: the middle (2,), map frame, and the
    radius; metres."""
    middle, offset = np.array([prior.x, prior.y]), observation.origin - np.asarray(prior.about)
    span = float(np.hypot(*offset))
    if prior.yaw is not None:
        middle = SE2(prior.x, prior.y, prior.yaw).apply(offset[None])[0]
        span *= min(REGION.wide * math.sqrt(float(prior.known_covariance[2, 2])), math.pi)
    # The position at the rim of the yaw's range may be 3.5 deviations off, and that of the yaw itself as well.
    far = math.sqrt(2.0) * REGION.wide * prior.reach
    beside = _width(float(np.linalg.eigvalsh(prior.known_covariance[:2, :2])[0]))
    return middle, far + beside + span + float(np.hypot(*observation.landmarks.T).max())
