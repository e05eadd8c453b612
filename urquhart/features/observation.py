"""An observation before a search: its features, or the reason why no search can begin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from numpy.typing import ArrayLike

from urquhart.budget import UNBOUNDED, Budget, DeadlinePassed
from urquhart.config import Config
from urquhart.features.describe import Features, describe
from urquhart.features.landmark_checks import LandmarkError
from urquhart.trace import Stage, Trace

Obstacle = Literal["too_few_landmarks", "collinear_landmarks", "deadline"]
"""Why an observation cannot be searched for; the reason of its `no_match`."""

OBSTACLES: Final[Mapping[str, Obstacle]] = {"too_few": "too_few_landmarks", "collinear": "collinear_landmarks"}
"""Codes of `LandmarkError` that are not the caller's fault: too few trees, or trees on one line, fix no pose."""


@dataclass(frozen=True, slots=True, eq=False)
class Description:
    """Result of describing one observation.

    Attributes:
        result: the features, or why no search can begin.
        stages: what describing cost; empty for features that were stored earlier.
    """

    result: Features | Obstacle
    stages: tuple[Stage, ...] = ()


def describe_observation(
    xy: ArrayLike, config: Config, diameters: ArrayLike | None = None, budget: Budget = UNBOUNDED
) -> Description:
    """Describe an observation before a search.

    Args:
        xy: (N, 2), metres, any rigid frame.
        diameters: (N,), stem diameters in any unit, NaN where one is not known.
        budget: when describing must end; a spent budget gives the obstacle `deadline`.

    Raises:
        LandmarkError: the landmarks cannot be used. Too few of them, or all on one line, is an obstacle, not an error.
        Abandoned: nobody waits for the answer any more.
    """
    trace = Trace()
    try:
        with trace.timed("describe") as counts:
            features = describe(xy, config, diameters, budget)
            counts.update(features.counts())
    except LandmarkError as error:
        if error.code not in OBSTACLES:
            raise
        return Description(OBSTACLES[error.code], trace.done())
    except DeadlinePassed:
        return Description("deadline", trace.done())
    return Description(features, trace.done())
