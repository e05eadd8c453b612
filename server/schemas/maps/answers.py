"""What came of a map: its poses, constraints and trees."""

from typing import Any, Literal

from pydantic import Field

from server.schemas.common import Answer
from server.schemas.poses import PlacedPose


class MapSubmapPose(Answer):
    """The pose of a submap in the map."""

    id: str = Field(description="Id of the submap.")
    session: str | None = Field(description="Session of the submap. Null if it has none.")
    part: int = Field(description="Number of the part that the submap belongs to, from 1; 1 is the largest one.")
    map_pose: PlacedPose | None = Field(
        description="The pose. Null if nothing connects the submap with others that were chosen."
    )


class MapEdge(Answer):
    """What became of one constraint."""

    id: str | None = Field(
        None,
        description="Id of the constraint if the collection keeps it. Null for priors and odometry of the map.",
    )
    kind: Literal["match", "odometry", "prior"] = Field(description="Where the constraint comes from.")
    from_: str | None = Field(
        alias="from", description="Id of the submap whose frame the constraint is in. Null for a prior."
    )
    to: str = Field(description="Id of the submap whose pose it gives.")
    refused: Literal["contradicted", "unconfirmed", "undecided"] | None = Field(
        description="Why the constraint was left out: other constraints contradict it (`contradicted`), nothing "
        "confirms it (`unconfirmed`), or it is odometry that contradicts other odometry, and nothing tells which of "
        "them is wrong (`undecided`). Null if it was used."
    )
    shift: float | None = Field(
        description="Metres between the constraint and the poses of the map. Null between parts that nothing connects."
    )
    turn: float | None = Field(description="The same for the yaw, in radians, from 0 to pi.")
    distance: float | None = Field(
        description="The same in standard deviations: the Mahalanobis distance. 4 is beyond the gate."
    )
    support: int = Field(description="Number of other constraints that confirm it in short cycles.")


class MapContradiction(Answer):
    """Odometry that other constraints contradict."""

    odometry: list[int] = Field(
        description="Positions in `constraints`, from 0: odometry edges, of which at least one is wrong, or else "
        "`against` is."
    )
    against: list[int] = Field(
        description="Positions in `constraints` of those that contradict them and agree with each other. Empty if the "
        "odometry contradicts itself."
    )
    witnesses: int = Field(
        description="How many ways through the constraints contradict the odometry and have no submap in common."
    )
    distance: float = Field(
        description="How far both sides are apart, in standard deviations: the Mahalanobis distance."
    )
    outcome: Literal["refused", "undecided"] = Field(
        description="`refused`: the odometry was left out. `undecided`: nothing tells which side is wrong, and the "
        "poses are not applied."
    )


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
    first_seen: str | None = Field(description="The earliest stamp of the submaps that have it, in RFC 3339 form.")
    last_seen: str | None = Field(description="The latest stamp of the submaps that have it, in RFC 3339 form.")


class MapSummary(Answer):
    """A map in numbers."""

    submaps: int = Field(description="Number of submaps that were chosen.")
    parts: list[int] = Field(description="Number of submaps of each part of the map, the largest first.")
    constraints: int = Field(description="Number of constraints.")
    contradicted: int = Field(description="Number of constraints left out because others contradict them.")
    unconfirmed: int = Field(description="Number of constraints left out because nothing confirms them.")
    undecided: int = Field(
        description="Number of constraints left out because odometry contradicts itself, and nothing tells where it is "
        "wrong."
    )
    contradictions: int = Field(description="Number of times that constraints contradict odometry.")
    covariance_scale: float = Field(
        description="What the covariances of matches were multiplied with, because their cycles are off by more."
    )
    trees: int = Field(description="Number of trees.")
    noise: float = Field(description="Metres: standard deviation of one coordinate of one observed tree.")


class MapAnswer(Answer):
    """A map that a job built."""

    id: str = Field(description="Id of the map: that of the job that built it.")
    summary: MapSummary = Field(description="The map in numbers.")
    map_version: int | None = Field(
        description="Revision of the collection under which all poses were written. Null if they were not."
    )
    poses: list[MapSubmapPose] = Field(description="The pose of each submap.")
    constraints: list[MapEdge] = Field(description="What became of each constraint.")
    contradictions: list[MapContradiction] = Field(
        description="Odometry that other constraints contradict. While one of them is `undecided`, the poses cannot be "
        "applied."
    )


class PartTrees(Answer):
    """The trees of one part of a map."""

    part: int = Field(description="Number of the part, from 1.")
    frame_id: str = Field(description="Map frame of the positions.")
    trees: list[LandmarkEntry] = Field(description="The trees.")


MAP_EXAMPLE: dict[str, Any] = {
    "id": "0198f3b2c4d57e60",
    "summary": {
        "submaps": 2,
        "parts": [2],
        "constraints": 1,
        "contradicted": 0,
        "unconfirmed": 0,
        "undecided": 0,
        "contradictions": 0,
        "covariance_scale": 1.0,
        "trees": 61,
        "noise": 0.07,
    },
    "map_version": None,
    "poses": [
        {
            "id": "p7",
            "session": "monday",
            "part": 1,
            "map_pose": {
                "frame_id": "map",
                "x": 0.0,
                "y": 0.0,
                "yaw": 0.0,
                "covariance": [0, 0, 0, 0, 0, 0, 0, 0, 0],
                "covariance_frame": "map",
                "about": "submap_origin",
            },
        }
    ],
    "constraints": [
        {
            "id": "12",
            "kind": "match",
            "from": "p7",
            "to": "q3",
            "refused": None,
            "shift": 0.01,
            "turn": 0.0002,
            "distance": 0.6,
            "support": 2,
        }
    ],
    "contradictions": [],
}


class PosesAnswer(Answer):
    """Poses that were written together."""

    map_version: int = Field(description="Revision of the collection under which the poses were written.")
    changed: int = Field(description="Number of submaps whose pose is another one now.")
