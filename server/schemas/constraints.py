"""Bodies of constraints between submaps, for pose graphs."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from server.schemas.candidates import WARNED
from server.schemas.common import Answer, Body, Label, Metres, ResourceId
from server.schemas.poses import PoseWithCovariance, TreesMiddle

ConstraintFormat = Literal["ndjson", "json", "g2o", "g2o_middle", "matrices"]


class ConstraintGates(Body):
    """What a match must have to become a constraint, besides being accepted."""

    confidence: Annotated[float, Field(ge=0, le=1)] = Field(0.0, description="Least confidence of the match.")
    inliers: Annotated[int, Field(ge=0, strict=True)] = Field(0, description="Fewest inliers of the match.")
    rms: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = Field(
        None, description="Largest root mean square of the inliers' residuals, in metres."
    )


class ConstraintExclude(Body):
    """Which pairs are not looked for: as in queries, those for which all that is given holds."""

    same_session: Annotated[bool, Field(strict=True)] = Field(
        False, description="Pairs of one session; with `within_seconds` only those that are as close in time, too."
    )
    within_seconds: Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)] | None = Field(
        None,
        description="Pairs with stamps so close to each other, with `same_session` only those of one session; "
        "submaps without a stamp are paired with any.",
    )


class ConstraintsInput(Body):
    """Which submaps to look up, and what counts."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{}, {"session": "monday", "exclude": {"same_session": True}}]}
    )

    session: Label | None = Field(None, description="Only submaps of this session are looked up, in all others.")
    submap_ids: Annotated[list[ResourceId], Field(min_length=1, max_length=10_000)] | None = Field(
        None, description="Only these submaps are looked up, in all others."
    )
    frame_id: Label | None = Field(None, description="Only submaps placed in this map are looked up.")
    bbox: tuple[Metres, Metres, Metres, Metres] | None = Field(
        None, description="Only submaps whose footprint reaches into this box: min x, min y, max x, max y, map frame."
    )
    datetime: str | None = Field(
        None, max_length=100, description="Only submaps with a stamp in this interval are looked up."
    )
    gates: ConstraintGates = Field(default_factory=ConstraintGates)
    exclude: ConstraintExclude = Field(default_factory=ConstraintExclude)
    per_submap: Annotated[int, Field(ge=1, le=20, strict=True)] = Field(
        3, description="Most constraints from one look-up."
    )


class ConstraintTransform(PoseWithCovariance):
    """from_T_to: the pose of the submap `to` in the frame of `from`."""

    covariance_frame: Literal["from"] = Field("from", description="Axes of the covariance: the frame of `from`.")
    about: Literal["to_origin"] = Field("to_origin", description="The covariance is of this point: the origin of `to`.")
    middle: TreesMiddle = Field(description="Uncertainty about the middle of the trees that both submaps have.")


class Constraint(Answer):
    """How two submaps lie to each other: from_T_to takes points of `to` into the frame of `from`."""

    from_: str = Field(alias="from")
    to: str
    transform: ConstraintTransform
    information: list[float] = Field(
        description="3x3 row-major over (x, y, yaw), as pose graphs weigh an edge: of the error log(measured^-1 true), "
        "about the origin of the frame of `to`, along the axes of that frame."
    )
    information_frame: Literal["to"] = Field("to", description="Axes of the information: the frame of `to`.")
    inliers: int
    rms: float
    confidence: float
    from_session: str | None
    to_session: str | None
    from_revision: int | None = Field(
        description="Collection's revision at which the landmarks of `from` came; null in older results."
    )
    to_revision: int | None = Field(
        description="Collection's revision at which the landmarks of `to` came; null in older results."
    )
    warnings: list[str] = Field(default_factory=list, description=WARNED)
    stale: bool = Field(
        description="Whether one of the two submaps went since, or has other landmarks now, as far as is known. "
        "Neither g2o nor matrices hold stale ones."
    )


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
    "inliers": 41,
    "rms": 0.12,
    "confidence": 0.9999,
    "from_session": "monday",
    "to_session": "tuesday",
    "from_revision": 7,
    "to_revision": 12,
    "warnings": [],
    "stale": False,
}
