"""What is known of a pose before a search: roughly where a plot is, and perhaps which way it faces."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

LEAST_NOISE: Final = 0.1
"""Metres: less noise than that of the grid of shifts cannot be told from it."""
MOST_NOISE: Final = 2.0
"""Metres: with more, no tree of a forest can be told from the next."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """A rough pose `map_T_query`: where one point of the observation lies in the map, and how its axes are turned.

    Attributes:
        x, y: metres, map frame: the most likely position of the point `about`.
        covariance: (3, 3) float64 over x, y, yaw: square metres, metre radians, square radians; of the position of
            `about`, along the axes of the map, and of the yaw. The entries of yaw are not used if `yaw` is None.
        yaw: radians, from the map's axes to the observation's, counter-clockwise; None if nothing is known of it.
        about: metres, frame of the observation: the point that is known, by default its origin.
        noise: metres, roughly the standard deviation of one coordinate of a tree in the map against the same stem in
            the observation, `LEAST_NOISE` to `MOST_NOISE`; None if it is not known.

    Raises:
        ValueError: a number is not finite or out of range, or the part of the covariance that is used is not positive
            definite.
    """

    x: float
    y: float
    covariance: NDArray[np.float64]
    yaw: float | None = None
    about: tuple[float, float] = (0.0, 0.0)
    noise: float | None = None

    def __post_init__(self) -> None:
        for name in ("x", "y", "yaw"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise ValueError(f"the {name} of a prior must be a finite number, not {value}")
        if self.noise is not None and not LEAST_NOISE <= self.noise <= MOST_NOISE:
            raise ValueError(f"the noise of a prior must be {LEAST_NOISE:g} to {MOST_NOISE:g} m, not {self.noise:g}")
        if not all(map(math.isfinite, self.about)):
            raise ValueError(f"the point that a prior is about must have finite coordinates, not {self.about}")
        used = self.known_covariance
        if not np.isfinite(used).all() or not np.allclose(used, used.T, rtol=1e-6, atol=0.0):
            raise ValueError("the covariance of a prior must be a symmetric matrix of finite numbers")
        # Compared as correlations, because metres and radians differ in size.
        deviations = np.sqrt(np.maximum(np.diag(used), 0.0))
        if (deviations == 0.0).any() or np.linalg.eigvalsh(used / np.outer(deviations, deviations))[0] < 1e-9:
            names = "x and y" if self.yaw is None else "x, y and yaw"
            raise ValueError(
                f"the covariance of a prior must be positive definite over {names}: give each a standard deviation, "
                "however small, and correlations below 1"
            )

    @classmethod
    def with_sigma(
        cls, x: float, y: float, sigma: float, yaw: float | None = None, yaw_sigma: float = math.radians(2.0)
    ) -> "Prior":
        """A prior of the observation's origin, with one standard deviation in every direction and no correlations.

        Args:
            x, y, yaw: as in `Prior`.
            sigma: metres, standard deviation of x and of y.
            yaw_sigma: radians, standard deviation of `yaw`; not used if `yaw` is None.

        Raises:
            ValueError: a number is not finite, or a standard deviation is not positive.
        """
        for name, value in (("sigma", sigma), ("yaw_sigma", yaw_sigma)):
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"the {name} of a prior must be a positive number, not {value}")
        return cls(x, y, np.diag([sigma**2, sigma**2, yaw_sigma**2]), yaw)

    @property
    def known_covariance(self) -> NDArray[np.float64]:
        """The covariance of what is known: (3, 3) over x, y and yaw, or (2, 2) over x and y if there is no yaw."""
        size = 2 if self.yaw is None else 3
        return np.asarray(self.covariance, dtype=np.float64)[:size, :size]

    @property
    def reach(self) -> float:
        """Metres: the largest standard deviation of the position in any direction."""
        return math.sqrt(float(np.linalg.eigvalsh(self.known_covariance[:2, :2])[-1]))
