"""Transforms and poses with their uncertainty, and pairs of trees. Metres and radians, counter-clockwise."""

from collections.abc import Collection, Iterable, Mapping
from datetime import datetime
from math import cos, degrees, sin
from typing import Any, ClassVar, Final

from pydantic import BaseModel, ConfigDict

Covariance = tuple[float, float, float, float, float, float, float, float, float]


_LONGEST: Final = 60
"""Characters of a text in a `repr`."""


class Model(BaseModel):
    """Base of all documents: immutable, and blind to fields it does not know.

    `repr` and `print` give one line: of what is long only the length, and only the fields that `shown` names, if any.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")
    shown: ClassVar[tuple[str, ...]] = ()

    def __repr__(self) -> str:
        names = self.shown or tuple(type(self).model_fields)
        values = {name: getattr(self, name) for name in names}
        told = [f"{name}={_short(value)}" for name, value in values.items() if value not in (None, (), {})]
        return f"{type(self).__name__}({', '.join(told)})"

    __str__ = __repr__


def _short(value: Any) -> str:
    match value:
        case BaseModel():
            return repr(value)
        case float():
            return f"{value:.6g}"
        case datetime():
            return value.isoformat()
        case str():
            return repr(value if len(value) <= _LONGEST else f"{value[:_LONGEST]}...")
        case Mapping() if all(isinstance(one, int) for one in value.values()):
            return f"{{{', '.join(f'{name}: {one}' for name, one in value.items())}}}"
        case Collection():
            return f"<{len(value)}>"
        case _:
            return repr(value)


class TreesMiddle(Model):
    """The uncertainty of a transform about the middle of the trees that it was fitted to.

    `source` is that point in the frame that the transform takes points from, `target` the same in the frame that it
    takes points to; metres. `covariance` and its inverse `information` are 3 x 3, row by row, over (x, y, yaw): of
    `target` along the axes of its frame, and of the yaw. They can be inverted wherever the frames' origins are.
    """

    source: tuple[float, float]
    target: tuple[float, float]
    covariance: Covariance
    information: Covariance


class Transform(Model):
    """`submap_T_query`. `covariance` is 3 x 3, row by row, over (x, y, yaw).

    It is along the axes of `covariance_frame` (the submap's), about the point `about` (the query's origin). `middle`
    has the same about the trees.
    """

    x: float
    y: float
    yaw: float
    covariance: Covariance | None = None
    covariance_frame: str | None = None
    about: str | None = None
    middle: TreesMiddle | None = None

    def __repr__(self) -> str:
        return f"Transform({_pose(self.x, self.y, self.yaw)})"

    __str__ = __repr__

    def apply(self, xy: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
        """Take points of the query's frame to the submap's frame; metres."""
        c, s = cos(self.yaw), sin(self.yaw)
        return [(c * x - s * y + self.x, s * x + c * y + self.y) for x, y in xy]


class MapPose(Model):
    """The pose of a frame in the map `frame_id`: p_map = R(yaw) p + (x, y).

    `yaw` is in radians. `covariance` is 3 x 3, row by row, over (x, y, yaw): along the axes of the map's frame, about
    the origin of the frame whose pose it is. `middle`, in answers to queries, has the same about the trees.
    """

    frame_id: str = "map"
    x: float
    y: float
    yaw: float
    covariance: Covariance | None = None
    covariance_frame: str = "map"
    about: str = "submap_origin"
    middle: TreesMiddle | None = None

    def __repr__(self) -> str:
        return f"MapPose({self.frame_id!r}: {_pose(self.x, self.y, self.yaw)})"

    __str__ = __repr__


class SurveyPose(Model):
    """A pose as surveyors give it: shift and turn about `centre`, the middle of the query's trees. Lengths in metres.

    `frame_id` names the map frame that `position`, the place of that point, is in; None stands for the submap's frame.
    `axes` says what the coordinates point to (`("east", "north")` if the frame has a `crs`), and `crs_position` is the
    position in full coordinates of the `crs`, in `crs_unit`, which has `metres_per_unit`. `shift` is `position` minus
    `centre`: what to add to the query's coordinates, if they are meant to be those of the frame; `crs_shift` is the
    same for those of the `crs`, in metres. `turn_degrees` is positive as `turn_positive` says.
    `covariance` is 3 x 3, row by row, over (x, y, yaw), about `centre`, along the axes of `covariance_frame`, in metres
    and radians; `shift_sigma` and `turn_sigma_degrees` are the standard deviations in it. All three are None if the
    covariance of the submap's pose is not known.
    """

    frame_id: str | None = None
    crs: str | None = None
    crs_unit: str | None = None
    metres_per_unit: float | None = None
    crs_position: tuple[float, float] | None = None
    crs_shift: tuple[float, float] | None = None
    axes: tuple[str, str]
    centre: tuple[float, float]
    position: tuple[float, float]
    shift: tuple[float, float]
    turn_degrees: float
    turn_positive: str
    covariance: Covariance | None = None
    covariance_frame: str
    about: str
    shift_sigma: tuple[float, float] | None = None
    turn_sigma_degrees: float | None = None

    def __repr__(self) -> str:
        (east, north), (first, second) = self.axes, self.shift
        return f"SurveyPose({east} {first:+.3f} m, {north} {second:+.3f} m, turn {self.turn_degrees:+.3f} deg)"

    __str__ = __repr__


def _pose(x: float, y: float, yaw: float) -> str:
    return f"x {x:.3f} m, y {y:.3f} m, yaw {degrees(yaw):.2f} deg"


class Inlier(Model):
    """A landmark of the query and one of the submap that are the same tree; `residual` in metres."""

    query: str
    submap: str
    residual: float


class InlierColumns(Model):
    """Pairs of landmarks as columns: positions in the query's list and in the submap's, counted from 0; metres."""

    query: tuple[int, ...]
    submap: tuple[int, ...]
    residual: tuple[float, ...]
