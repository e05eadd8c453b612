"""What a map is built from."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from server.schemas.common import Body, Label, Metres, ResourceId
from server.schemas.constraints import ConstraintsInput
from server.schemas.poses import CheckedCovariance, MapPose, Yaw


class OdometryEdge(Body):
    """A relative pose that a robot measured while it drove: from_T_to. It is believed within its covariance, unless
    matches prove it wrong.
    """

    from_: ResourceId = Field(alias="from", description="Id of the submap whose frame the pose is in.")
    to: ResourceId = Field(description="Id of the submap whose pose it is.")
    x: Metres = Field(description="Position of the origin of `to` along the x axis of `from`, in metres.")
    y: Metres = Field(description="Position of the origin of `to` along the y axis of `from`, in metres.")
    yaw: Yaw = Field(description="Rotation from the axes of `to` to those of `from`, in radians, counter-clockwise.")
    covariance: CheckedCovariance = Field(
        description="Covariance of the position of the origin of `to`, along the axes of `from`, and of the yaw: 3x3, "
        "row-major over (x, y, yaw), in square metres, metre radians and square radians. It must be positive definite."
    )


class MapInput(ConstraintsInput):
    """Which submaps become a map, which matches between them count, and what to do with the poses."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{}, {"sessions": ["monday", "tuesday"], "apply": True, "map_frame_id": "site"}]}
    )

    sessions: Annotated[list[Label], Field(min_length=1, max_length=1000)] | None = Field(
        None, description="Only submaps of these sessions."
    )
    per_submap: Annotated[int, Field(ge=1, le=20, strict=True)] = Field(
        10, description="Most constraints from one submap that is looked up."
    )
    changed_only: Annotated[bool, Field(strict=True)] = Field(
        True,
        description="Look up only submaps that are new, or whose landmarks changed, since an earlier job with the same "
        "`gates`, `exclude` and `per_submap` looked them up. With false, all chosen submaps are looked up again.",
    )
    odometry: Annotated[list[OdometryEdge], Field(max_length=100_000)] = Field(
        default_factory=list,
        description="Relative poses for this map alone, besides the odometry that the collection keeps. They are "
        "believed within their covariances, unless several independent matches contradict one of them, or they "
        "contradict each other.",
    )
    use_map_poses: Annotated[bool, Field(strict=True)] = Field(
        False,
        description="Use the map poses of the submaps that have a covariance, such as those of GNSS, as priors. They "
        "must all be in one map frame. Poses that an earlier map wrote are no new evidence: do not use those.",
    )
    agreeing: Annotated[int, Field(ge=1, le=2, strict=True)] = Field(
        2,
        description="Matches that must agree before one is believed. With 1, a match is believed that nothing confirms "
        "and nothing contradicts.",
    )
    association: Literal["joint", "dbscan"] = Field(
        "joint",
        description="How trees of several submaps become one: `joint` moves each submap as a whole, `dbscan` groups "
        "trees within 0.5 m, as in the paper.",
    )
    apply: Annotated[bool, Field(strict=True)] = Field(
        False, description="Write the poses into the submaps, all in one transaction."
    )
    map_frame_id: Label = Field(
        "map",
        description="Map frame of the poses. Parts of the map that nothing connects get frames of their own: the "
        "largest one this name, others this name with `.2`, `.3` and so on. With `use_map_poses`, the part with the "
        "priors is in their frame.",
    )


class PoseMove(Body):
    """A submap and its new pose."""

    id: ResourceId = Field(description="Id of the submap.")
    map_pose: MapPose | None = Field(description="The pose to write; null removes the pose that the submap has.")
    if_match: Annotated[str, Field(min_length=1, max_length=200)] | None = Field(
        None, description="ETag that the submap must have, without quotation marks. Null for any."
    )


class PosesInput(Body):
    """Poses of many submaps, which are all written or none."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"poses": [{"id": "p7", "map_pose": {"frame_id": "site", "x": 1.0, "y": 2.0, "yaw": 0.5}}]}]
        }
    )

    poses: Annotated[list[PoseMove], Field(min_length=1, max_length=20_000)] = Field(
        description="The submaps and their poses; each submap once."
    )
