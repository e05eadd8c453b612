"""Bodies of constraints between submaps, for pose graphs."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from server.schemas.candidates import WARNED
from server.schemas.common import Answer, DefaultedBody, Formerly, Label, Metres, ResourceId
from server.schemas.poses import PoseWithCovariance, TreesMiddle

ConstraintFormat = Literal["ndjson", "json", "g2o", "g2o_middle", "matrices"]


class ConstraintGates(DefaultedBody):
    """What an accepted match must also pass to become a constraint."""

    confidence: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0, description="Least confidence that a match must have to become a constraint."
    )
    inlier_count: Annotated[int, Field(ge=0, strict=True), Formerly("inliers")] = Field(
        0, description="Fewest inliers that a match must have to become a constraint."
    )
    rms: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = Field(
        None,
        description="Largest root mean square of the inliers' residuals, in metres, that a match may have to become a "
        "constraint.",
    )


class ConstraintExclude(DefaultedBody):
    """Pairs of submaps to leave out. If both members are given, only pairs for which both hold are left out."""

    same_session: Annotated[bool, Field(strict=True)] = Field(
        False,
        description="Leave out pairs of the same session. With `within_seconds`, only those that are also that close "
        "in time.",
    )
    within_seconds: Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)] | None = Field(
        None,
        description="Leave out pairs whose stamps differ by at most this many seconds. With `same_session`, only those "
        "of the same session. A submap without a stamp is paired with every other.",
    )


class ConstraintsInput(DefaultedBody):
    """Which submaps to look up, in which others, and which matches become constraints."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{}, {"session": "monday", "exclude": {"same_session": True}}]}
    )

    session: Label | None = Field(
        None, description="Look up only the submaps of this session. They are compared with all submaps."
    )
    submap_ids: Annotated[list[ResourceId], Field(min_length=1, max_length=10_000)] | None = Field(
        None, description="Look up only the submaps with these ids. They are compared with all submaps."
    )
    frame_id: Label | None = Field(None, description="Look up only submaps that have a pose in this map frame.")
    bbox: tuple[Metres, Metres, Metres, Metres] | None = Field(
        None,
        description="Look up only submaps whose footprint reaches into this box: [min x, min y, max x, max y], in "
        "metres in the map frame.",
    )
    datetime: str | None = Field(
        None,
        max_length=100,
        description="Look up only submaps with a stamp in this interval, such as "
        "`2026-05-04T00:00:00Z/2026-05-05T00:00:00Z`; `..` leaves an end open.",
    )
    gates: ConstraintGates = Field(
        default_factory=ConstraintGates, description="What an accepted match must also pass to become a constraint."
    )
    exclude: ConstraintExclude = Field(default_factory=ConstraintExclude, description="Pairs of submaps to leave out.")
    per_submap: Annotated[int, Field(ge=1, le=20, strict=True)] = Field(
        3, description="Most constraints from one submap that is looked up."
    )
    changed_only: Annotated[bool, Field(strict=True)] = Field(
        False,
        description="Look up only submaps that are new, or whose landmarks changed, since an earlier job with the same "
        "`gates`, `exclude` and `per_submap` looked them up. Constraints that it found are kept.",
    )


class ConstraintTransform(PoseWithCovariance):
    """from_T_to: the pose of the frame of `to` in the frame of `from`."""

    covariance_frame: Literal["from"] = Field(
        "from", description="Axes of `covariance`: those of the frame of the submap `from`."
    )
    about: Literal["to_origin"] = Field(
        "to_origin", description="The point that `covariance` is about: the origin of the frame of the submap `to`."
    )
    middle: TreesMiddle = Field(description="The uncertainty about the middle of the trees that both submaps have.")


class Constraint(Answer):
    """The relative pose of two submaps: from_T_to takes points of `to` into the frame of `from`."""

    from_: str = Field(alias="from", description="Id of the submap whose frame the transform takes points to.")
    to: str = Field(description="Id of the submap whose points the transform takes.")
    transform: ConstraintTransform = Field(description="from_T_to: p_from = R(yaw) p_to + (x, y).")
    information: list[float] = Field(
        description="Information matrix of the edge, as pose graphs use it: 3x3, row-major over (x, y, yaw), of the "
        "error log(measured^-1 true), about the origin of the frame of `to`, along the axes of that frame."
    )
    information_frame: Literal["to"] = Field(
        "to", description="Axes of `information`: those of the frame of the submap `to`."
    )
    rank: int | None = Field(
        None,
        description="Rank of the match in its search. Only the match of rank 1 was compared with all rivals; in rows "
        "of trees, others are often off by a row. Null in older results.",
    )
    inlier_count: int = Field(description="Number of pairs of landmarks that agree.")
    rms: float = Field(description="Root mean square of the inliers' residuals, in metres.")
    confidence: float = Field(description="Calibrated probability that `transform` is right.")
    from_session: str | None = Field(description="Session of the submap `from`. Null if it has none.")
    to_session: str | None = Field(description="Session of the submap `to`. Null if it has none.")
    from_revision: int | None = Field(
        description="Revision of the collection at which the landmarks of `from` were stored. Null in older results."
    )
    to_revision: int | None = Field(
        description="Revision of the collection at which the landmarks of `to` were stored. Null in older results."
    )
    warnings: list[str] = Field(default_factory=list, description=WARNED)
    stale: bool = Field(
        description="Whether one of the two submaps is known to have been deleted, or to have had its landmarks "
        "changed, since the match. The formats g2o and matrices leave stale constraints out."
    )


class ConstraintList(Answer):
    """The constraints that a job found."""

    constraints: list[Constraint] = Field(description="The constraints, at most one for each pair of submaps.")


CONSTRAINT_EXAMPLE: dict[str, Any] = {
    "from": "p7",
    "to": "q3",
    "transform": {
        "x": 1.2,
        "y": -0.4,
        "yaw": 0.31,
        "covariance": [0.001, 0, 0, 0, 0.001, 0, 0, 0, 1e-6],
        "covariance_frame": "from",
        "about": "to_origin",
        "middle": {
            "source": [0.0, 0.0],
            "target": [1.2, -0.4],
            "covariance": [0.001, 0, 0, 0, 0.001, 0, 0, 0, 1e-6],
            "information": [1000, 0, 0, 0, 1000, 0, 0, 0, 1e6],
        },
    },
    "information": [1000, 0, 0, 0, 1000, 0, 0, 0, 1e6],
    "information_frame": "to",
    "rank": 1,
    "inlier_count": 41,
    "rms": 0.12,
    "confidence": 0.9999,
    "from_session": "monday",
    "to_session": "tuesday",
    "from_revision": 7,
    "to_revision": 12,
    "warnings": [],
    "stale": False,
}
