"""Transforms, poses and their covariances. Each covariance names its axes and the point that it is about."""

import math
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from server.schemas.common import Answer, DefaultedBody, Label, Metres, Number, Point
from urquhart.prior.prior import LEAST_NOISE, MOST_NOISE

_ROUNDED: Final = 1e-6
"""How far below 0 an eigenvalue of a correlation matrix may be: covariances may be in single precision."""
_DEFINITE: Final = 1e-9
"""Least eigenvalue of the correlation matrix of a prior."""
_TURN: Final = 2.0 * math.pi
_MOST: Final = 1e20
"""Largest entry of a covariance. Answers about an origin 1e8 m from the trees stay below it and can be posted."""

_Moment = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-_MOST, le=_MOST)]
Covariance = Annotated[list[_Moment], Field(min_length=9, max_length=9)]


def check_covariance(values: list[float]) -> list[float]:
    """Refuse a matrix over (x, y, yaw) that is not symmetric and positive semidefinite."""
    matrix = np.reshape(values, (3, 3))
    variances = np.diag(matrix)
    for row in range(3):
        if variances[row] < 0:
            raise ValueError(
                f"must be a 3x3 row-major covariance over (x, y, yaw); the variance at position {4 * row} is negative"
            )
    # Each entry is compared with its own deviations, because metres and radians differ in size.
    deviations = np.sqrt(variances)
    sizes = np.outer(deviations, deviations)
    if (np.abs(matrix - matrix.T) > 1e-6 * np.abs(matrix) + 1e-9 * sizes).any():
        raise ValueError("must be a 3x3 row-major covariance over (x, y, yaw); this matrix is not symmetric")
    known = deviations > 0.0
    if matrix[~known].any() or matrix[:, ~known].any():
        raise ValueError(
            "must be a 3x3 row-major covariance over (x, y, yaw); if a variance is 0, its row and column must be 0, too"
        )
    correlations = matrix[np.ix_(known, known)] / sizes[np.ix_(known, known)]
    if known.any() and np.linalg.eigvalsh(0.5 * (correlations + correlations.T))[0] < -_ROUNDED:
        raise ValueError(
            "must be a 3x3 row-major covariance over (x, y, yaw); this matrix is not positive semidefinite: "
            "covariances are too large for their variances"
        )
    return values


def check_yaw(value: float) -> float:
    """Refuse a yaw of more than a whole turn, which is probably in degrees."""
    if abs(value) > _TURN:
        raise ValueError(
            f"must be in radians, from -2 pi to 2 pi; {value:g} is more than a whole turn "
            f"({value:g} degrees would be {math.remainder(math.radians(value), _TURN):.6g})"
        )
    return value


Yaw = Annotated[Number, AfterValidator(check_yaw)]
CheckedCovariance = Annotated[Covariance, AfterValidator(check_covariance)]


class TreesMiddle(Answer):
    """The uncertainty of a transform about the middle of the trees that it was fitted to.

    These matrices can be inverted wherever the frames' origins are. Use them if coordinates are far from the origin.
    """

    source: Point = Field(
        description="The middle of the trees as [x, y] in metres, in the frame that the transform takes points from."
    )
    target: Point = Field(
        description="The middle of the trees as [x, y] in metres, in the frame that the transform takes points to."
    )
    covariance: list[float] = Field(
        description="Covariance of the position of `target`, along the axes of its frame, and of the yaw: 3x3, "
        "row-major over (x, y, yaw), in square metres, metre radians and square radians."
    )
    information: list[float] = Field(description="Information matrix, 3x3, row-major: the inverse of `covariance`.")


