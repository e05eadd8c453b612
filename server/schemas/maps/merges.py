"""Bodies of merges: one map frame laid onto another."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from server.schemas.common import Answer, DefaultedBody, Label
from server.schemas.constraints import ConstraintGates
from server.schemas.poses import PoseWithCovariance, TreesMiddle


class MergeInput(DefaultedBody):
    """Which map frame is laid onto which, by which matches, and whether its submaps move."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"from": "robot2", "to": "robot1", "apply": True}]})

    from_: Label = Field(alias="from", description="The map frame that is laid onto the other one.")
    to: Label = Field(description="The map frame that stays.")
    gates: ConstraintGates = Field(
        default_factory=ConstraintGates, description="What an accepted match must also pass to count."
    )
    per_submap: Annotated[int, Field(ge=1, le=20, strict=True)] = Field(
        20, description="Most matches of one submap of `from`, those in its own frame included."
    )
    changed_only: Annotated[bool, Field(strict=True)] = Field(
        True,
        description="Look up only submaps of `from` that are new, or whose landmarks changed, since an earlier job "
        "with the same `gates` and `per_submap` looked them up.",
    )
    apply: Annotated[bool, Field(strict=True)] = Field(
        False, description="Write the poses of all submaps of `from` in the frame `to`, in one transaction."
    )


class MergeTransform(PoseWithCovariance):
    """to_T_from: p_to = R(yaw) p_from + (x, y)."""

    covariance_frame: Literal["to"] = Field("to", description="Axes of `covariance`: those of the frame `to`.")
    about: Literal["from_origin"] = Field(
        "from_origin", description="The point that `covariance` is about: the origin of the frame `from`."
    )
    middle: TreesMiddle = Field(description="The uncertainty about the middle of the trees of all matches.")


class MergePair(Answer):
    """A match between a submap of each frame."""

    id: str = Field(description="Id of the constraint that the collection keeps.")
    from_submap: str = Field(description="Id of the submap that has a pose in the frame `from`.")
    to_submap: str = Field(description="Id of the submap that has a pose in the frame `to`.")
    refused: Literal["contradicted", "unconfirmed"] | None = Field(
        description="Why the match was left out: it disagrees with the pose that most agree on (`contradicted`), or "
        "too few agree to say (`unconfirmed`). Null if it was used."
    )
    shift: float = Field(description="Metres between the match and the pose that most agree on, amid the trees.")
    turn: float = Field(description="The same for the yaw, in radians, from 0 to pi.")
    distance: float = Field(description="The same in standard deviations: the Mahalanobis distance.")


class MergeSummary(Answer):
    """How two map frames lie to each other."""

    from_: str = Field(alias="from", description="The map frame that is laid onto the other one.")
    to: str = Field(description="The map frame that stays.")
    verdict: Literal["joined", "undecided", "unconnected"] = Field(
        description="`joined`: `transform` may be used. `undecided`: more than half as many matches agree on "
        "another pose. `unconnected`: fewer than 4 matches without a common submap agree."
    )
    transform: MergeTransform | None = Field(
        description="to_T_from, the pose of the frame `from` in the frame `to`. Null unless `joined`."
    )
    agreeing: int = Field(description="Matches that agree and have no submap in common.")
    used: int = Field(description="Matches that agree.")
    refused: int = Field(description="Matches that were left out.")
    submaps: int = Field(description="Submaps that have a pose in the frame `from`.")


class MergeAnswer(Answer):
    """A merge that a job computed."""

    id: str = Field(description="Id of the merge: that of its job.")
    summary: MergeSummary = Field(description="How the two frames lie to each other.")
    map_version: int | None = Field(
        description="Revision of the collection under which the submaps moved. Null if they did not."
    )
    pairs: list[MergePair] = Field(description="What became of each match between the frames.")


_ABOUT = [0.001, 0, 0, 0, 0.001, 0, 0, 0, 1e-6]
MERGE_EXAMPLE: dict[str, Any] = {
    "id": "0198f3b2c4d57e61",
    "summary": {
        "from": "robot2",
        "to": "robot1",
        "verdict": "joined",
        "transform": {
            "x": 12.1,
            "y": -3.4,
            "yaw": 1.2,
            "covariance": _ABOUT,
            "covariance_frame": "to",
            "about": "from_origin",
            "middle": {
                "source": [0.0, 0.0],
                "target": [12.1, -3.4],
                "covariance": _ABOUT,
                "information": [1000, 0, 0, 0, 1000, 0, 0, 0, 1e6],
            },
        },
        "agreeing": 5,
        "used": 9,
        "refused": 1,
        "submaps": 40,
    },
    "map_version": 813,
    "pairs": [
        {
            "id": "12",
            "from_submap": "q3",
            "to_submap": "p7",
            "refused": None,
            "shift": 0.04,
            "turn": 0.001,
            "distance": 0.9,
        }
    ],
}
