"""What is known of a pose before a search: roughly where a plot is, and perhaps which way it faces."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Prior:
    """A rough pose `map_T_query`: where the origin of the observation lies in the map, and how its axes are turned.

    Attributes:
        x, y: metres, map frame: the most likely position of the observation's origin.
        sigma: metres, standard deviation of x and of y.
        yaw: radians, from the map's axes to the observation's, counter-clockwise; None if nothing is known of it.
        yaw_sigma: radians, standard deviation of `yaw`; not used if `yaw` is None.

    Raises:
        ValueError: a number is not finite, or a standard deviation is not positive.
    """

    x: float
    y: float
    sigma: float
    yaw: float | None = None
    yaw_sigma: float = math.radians(2.0)

    def __post_init__(self) -> None:
        for name in ("x", "y", "yaw"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise ValueError(f"the {name} of a prior must be a finite number, not {value}")
        for name in ("sigma", "yaw_sigma"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"the {name} of a prior must be a positive number, not {value}")
