"""Bodies of maps: what to build one from, and what came of it."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from server.schemas.common import Answer, Body, DefaultedBody, Label, Metres, ResourceId
from server.schemas.constraints import ConstraintsInput
from server.schemas.poses import CheckedCovariance, PlacedPose, Yaw


class OdometryEdge(Body):
    """A relative pose that a robot measured while it drove: from_T_to. It is believed within its covariance."""

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
    odometry: Annotated[list[OdometryEdge], Field(max_length=100_000)] = Field(
        default_factory=list, description="Relative poses that are believed within their covariances."
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


class MapSubmapPose(Answer):
    """The pose of a submap in the map."""

    id: str = Field(description="Id of the submap.")
    session: str | None = Field(description="Session of the submap. Null if it has none.")
    part: int = Field(description="Number of the part that the submap belongs to, from 1; 1 is the largest one.")
    map_pose: PlacedPose | None = Field(
        description="The pose. Null for a submap that nothing connects with another one."
    )


class MapEdge(Answer):
    """What became of one constraint."""

    kind: Literal["match", "odometry", "prior"] = Field(description="Where the constraint comes from.")
    from_: str | None = Field(
        alias="from", description="Id of the submap whose frame the constraint is in. Null for a prior."
    )
    to: str = Field(description="Id of the submap whose pose it gives.")
    refused: Literal["contradicted", "unconfirmed"] | None = Field(
        description="Why the constraint was left out: other constraints contradict it, or nothing confirms it. Null if "
        "it was used."
    )
    shift: float | None = Field(
        description="Metres between the constraint and the poses of the map. Null between parts that nothing connects."
    )
    turn: float | None = Field(description="The same for the yaw, in radians, from 0 to pi.")
    distance: float | None = Field(
        description="The same in standard deviations: the Mahalanobis distance. 4 is beyond the gate."
    )
    support: int = Field(description="Number of other constraints that confirm it in short cycles.")


class MapTree(Answer):
    """A tree of the map."""

    id: int = Field(description="Number of the tree, from 1.")
    part: int = Field(description="Number of the part of the map that it belongs to.")
    x: float = Field(description="Metres, in the frame of the part.")
    y: float = Field(description="Metres, in the frame of the part.")
    covariance: list[float] = Field(description="Covariance of the position: 2x2, row-major, in square metres.")
    dbh_cm: float | None = Field(description="Median of the diameters at breast height, in centimetres.")
    height_m: float | None = Field(description="Median of the heights, in metres.")
    observed: int = Field(description="Number of submaps that have the tree.")
    missed: int = Field(description="Number of submaps that have other trees all around it, but not this one.")
    first_seen: str | None = Field(description="The earliest stamp of those that have it, in RFC 3339 form.")
    last_seen: str | None = Field(description="The latest stamp.")


class MapSummary(DefaultedBody):
    """A map in numbers."""

    submaps: int = Field(description="Number of submaps that were chosen.")
    parts: list[int] = Field(description="Number of submaps of each part of the map, the largest first.")
    constraints: int = Field(description="Number of constraints.")
    contradicted: int = Field(description="Number of constraints left out because others contradict them.")
    unconfirmed: int = Field(description="Number of constraints left out because nothing confirms them.")
    covariance_scale: float = Field(
        description="What the covariances of matches were multiplied with, because their cycles are off by more."
    )
    trees: int = Field(description="Number of trees.")
    noise: float = Field(description="Metres: standard deviation of one coordinate of one observed tree.")


Document = dict[str, Any]
