"""Loop closure in simulation (the paper's section V-B): a forest, a robot driving in a circle, pairs and their truth.

What the paper leaves open is a constant here, with the reason beside it.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart.evaluation.simulation import Sensor, SimulatedObservation, observe, paper_forest
from urquhart.se2 import SE2

SIGMAS: Final = (0.0, 0.1, 0.2, 0.3, 0.4)
"""Metres: standard deviation of each coordinate, the rows of Table I."""
DETECTIONS: Final = (1.0, 0.95, 0.9, 0.8)
"""Probability that a tree in range is seen, the columns of Table I."""
CELLS: Final = tuple((sigma, detection) for sigma in SIGMAS for detection in DETECTIONS)
SIDE: Final = 1000.0
"""Metres: side of the forest. Bridson's k is 30, his own choice; the paper does not name it."""
SENSOR: Final = 50.0
"""Metres: range of the sensor, and the distance of two poses below which a pair counts as missed."""
LAPS: Final = 4
STEP: Final = 50.0
"""Metres along the path for each observation (the paper does not say): the sensor's range."""
PER_LAP: Final = 14
"""Observations in one lap; the path's radius follows (the paper names neither): a lap of 700 m, well inside the forest.
56 observations make 1,540 pairs, about 220 of them within the sensor's range of each other."""
ROTATIONS: Final = {"quarter": np.pi / 2.0, "full": 2.0 * np.pi}
"""Radians: each observation is turned by up to this much. A quarter turn in the paper; any turn in real life."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Observations of one drive, and all their pairs: the second was made later and asks about the first.

    Attributes:
        observations: in the order they were made.
        first, second: (P,) int64, positions in `observations`, first < second.
        truth: (P, 3) float64, x, y (metres) and yaw (radians) of first_T_second, sensor frames.
        apart: (P,) float64, metres between the true poses.
        positive: (P,) bool, nearer than the sensor's range.
    """

    observations: list[SimulatedObservation]
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    truth: NDArray[np.float64]
    apart: NDArray[np.float64]
    positive: NDArray[np.bool_]


def path(per_lap: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Positions (LAPS * per_lap, 2), metres, on a circle about the forest's centre, in driving order.

    Every stretch of `STEP` metres holds one observation, somewhere along it: nobody drives the same loop to the metre.
    Pairs from different laps are then anything between 0 and 50 m apart, where observations at the same points of each
    lap would leave only pairs made at one spot.
    """
    radius = STEP * per_lap / (2.0 * np.pi)
    stretch = np.tile(np.arange(per_lap), LAPS)
    angle = 2.0 * np.pi * (stretch + rng.random(len(stretch))) / per_lap
    return SIDE / 2.0 + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def drive(per_lap: int, seed: int, sigma: float, detection: float, rotation: float) -> Drive:
    """Drive once. The cells of one seed see the same forest from the same poses; only what noise does differs."""
    trees, poses_rng = _forest(seed), np.random.default_rng([seed, 1])
    positions, turns = path(per_lap, poses_rng), poses_rng.random(LAPS * per_lap)
    rng = np.random.default_rng([seed, 2, round(1000 * sigma), round(1000 * detection)])
    observations = [
        observe(trees, SE2(x, y, turn * rotation), Sensor(SENSOR, sigma=sigma, detection=detection), rng)
        for (x, y), turn in zip(positions.tolist(), turns.tolist(), strict=True)
    ]
    first, second = np.triu_indices(len(observations), 1)
    poses = np.array([(o.pose.x, o.pose.y, o.pose.yaw) for o in observations])
    truth = relative(poses[first], poses[second])
    apart = np.hypot(truth[:, 0], truth[:, 1])
    return Drive(observations, first, second, truth, apart, apart < SENSOR)


def relative(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """first_T_second (P, 3) of poses map_T_first and map_T_second (P, 3): x, y, metres, and yaw, radians."""
    shift, c, s = second[:, :2] - first[:, :2], np.cos(first[:, 2]), np.sin(first[:, 2])
    x, y = c * shift[:, 0] + s * shift[:, 1], c * shift[:, 1] - s * shift[:, 0]
    return np.column_stack([x, y, second[:, 2] - first[:, 2]])


@lru_cache(maxsize=4)
def _forest(seed: int) -> NDArray[np.float64]:
    return paper_forest(np.random.default_rng([seed, 0]), SIDE)
