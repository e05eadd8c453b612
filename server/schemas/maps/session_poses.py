"""The poses of a session while its robot drives."""

from typing import Any, Final, Literal

from pydantic import Field

from server.schemas.common import Answer


class SessionPart(Answer):
    """Submaps of a session that constraints connect."""

    part: int = Field(description="Number of the part, from 1; 1 is the largest one.")
    submaps: int = Field(description="Number of its submaps.")
    frame_of: str = Field(description="Id of the submap whose frame its poses are in: the one that it began with.")


class SessionPose(Answer):
    """A pose in the frame of its part."""

    x: float = Field(description="Position of the submap's origin along the frame's x axis, in metres.")
    y: float = Field(description="The same along the frame's y axis, in metres.")
    yaw: float = Field(description="Radians, counter-clockwise, from -pi to pi.")
    covariance: list[float] = Field(
        description="Covariance of the position of the submap's origin, along the axes of the frame, and of the yaw: "
        "3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. All 0 for the submap "
        "whose frame it is."
    )


class SessionSubmap(Answer):
    """A submap of the session and its pose now."""

    id: str = Field(description="Id of the submap.")
    content_revision: int = Field(description="Revision of the collection when its landmarks were stored.")
    part: int = Field(description="Number of the part that it belongs to.")
    pose: SessionPose = Field(description="`part_T_submap`: its pose in the frame of the part.")


class SessionConstraint(Answer):
    """A constraint of the session, and whether the poses use it."""

    id: str = Field(description="Id of the constraint.")
    kind: Literal["match", "odometry"] = Field(description="A match that a search found, or posted odometry.")
    from_: str = Field(alias="from", description="Id of the submap whose frame the constraint is in.")
    to: str = Field(description="Id of the other submap.")
    standing: Literal["used", "pending", "contradicted", "unconfirmed", "undecided"] = Field(
        description="`used` by the poses; `pending` until the next search of all constraints; or left out as in a map: "
        "`contradicted` by others, `unconfirmed` by any, `undecided` odometry that contradicts other odometry."
    )


class SessionPosesAnswer(Answer):
    """The poses of a session now."""

    session: str = Field(description="The session.")
    revision: int = Field(description="Revision of the collection that the answer is of.")
    settled: bool = Field(
        description="Whether all constraints are judged. If false, a search of all of them runs or will run in the "
        "background; until it ends, the poses use what could be judged without it."
    )
    parts: list[SessionPart] = Field(description="Parts that no constraint connects, the largest first.")
    poses: list[SessionSubmap] = Field(description="The submaps, in the order they were stored.")
    constraints: list[SessionConstraint] = Field(
        description="The constraints between submaps of the session, in the order they were stored. Stale ones, and "
        "matches of searches with other gates, are left out."
    )


POSES_EXAMPLE: Final[dict[str, Any]] = {
    "session": "monday",
    "revision": 812,
    "settled": True,
    "parts": [{"part": 1, "submaps": 2, "frame_of": "mon-1"}],
    "poses": [
        {
            "id": "mon-1",
            "content_revision": 700,
            "part": 1,
            "pose": {"x": 0.0, "y": 0.0, "yaw": 0.0, "covariance": [0.0] * 9},
        },
        {
            "id": "mon-2",
            "content_revision": 705,
            "part": 1,
            "pose": {
                "x": 11.9,
                "y": 0.3,
                "yaw": 0.02,
                "covariance": [0.0025, 0.0, 0.0, 0.0, 0.0025, 0.0, 0.0, 0.0, 1e-05],
            },
        },
    ],
    "constraints": [{"id": "12", "kind": "odometry", "from": "mon-1", "to": "mon-2", "standing": "used"}],
}
