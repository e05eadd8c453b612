"""What came of a map: its poses, constraints and trees."""

from typing import Literal

from pydantic import Field

from server.schemas.common import Answer
from server.schemas.poses import PlacedPose


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


class LandmarkEntry(Answer):
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


class MapSummary(Answer):
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