class MapPose(DefaultedBody):
    """Pose of a submap's frame in a map: p_map = R(yaw) p_submap + (x, y)."""

    frame_id: Label = Field("map", description="Name of the map's frame.")
    x: Metres = Field(
        description="Position of the submap's origin along the map's x axis, in metres from the map frame's origin. "
        "East if the map is geographic."
    )
    y: Metres = Field(
        description="Position of the submap's origin along the map's y axis, in metres from the map frame's origin. "
        "North if the map is geographic."
    )
    yaw: Yaw = Field(
        description="Rotation from the submap's axes to the map's, in radians, counter-clockwise, from -2 pi to 2 pi."
    )
    covariance: CheckedCovariance | None = Field(
        None,
        description="Covariance of the position of the submap's origin, along the map's axes, and of the yaw: 3x3, "
        "row-major over (x, y, yaw), in square metres, metre radians and square radians. It must be symmetric and "
        "positive semidefinite. Null if it is unknown.",
    )
    covariance_frame: Literal["map"] = Field(
        "map", description="Axes of `covariance`: always the map's. Accepted because poses in answers have it."
    )
    about: Literal["submap_origin", "query_origin"] = Field(
        "submap_origin",
        description="The point that `covariance` is about. Ignored: it is accepted so that the `map_pose` of a "
        "candidate can be posted unchanged.",
    )
    middle: TreesMiddle | None = Field(
        None,
        description="Uncertainty about the middle of the trees. Ignored: it is accepted so that the `map_pose` of a "
        "candidate can be posted unchanged. Only `covariance` is stored.",
    )


class Near(DefaultedBody):
    """Roughly where in a map the query was observed. Only submaps near that point are searched."""

    frame_id: Label = Field("map", description="Name of the map's frame, as in `map_pose`.")
    x: Metres = Field(description="Position along the map's x axis, in metres, as in `map_pose`.")
    y: Metres = Field(description="Position along the map's y axis, in metres, as in `map_pose`.")
    radius: Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)] = Field(
        description="Largest distance, in metres along each axis, between the point and the footprint of a submap that "
        "is searched."
    )


class PriorPose(DefaultedBody):
    """The rough pose of a query in a map: p_map = R(yaw) p_query + t. The point `about` lies at (x, y), roughly."""

    frame_id: Label = Field("map", description="Name of the map's frame, as in `map_pose`.")
    x: Metres = Field(description="Most likely position along the map's x axis, in metres, as in `map_pose`.")
    y: Metres = Field(description="Most likely position along the map's y axis, in metres, as in `map_pose`.")
    yaw: Yaw | None = Field(
        None,
        description="Most likely rotation from the query's axes to the map's, in radians, counter-clockwise, from -2 "
        "pi to 2 pi. Null if it is unknown; then every rotation is tried.",
    )
    covariance: CheckedCovariance = Field(
        description="Covariance of the position of `about`, along the map's axes, and of the yaw: 3x3, row-major over "
        "(x, y, yaw), in square metres, metre radians and square radians. It must be symmetric and positive definite; "
        "without `yaw`, the entries of yaw are not used and may be 0."
    )
    about: Point = Field(
        (0.0, 0.0),
        description="The point of the query's frame whose position is known, as [x, y] in metres, such as the plot's "
        "centre. By default the origin.",
    )
    noise: Annotated[Number, Field(ge=LEAST_NOISE, le=MOST_NOISE)] | None = Field(
        None,
        description="Roughly the standard deviation of one coordinate of a tree in the map against the same stem in "
        "the query, in metres. Null if it is unknown; then 0.3 to 1.1 m is tried.",
    )

    @field_validator("covariance")
    @classmethod
    def _positive_definite(cls, value: list[float], info: ValidationInfo) -> list[float]:
        size = 2 if info.data.get("yaw") is None else 3
        matrix = np.reshape(value, (3, 3))[:size, :size]
        deviations = np.sqrt(np.diag(matrix))
        if not deviations.all() or np.linalg.eigvalsh(matrix / np.outer(deviations, deviations))[0] < _DEFINITE:
            names = "x and y" if size == 2 else "x, y and yaw"
            raise ValueError(
                f"must be positive definite over {names}: give each a variance above 0, however small, and "
                "correlations below 1"
            )
        return value


class Transform(Answer):
    """A rigid transform: a rotation by `yaw`, then a translation by (x, y)."""

    x: float = Field(description="Translation along x, in metres, in the frame that the transform takes points to.")
    y: float = Field(description="Translation along y, in metres, in the frame that the transform takes points to.")
    yaw: float = Field(description="Rotation in radians, counter-clockwise.")


class PoseWithCovariance(Transform):
    """A rigid transform with its covariance: a rotation by `yaw`, then a translation by (x, y)."""

    covariance: Annotated[list[float], Field(min_length=9, max_length=9)] | None = Field(
        description="Covariance of the position of the point `about`, along the axes of `covariance_frame`, and of the "
        "yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. Null if it is "
        "unknown."
    )


