"""Bodies of the constraints that a collection keeps."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from server.schemas.common import NEXT, Answer, Body
from server.schemas.constraints import ConstraintTransform
from server.schemas.maps.request import OdometryEdge

StoredFormat = Literal["ndjson", "json", "g2o", "g2o_middle", "matrices", "tum", "kitti"]

KeptKind = Literal["match", "odometry"]
KeptState = Literal["active", "stale", "refused"]


class OdometryInput(Body):
    """Relative poses that a robot measured, which are all stored or none."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "edges": [
                        {
                            "from": "p7",
                            "to": "q3",
                            "x": 4.1,
                            "y": 0.2,
                            "yaw": 0.05,
                            "covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, 1e-4],
                        }
                    ]
                }
            ]
        }
    )

    edges: Annotated[list[OdometryEdge], Field(min_length=1, max_length=20_000)] = Field(
        description="The relative poses. One that is stored between the same two submaps, in either direction, is "
        "replaced."
    )


class OdometryReceipt(Answer):
    """Relative poses that were stored."""

    stored: int = Field(description="Number of relative poses that were sent and are stored now.")


class KeptConstraint(Answer):
    """A constraint that the collection keeps: from_T_to takes points of `to` into the frame of `from`."""

    id: str = Field(description="Id of the constraint in its collection. It is not given out again.")
    kind: KeptKind = Field(description="Whether a search found it, or a robot measured it while it drove.")
    source: Literal["job", "posted"] = Field(description="Whether a job found it, or a client posted it.")
    job: str | None = Field(description="Id of the job that found it. Null if it was posted, or if a command found it.")
    state: KeptState = Field(
        description="`stale`: a submap was deleted or has other landmarks since; a job finds the constraint again. "
        "`refused`: the last map that used it left it out. Maps use `active` and `refused` ones, and judge each again."
    )
    refused: Literal["contradicted", "unconfirmed", "undecided"] | None = Field(
        description="Why the last map left it out. Null if it did not, or no map used it."
    )
    refused_by: str | None = Field(description="Id of that map.")
    from_: str = Field(alias="from", description="Id of the submap whose frame the transform takes points to.")
    to: str = Field(description="Id of the submap whose points the transform takes.")
    from_revision: int = Field(
        description="Revision of the collection at which the landmarks of `from` were stored that the constraint is of."
    )
    to_revision: int = Field(description="The same for `to`.")
    transform: ConstraintTransform = Field(description="from_T_to: p_from = R(yaw) p_to + (x, y).")
    information: list[float] = Field(
        description="Information matrix of the edge, as pose graphs use it: 3x3, row-major over (x, y, yaw), of the "
        "error log(measured^-1 true), about the origin of the frame of `to`, along the axes of that frame."
    )
    information_frame: Literal["to"] = Field("to", description="Axes of `information`.")
    rank: int | None = Field(None, description="Rank of the match in its search. Null for odometry.")
    inlier_count: int | None = Field(None, description="Number of pairs of landmarks that agree. Null for odometry.")
    rms: float | None = Field(
        None, description="Root mean square of the inliers' residuals, in metres. Null for odometry."
    )
    confidence: float | None = Field(
        None, description="Calibrated probability that `transform` is right. Null for odometry."
    )
    created: str = Field(description="When it was stored, in RFC 3339 form.")


class ConstraintPage(Answer):
    """Constraints in the order they were stored."""

    constraints: list[KeptConstraint] = Field(description="The constraints.")
    next: str | None = Field(None, description=NEXT)


KEPT_EXAMPLE: dict[str, Any] = {
    "id": "12",
    "kind": "odometry",
    "source": "posted",
    "job": None,
    "state": "active",
    "refused": None,
    "refused_by": None,
    "from": "p7",
    "to": "q3",
    "from_revision": 7,
    "to_revision": 12,
    "transform": {
        "x": 4.1,
        "y": 0.2,
        "yaw": 0.05,
        "covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, 1e-4],
        "covariance_frame": "from",
        "about": "to_origin",
        "middle": {
            "source": [0.0, 0.0],
            "target": [4.1, 0.2],
            "covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, 1e-4],
            "information": [100, 0, 0, 0, 100, 0, 0, 0, 1e4],
        },
    },
    "information": [100, 0, 0, 0, 100, 0, 0, 0, 1e4],
    "information_frame": "to",
    "rank": None,
    "inlier_count": None,
    "rms": None,
    "confidence": None,
    "created": "2026-05-04T09:00:00Z",
}
