"""Transforms and poses, and how sure they are. Metres and radians, counter-clockwise."""

from collections.abc import Iterable
from math import cos, sin

from pydantic import BaseModel, ConfigDict

Covariance = tuple[float, float, float, float, float, float, float, float, float]


class Model(BaseModel):
    """Base of all documents: immutable, and blind to fields it does not know."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class TreesMiddle(Model):
    """How sure a transform is about the middle of the trees that it was fitted to.

    `source` is that point in the frame that the transform takes points from, `target` the same in the frame that it
    leads to; metres. `covariance` and its inverse `information` are 3 x 3, row by row, over (x, y, yaw): of `target`
    along the axes of its frame, and of the yaw. They can be inverted wherever the frames' origins lie.
    """

    source: tuple[float, float]
    target: tuple[float, float]
    covariance: Covariance
    information: Covariance


class Transform(Model):
    """`submap_T_query`; `covariance` is 3 x 3, row by row, over (x, y, yaw).

    It is along the axes of `covariance_frame` (the submap's), about the point `about` (the query's origin); `middle`
    has the same about the trees.
    """

    x: float
    y: float
    yaw: float
    covariance: Covariance | None = None
    covariance_frame: str | None = None
    about: str | None = None
    middle: TreesMiddle | None = None

    def apply(self, xy: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
        """Points of the query's frame, in the submap's frame; metres."""
        c, s = cos(self.yaw), sin(self.yaw)
        return [(c * x - s * y + self.x, s * x + c * y + self.y) for x, y in xy]


class MapPose(Model):
    """Where a frame lies in the map `frame_id`: p_map = R(yaw) p + (x, y).

    `yaw` is in radians. `covariance` is 3 x 3, row by row, over (x, y, yaw): along the axes of the map's frame, about
    the origin of the frame whose pose it is; `middle`, in answers to queries, has the same about the trees.
    """

    frame_id: str = "map"
    x: float
    y: float
    yaw: float
    covariance: Covariance | None = None
    covariance_frame: str = "map"
    about: str = "submap_origin"
    middle: TreesMiddle | None = None