class PlacedPose(PoseWithCovariance):
    """Pose of a stored submap's frame in a map: p_map = R(yaw) p_submap + (x, y)."""

    frame_id: str = Field(description="Name of the map's frame.")
    covariance_frame: Literal["map"] = Field("map", description="Axes of `covariance`: those of the map's frame.")
    about: Literal["submap_origin"] = Field(
        "submap_origin", description="The point that `covariance` is about: the origin of the submap's frame."
    )


class CandidateTransform(PoseWithCovariance):
    """The query's pose in a submap's frame."""

    covariance_frame: Literal["submap"] = Field(
        "submap", description="Axes of `covariance`: those of the submap's frame."
    )
    about: Literal["query_origin"] = Field(
        "query_origin", description="The point that `covariance` is about: the origin of the query's frame."
    )
    middle: TreesMiddle | None = Field(
        None,
        description="The uncertainty about the middle of the inlier trees. Null in answers that an older version "
        "stored.",
    )


class MapPoseAnswer(PoseWithCovariance):
    """Pose of the query's frame in the map that the submap has a pose in: p_map = R(yaw) p_query + (x, y)."""

    frame_id: str = Field(description="Name of the map's frame.")
    covariance_frame: Literal["map"] = Field("map", description="Axes of `covariance`: those of the map's frame.")
    about: Literal["query_origin"] = Field(
        "query_origin", description="The point that `covariance` is about: the origin of the query's frame."
    )
    middle: TreesMiddle | None = Field(
        None, description="The uncertainty about the middle of the inlier trees. Null if `covariance` is null."
    )


class SurveyPose(Answer):
    """A pose as surveyors give it: shift and turn about the middle of the query's trees. Lengths are in metres.

    The shift is what to add to the query's coordinates, if they are meant to be those of this frame. Otherwise it is
    only the difference of two frames, and `position` is what tells the place.
    """

    frame_id: str | None = Field(
        description="Name of the map frame that the pose is in. Null if the submap has no `map_pose`: the pose is then "
        "in the submap's frame."
    )
    crs: str | None = Field(
        description="Coordinate reference system of the map frame, as the collection, or the stem map stored there, "
        "names it. Null if it is not known."
    )
    crs_unit: str | None = Field(
        description="Name of the unit of `crs`, and so of `crs_position`. Null without a projected system."
    )
    metres_per_unit: float | None = Field(description="Metres in one `crs_unit`. Null without a projected system.")
    crs_position: Point | None = Field(
        description="`position` in full coordinates of `crs`, east first, in its unit. Null without a projected system."
    )
    crs_shift: Point | None = Field(
        None,
        description="`crs_position` minus `centre`, both in metres: what to add to the query's coordinates, if they "
        "are meant to be those of `crs`. It differs from `shift` by the origin of the map frame. Null without a "
        "projected system.",
    )
    axes: tuple[Literal["east", "x"], Literal["north", "y"]] = Field(
        description="What the first and the second coordinate point to: `east` and `north` if the map frame has a "
        "coordinate reference system, else `x` and `y`."
    )
    centre: Point = Field(description="The middle (mean) of the query's landmarks, in metres, in the query's frame.")
    position: Point = Field(description="The same point in the map frame (or the submap's), in metres.")
    shift: Point = Field(description="`position` minus `centre`, in metres: dE and dN if `axes` are east and north.")
    turn_degrees: float = Field(
        description="Turn of the query about `centre`, in degrees, from -180 to 180; positive as `turn_positive` says."
    )
    turn_positive: Literal["counter_clockwise"] = Field(
        "counter_clockwise", description="Direction of a positive turn, seen from above."
    )
    covariance: Annotated[list[float], Field(min_length=9, max_length=9)] | None = Field(
        description="Covariance of `shift` along `axes`, and of the turn in radians: 3x3, row-major over (x, y, yaw), "
        "in square metres, metre radians and square radians. Null if it is unknown, because that of `map_pose` is."
    )
    covariance_frame: Literal["map", "submap"] = Field(
        description="Axes of `covariance`: those of the map's frame, or of the submap's if it has no `map_pose`."
    )
    about: Literal["query_centre"] = Field(
        "query_centre", description="The point that `covariance` is about: `centre`."
    )
    shift_sigma: Point | None = Field(
        description="Standard deviations of `shift`, in metres. Null if `covariance` is null."
    )
    turn_sigma_degrees: float | None = Field(
        description="Standard deviation of the turn, in degrees. Null if `covariance` is null."
    )
