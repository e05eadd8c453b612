"""The queries of the demo: simulated observations of mapped stands, and a judgement of the answers."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.reader import StemMap
from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, observe
from urquhart_client import QueryResult

RIGHT_METRES: Final = 1.0
RIGHT_DEGREES: Final = 3.0
ATTEMPTS: Final = 1000


@dataclass(frozen=True, slots=True)
class DemoStand:
    """One forest of the demo, in metres.

    `radius` and `spacing` cut it into submaps; they are None if it is not stored. `sensor_range` is how far an observer
    sees, and `minimum_trees` how many trees a place must have in that range.
    """

    name: str
    sensor_range: float
    minimum_trees: int = 25
    radius: float | None = None
    spacing: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class DemoQuestion:
    """An observation and the truth: `xy` (N, 2) float64, metres, observer's frame; `pose` is `map_T_observer`."""

    stand: DemoStand
    xy: NDArray[np.float64]
    pose: SE2


@dataclass(frozen=True, slots=True)
class JudgedAnswer:
    """An answer compared with the truth: errors in metres and degrees if it has a pose, and whether it is `right`.

    For a stored stand, right is `matched` within 1 m and 3 degrees; for another one, anything but `matched`.
    """

    question: DemoQuestion
    result: QueryResult
    milliseconds: float
    metres: float | None
    degrees: float | None
    right: bool
    wrong: bool


@dataclass(frozen=True, slots=True)
class Noise:
    """Ranges of the noise of an observation: standard deviation of a coordinate in metres, and probability that a tree
    is seen.
    """

    sigma: tuple[float, float]
    detection: tuple[float, float]


USUAL: Final = Noise((0.1, 0.2), (0.90, 0.95))
HARD: Final = Noise((0.3, 0.35), (0.75, 0.8))
"""A polygon of the paper needs all of its trees; with this noise, hardly one is complete."""


def ask(stand: DemoStand, stem_map: StemMap, rng: np.random.Generator, noise: Noise = USUAL) -> DemoQuestion:
    """An observation from a random place in the stand that has trees around it, with a random heading."""
    low, high = stem_map.xy.min(axis=0), stem_map.xy.max(axis=0)
    for _ in range(ATTEMPTS):
        x, y = rng.uniform(low, high)
        in_range = ((stem_map.xy - (x, y)) ** 2).sum(axis=1) <= stand.sensor_range**2
        if in_range.sum() >= stand.minimum_trees:
            pose = SE2(float(x), float(y), float(rng.uniform(0.0, 2.0 * math.pi)))
            seen = observe(
                stem_map.xy,
                pose,
                Sensor(
                    stand.sensor_range,
                    sigma=float(rng.uniform(*noise.sigma)),
                    detection=float(rng.uniform(*noise.detection)),
                ),
                rng,
            )
            return DemoQuestion(stand, seen.xy, pose)
    raise RuntimeError(f"{stand.name} has no place with {stand.minimum_trees} trees within {stand.sensor_range:g} m")


def judge(question: DemoQuestion, result: QueryResult, milliseconds: float) -> JudgedAnswer:
    """Compare an answer with the truth."""
    known = question.stand.radius is not None
    matched = result.verdict == "matched"
    metres = degrees = None
    best = result.best
    if matched and known and best is not None and best.map_pose is not None:
        pose = best.map_pose
        if pose.frame_id == question.stand.name:
            metres, radians = SE2(pose.x, pose.y, pose.yaw).distance(question.pose)
            degrees = math.degrees(radians)
    close = metres is not None and degrees is not None and metres <= RIGHT_METRES and degrees <= RIGHT_DEGREES
    return JudgedAnswer(
        question=question,
        result=result,
        milliseconds=milliseconds,
        metres=metres,
        degrees=degrees,
        right=close if known else not matched,
        wrong=matched and not close,
    )
