"""Several views of one place in the body of a query."""

import math
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from server.schemas.common import Body, Metres
from server.schemas.landmarks import LandmarkBody
from server.schemas.poses import Yaw
from urquhart import SE2
from urquhart.features.keyframes import JoinedKeyframes, Keyframe, join_keyframes


class KeyframePose(Body):
    """Pose of a keyframe in the frame of the query, such as that of the odometry: p_query = R(yaw) p + (x, y)."""

    x: Metres = Field(description="Position of the keyframe's origin along the x axis of the query, in metres.")
    y: Metres = Field(description="Position of the keyframe's origin along the y axis of the query, in metres.")
    yaw: Yaw = Field(
        description="Rotation from the axes of the keyframe to those of the query, in radians, counter-clockwise."
    )


class KeyframeBody(LandmarkBody):
    """One view of a sequence: its trees in a frame of its own, and where that lies in the frame of the query."""

    pose: KeyframePose = Field(description="Pose of the keyframe in the frame of the query.")


class KeyframedBody(LandmarkBody):
    """Landmarks in one frame, or keyframes that are joined to one observation."""

    keyframes: Annotated[list[KeyframeBody], Field(min_length=1, max_length=50)] | None = Field(
        None,
        description="Several views of the place in a row, with their poses by odometry, instead of `xy` or "
        "`landmarks`. They are joined to one observation, so their evidence adds up to one verdict. A tree that "
        "several views saw counts once, at the mean of its positions. Poses may be off by 1 m from one view to the "
        "next. The id of a tree is the number of the view that saw it first, from 0, `/`, and its id there.",
    )

    @model_validator(mode="after")
    def _views_or_trees(self) -> "KeyframedBody":
        if self.keyframes is not None and (self.xy is not None or self.landmarks is not None):
            raise PydanticCustomError("two_forms", "give either keyframes or landmarks, not both")
        return self

    @cached_property
    def _joined(self) -> JoinedKeyframes:
        views = self.keyframes or []
        return join_keyframes(
            [
                Keyframe(view.positions(), SE2(view.pose.x, view.pose.y, view.pose.yaw), _diameters(view))
                for view in views
            ]
        )

    @property
    def landmark_count(self) -> int:
        """Number of landmarks in the body, those of all keyframes together."""
        if self.keyframes is None:
            return super().landmark_count
        return sum(view.landmark_count for view in self.keyframes)

    @property
    def landmark_pointer(self) -> str:
        """JSON pointer to the field that holds the landmarks."""
        return "/keyframes" if self.keyframes is not None else super().landmark_pointer

    def positions(self) -> NDArray[np.float64]:
        """Positions (N, 2) float64, metres, frame of the query."""
        return super().positions() if self.keyframes is None else self._joined.xy

    def landmark_ids(self) -> list[str] | None:
        """Ids in order of the landmarks; None if each is the default, the landmark's position."""
        if self.keyframes is None:
            return super().landmark_ids()
        names = [view.landmark_ids() for view in self.keyframes]
        return [
            f"{view}/{number if (ids := names[view]) is None else ids[number]}"
            for view, number in self._joined.first.tolist()
        ]

    def attributes(self) -> dict[str, list[Any]] | None:
        """Diameters, heights and species, a list for each that any tree has; of keyframes, the diameters."""
        if self.keyframes is None:
            return super().attributes()
        known = self._joined.diameters
        if known is None:
            return None
        return {"dbh_cm": [None if math.isnan(value) else 100.0 * value for value in known.tolist()]}


def _diameters(view: KeyframeBody) -> NDArray[np.float64] | None:
    """Diameters (N,), metres, NaN where unknown; None if none is known."""
    values = (view.attributes() or {}).get("dbh_cm")
    return None if values is None else 0.01 * np.array([math.nan if v is None else v for v in values], np.float64)
