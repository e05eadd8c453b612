"""What an answer says of one submap: a candidate with its evidence, a rival, a finding; and what a match must pass."""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any

from pydantic import Field, PlainSerializer

from server.schemas.common import Answer, Formerly, write_stamp
from server.schemas.poses import CandidateTransform, MapPoseAnswer, Transform
from urquhart.propose.query import LevelName
from urquhart.report.explanation import SKIPS, STOPS
from urquhart.trace import Skipped, StoppedBy
from urquhart.verify.distortion import WARNINGS


def _words(meanings: Mapping[Any, str]) -> str:
    """Each word with its meaning, as one sentence."""
    return "; ".join(f"`{word}`: {text}" for word, text in meanings.items()) + "."


_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
_ID = (
    "Ids are always strings: a landmark that was sent without an id has its position in the list as text, counted "
    'from 0 ("0", "1", ...).'
)
WARNED = (
    "What is wrong with the coordinates of one side, as stable words; the covariance is widened accordingly. "
    + "; ".join(f"`{word}`: {text}" for word, text in WARNINGS.items() if word != "mirrored")
    + "."
)
"""Description of a candidate's warnings."""


class Inlier(Answer):
    """A landmark of the query on one of the submap."""

    query: str = Field(description=f"Id of the query's landmark. {_ID}")
    submap: str = Field(description=f"Id of the submap's landmark. {_ID}")
    residual: float = Field(description="Distance of the two landmarks under the candidate's transform, in metres.")


_SUPPORT = (
    "How much proposed this pose, in the unit of its `level`: quads or polygons that agree on it, or, for "
    "`exhaustive`, shifts and rotations that stood out. Not comparable between levels."
)
_LEVEL = "What proposed the pose: `quads` or `polygons` that match, or an `exhaustive` trial of rotations and shifts."
_Support = Annotated[int, Formerly("votes")]
_Level = Annotated[LevelName, Formerly(words={"sweep": "exhaustive"})]


class CandidateLinks(Answer):
    """Where to go from a candidate."""

    submap: str = Field(description="Path of the submap.")
    match: str | None = Field(description="Path of the drawing of the match; null when the query is not stored.")


class CandidateAnswer(Answer):
    """A submap that the query may be in, with the evidence."""

    rank: int = Field(description="Position among the candidates, the best is 1.")
    submap_id: str = Field(description="Id of the submap.")
    session: str | None = Field(description="Session of the submap, where it has one.")
    stamp: _Written | None = Field(description="When the submap was observed, where that is known.")
    frame_id: str | None = Field(description="The submap's frame, which `transform` leads to.")
    transform: CandidateTransform = Field(description="submap_T_query: p_submap = R(yaw) p_query + (x, y).")
    map_pose: MapPoseAnswer | None = Field(description="The query's pose in the map, when the submap has one.")
    inliers: list[Inlier] = Field(
        description="Pairs of landmarks that are the same tree. Empty where they are left out: see `inliers_omitted`."
    )
    inlier_count: int = Field(description="How many pairs of landmarks agree, whether or not `inliers` lists them.")
    inliers_omitted: int = Field(
        0,
        description="How many pairs `inliers` leaves out: 0, or all of this candidate's, because the query said "
        "`pairs: false` or better candidates (in a batch, other answers) used up the limit `answer_pairs`.",
    )
    inlier_ratio: float = Field(
        description="Inliers as a share of the landmarks inside the overlap, of the side that has fewer there."
    )
    rms: float = Field(description="Root mean square of the inliers' residuals, in metres.")
    overlap_ratio: Annotated[float, Formerly("overlap")] = Field(
        description="Share of the query's landmarks, 0 to 1, that lie inside the overlap of both footprints."
    )
    support: _Support = Field(description=_SUPPORT)
    level: _Level = Field(description=_LEVEL)
    evidence: float = Field(
        description="Natural logarithm of a likelihood ratio over all landmarks: same place against chance."
    )
    log_odds: float = Field(
        description="`evidence` minus the natural logarithm of how many poses there were to choose from."
    )
    confidence: float = Field(ge=0, le=1, description="Calibrated probability that `transform` is right.")
    refused: str | None = Field(description="Why this candidate alone is not accepted; null when it is.")
    warnings: list[str] = Field(default_factory=list, description=WARNED)
    links: CandidateLinks = Field(description="Where to go from here.")


class RivalLinks(Answer):
    """Where to go from a rival."""

    submap: str = Field(description="Path of the submap.")


class RivalAnswer(Answer):
    """Another pose that explains the data about as well as the first candidate's."""

    submap_id: str = Field(
        description="Id of the submap; often that of the first candidate, with the pose moved to the next row."
    )
    transform: Transform = Field(description="submap_T_query: p_submap = R(yaw) p_query + (x, y).")
    evidence: float = Field(
        description="Natural logarithm of a likelihood ratio over all landmarks: same place against chance."
    )
    inlier_count: int = Field(description="How many pairs of landmarks agree under this pose.")
    links: RivalLinks = Field(description="Where to go from here.")


class FindingAnswer(Answer):
    """What one level found in one submap, before rivals were looked for."""

    level: _Level = Field(description=_LEVEL)
    submap_id: str = Field(description="Id of the submap.")
    support: _Support = Field(description=_SUPPORT)
    inliers: int = Field(description="How many pairs of landmarks agree under this pose.")
    overlap_count: Annotated[int, Formerly("overlap")] = Field(
        description="How many landmarks lie inside the overlap of both footprints, of the side that has more there."
    )
    evidence: float = Field(
        description="Natural logarithm of a likelihood ratio over all landmarks: same place against chance."
    )
    log_odds: float = Field(
        description="`evidence` minus the natural logarithm of how many poses there were to choose from."
    )
    refused: str | None = Field(
        description="Why this finding alone is not accepted; null where only a rival could refuse it."
    )


class Gates(Answer):
    """What a pose must pass to be `matched`, from the collection's configuration.

    Against a rival, the lead must be at least `lead` + `lead_each` * (landmarks of the overlap) + `lead_share` *
    (evidence of the rival).
    """

    confidence: float = Field(description="Least confidence of a match.")
    log_odds: float = Field(description="Least log-odds with which a pose without rivals reaches that confidence.")
    lead: float = Field(description="Least lead in evidence over the best rival: the fixed part of the sum.")
    lead_each: float = Field(
        description="Lead asked for besides, for each landmark of the overlap: `margin` in the collection's `config`."
    )
    lead_share: float = Field(description="Lead asked for besides, as a share of the rival's evidence.")


class SearchAnswer(Answer):
    """How the search ended, and what its limits left out: whether searching longer could have found more."""

    stopped_by: StoppedBy = Field(description=f"Why the search ended, as a stable word. {_words(STOPS)}")
    skipped: list[Skipped] = Field(
        description=f"Limits that left something out, as stable words; empty where nothing was. {_words(SKIPS)}"
    )
    sentence: str = Field(description="The same in words.")


class StageAnswer(Answer):
    """A stage of the method."""

    name: str = Field(description="Name of the stage.")
    milliseconds: float = Field(description="How long it took.")
    counts: dict[str, int] = Field(description="What it made or looked at, by name.")
