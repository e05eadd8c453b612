"""Transforms, poses, and how sure they are: each covariance says along which axes it is, and about which point."""

import math
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import AfterValidator, Field

from server.schemas.common import Answer, Body, Label, Metres, Number, Point

_ROUNDED: Final = 1e-6
"""Eigenvalue below 0 that a matrix of correlations may have: covariances come in single precision, too."""
_TURN: Final = 2.0 * math.pi
_MOST: Final = 1e20
"""Largest entry of a covariance: answers about an origin 1e8 m from the trees can be posted, whatever their yaw's."""

_Moment = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-_MOST, le=_MOST)]
Covariance = Annotated[list[_Moment], Field(min_length=9, max_length=9)]


def check_covariance(values: list[float]) -> list[float]:
    """Refuse what cannot be a covariance over (x, y, yaw): it is symmetric, and no combination varies less than 0."""
    matrix = np.reshape(values, (3, 3))
    variances = np.diag(matrix)
    for row in range(3):
        if variances[row] < 0:
            raise ValueError(f"is a 3x3 row-major covariance: the variance at position {4 * row} must not be negative")
    # Each entry beside its own deviations, since metres and radians are of different sizes.
    deviations = np.sqrt(variances)
    sizes = np.outer(deviations, deviations)
    if (np.abs(matrix - matrix.T) > 1e-6 * np.abs(matrix) + 1e-9 * sizes).any():
        raise ValueError("is a 3x3 row-major covariance over (x, y, yaw) and must be symmetric")
    known = deviations > 0.0
    if matrix[~known].any() or matrix[:, ~known].any():
        raise ValueError("is a 3x3 row-major covariance: where a variance is 0, its row and column must be 0, too")
    correlations = matrix[np.ix_(known, known)] / sizes[np.ix_(known, known)]
    if known.any() and np.linalg.eigvalsh(0.5 * (correlations + correlations.T))[0] < -_ROUNDED:
        raise ValueError(
            "is a 3x3 row-major covariance over (x, y, yaw) and must be positive semidefinite: "
            "no entry may be larger in size than the root of the product of its two variances allows"
        )
    return values


def check_yaw(value: float) -> float:
    """Refuse a yaw of more than a turn: it is hardly in radians."""
    if abs(value) > _TURN:
        raise ValueError(
            f"must be in radians, from -2 pi to 2 pi; {value:g} is more than a whole turn "
            f"({value:g} degrees would be {math.remainder(math.radians(value), _TURN):.6g})"
        )
    return value


Yaw = Annotated[Number, AfterValidator(check_yaw)]
CheckedCovariance = Annotated[Covariance, AfterValidator(check_covariance)]


class TreesMiddle(Answer):
    """How sure a transform is about the middle of the trees that it was fitted to.

    There the matrices can be inverted wherever the frames' origins lie. Use them with coordinates far from the origin.
    """

    source: Point = Field(description="The middle of the trees, in the frame that the transform takes points from.")
    target: Point = Field(description="The middle of the trees, in the frame that the transform leads to.")
    covariance: list[float] = Field(
        description="3x3 row-major over (x, y, yaw): of `target`, along the axes of the frame that the transform leads "
        "to, and of the yaw. Square metres, metre radians, square radians."
    )
    information: list[float] = Field(description="The inverse of `covariance`, 3x3 row-major.")


class MapPose(Body):
    """Pose of a submap's frame in a map: p_map = R(yaw) p_submap + (x, y)."""

    frame_id: Label = Field("map", description="The map's frame.")
    x: Metres = Field(description="Metres, east where geographic; relative to the collection's origin.")
    y: Metres = Field(description="Metres, north where geographic; relative to the collection's origin.")
    yaw: Yaw = Field(description="Radians, counter-clockwise; from -2 pi to 2 pi.")
    covariance: CheckedCovariance | None = Field(
        None,
        description="3x3 row-major over (x, y, yaw), symmetric and positive semidefinite: of the position of the "
        "submap's origin, along the axes of the map's frame, and of the yaw. Null where it is not known.",
    )
    covariance_frame: Literal["map"] = Field(
        "map", description="The frame of `covariance`, as in answers; nothing else is possible."
    )
    about: Literal["submap_origin", "query_origin"] = Field(
        "submap_origin", description="Accepted as in answers: a query's pose in the map can be posted as it is."
    )
    middle: TreesMiddle | None = Field(
        None,
        description="Accepted so that the pose in an answer can be posted as it is; only `covariance` is kept.",
    )


class Transform(Answer):
    """A rigid transform: metres, radians, counter-clockwise."""

    x: float = Field(description="Translation along x, in metres.")
    y: float = Field(description="Translation along y, in metres.")
    yaw: float = Field(description="Radians, counter-clockwise.")


class PoseWithCovariance(Transform):
    """A rigid transform or pose: metres, radians, counter-clockwise."""

    covariance: Annotated[list[float], Field(min_length=9, max_length=9)] | None = Field(
        description="3x3 row-major over (x, y, yaw) in square metres, metre radians, square radians; along the axes of "
        "`covariance_frame`, about the point `about`. Null where it is not known."
    )


class PlacedPose(PoseWithCovariance):
    """Pose of a stored submap's frame in a map: p_map = R(yaw) p_submap + (x, y)."""

    frame_id: str = Field(description="The map's frame.")
    covariance_frame: Literal["map"] = Field("map", description="Axes of the covariance: the map's frame.")
    about: Literal["submap_origin"] = Field(
        "submap_origin", description="The covariance is of this point: the submap frame's origin."
    )


class CandidateTransform(PoseWithCovariance):
    """The query's pose in a submap's frame."""

    covariance_frame: Literal["submap"] = Field("submap", description="Axes of the covariance: the submap's frame.")
    about: Literal["query_origin"] = Field(
        "query_origin", description="The covariance is of this point: the query frame's origin."
    )
    middle: TreesMiddle | None = Field(
        None, description="Uncertainty about the middle of the inliers; null in answers stored by older versions."
    )


class MapPoseAnswer(PoseWithCovariance):
    """Pose of the query's frame in the map that the submap is placed in."""

    frame_id: str = Field(description="The map's frame.")
    covariance_frame: Literal["map"] = Field("map", description="Axes of the covariance: the map's frame.")
    about: Literal["query_origin"] = Field(
        "query_origin", description="The covariance is of this point: the query frame's origin."
    )
    middle: TreesMiddle | None = Field(
        None, description="Uncertainty about the middle of the inliers; null where `covariance` is."
    )
