"""Bodies of the query routes."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainSerializer, model_validator
from pydantic_core import PydanticCustomError

from server.schemas.common import (
    Answer,
    Body,
    Label,
    Metres,
    Point,
    PoseWithCovariance,
    ResourceId,
    Stamp,
    Transform,
    write_stamp,
)
from server.schemas.submaps import LandmarkBody
from urquhart import Method, Verdict
from urquhart.explaining import REASONS
from urquhart.proposing import Level

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
_REASON = (
    "Why this verdict, as a stable word. " + "; ".join(f"`{word}`: {text}" for word, text in REASONS.items()) + "."
)
FINDINGS = 64
"""Most findings in an answer: the default configuration makes no more."""
_XY: Any = [[0.4, 2.9], [5.1, -1.7], [-2.6, 1.3], [1.8, -6.0], [-6.2, -3.8], [7.0, 5.9]]
_DBH: Any = [0.31, 0.22, 0.45, 0.28, 0.19, 0.37]


class Exclude(Body):
    """What must not be found."""

    submap_ids: Annotated[list[ResourceId], Field(fail_fast=True)] = Field(
        default_factory=list, description="Submaps to leave out; ids that are not there are passed over."
    )
    session: Label | None = Field(
        None, description="Leave out the submaps of this session; with `within_seconds` only those."
    )
    within_seconds: Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)] | None = Field(
        None,
        description="Leave out submaps with a stamp at most so many seconds from the query's, which must have one.",
    )


class Near(Body):
    """About where in a map the query is: only submaps that come near there are searched."""

    frame_id: Label = Field("map", description="The map's frame, as in `map_pose`.")
    x: Metres = Field(description="Metres, as in `map_pose`.")
    y: Metres = Field(description="Metres, as in `map_pose`.")
    radius: Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)] = Field(
        description="Metres: a submap's footprint must come as near as this along either axis."
    )


class QueryOptions(Body):
    """How to look, and for how many."""

    limit: Annotated[int, Field(ge=1, strict=True)] = Field(5, description="Most candidates to return.")
    method: Method = Field("robust", description="`paper` keeps to the published method.")
    seed: Annotated[int, Field(ge=0, le=2**63 - 1, strict=True)] | None = Field(
        None, description="Same seed, revision and body: same answer."
    )
    explain: Annotated[bool, Field(strict=True)] = Field(
        False, description="Answer what each level found in each submap, too."
    )
    per_session: Annotated[bool, Field(strict=True)] = Field(
        False, description="Who has been here, and when: the best candidate of every session, each matched by itself."
    )
    near: Near | None = Field(None, description="About where it was observed, if that is known.")
    exclude: Exclude = Field(default_factory=Exclude, description="What must not be found.")


class QueryInput(LandmarkBody, QueryOptions):
    """An observation to place, or a stored submap to find again elsewhere."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"xy": _XY, "limit": 5},
                {
                    "landmarks": [{"x": x, "y": y, "dbh": d} for (x, y), d in zip(_XY, _DBH, strict=True)],
                    "explain": True,
                },
                {
                    "xy": _XY,
                    "stamp": "2026-05-04T10:00:00Z",
                    "near": {"x": 120.0, "y": -40.0, "radius": 50.0},
                    "exclude": {"session": "monday", "within_seconds": 60.0},
                },
                {"submap_id": "p7", "exclude": {"submap_ids": ["p6", "p8"]}, "store": True, "seed": 1},
            ]
        }
    )

    submap_id: ResourceId | None = Field(
        None, description="Ask with a stored submap's landmarks; it is left out of the search."
    )
    store: Annotated[bool, Field(strict=True)] = Field(
        False, description="Keep the answer, to be read and drawn later."
    )
    frame_id: Label | None = Field(None, description="Name of the frame that the landmarks are in.")
    stamp: Stamp | None = Field(None, description="When it was observed: RFC 3339 with an offset.")

    @model_validator(mode="after")
    def _one_source(self) -> "QueryInput":
        sources = (self.xy, self.landmarks, self.submap_id)
        if all(source is None for source in sources):
            raise PydanticCustomError("no_landmarks", "give the trees as `xy` or `landmarks`, or a `submap_id`")
        if self.submap_id is not None and (self.xy is not None or self.landmarks is not None):
            raise PydanticCustomError("two_sources", "give either landmarks or a `submap_id`, not both")
        return self


class Inlier(Answer):
    """A landmark of the query on one of the submap."""

    query: str = Field(description="Landmark id in the query.")
    submap: str = Field(description="Landmark id in the submap.")
    residual: float = Field(description="Metres.")


class MapPoseAnswer(PoseWithCovariance):
    """Pose of the query's frame in the map that the submap is placed in."""

    frame_id: str


class CandidateLinks(Answer):
    """Where to go from a candidate."""

    submap: str
    match: str | None = Field(description="Drawing of the match; null when the query is not stored.")


class CandidateAnswer(Answer):
    """A submap that the query may be in, with the evidence."""

    rank: int
    submap_id: str
    session: str | None
    stamp: _Written | None
    frame_id: str | None = Field(description="Of the submap: the frame that `transform` leads to.")
    transform: PoseWithCovariance = Field(description="submap_T_query: p_submap = R(yaw) p_query + (x, y).")
    map_pose: MapPoseAnswer | None = Field(description="The query's pose in the map, when the submap has one.")
    inliers: list[Inlier]
    inlier_count: int
    inlier_ratio: float = Field(description="Inliers over the landmarks inside the overlap, of the smaller side.")
    rms: float = Field(description="Of the inliers' residuals, metres.")
    overlap: float = Field(description="Share of the query's landmarks inside the overlap.")
    votes: int = Field(description="Features that voted for the submap.")
    level: Level = Field(description="Which features proposed the transform.")
    evidence: float = Field(description="Log-likelihood ratio over all landmarks, same place against chance.")
    log_odds: float = Field(description="Evidence less the natural log of how many poses there were to choose from.")
    confidence: float = Field(ge=0, le=1)
    refused: str | None = Field(description="Why this candidate alone is not accepted; null when it is.")
    links: CandidateLinks


class RivalLinks(Answer):
    """Where to go from a rival."""

    submap: str


class RivalAnswer(Answer):
    """Another pose that explains the data about as well as the first candidate's."""

    submap_id: str = Field(description="Often the candidate's own: the next row of a plantation, say.")
    transform: Transform = Field(description="submap_T_query.")
    evidence: float = Field(description="As a candidate's.")
    inlier_count: int
    links: RivalLinks


class FindingAnswer(Answer):
    """What one level found in one submap, before rivals were looked for."""

    level: Level = Field(description="Which features proposed the pose.")
    submap_id: str
    votes: int = Field(description="Features that voted for the submap.")
    inliers: int
    overlap: int = Field(description="Landmarks that could have been inliers, of the side with more of them.")
    evidence: float = Field(description="As a candidate's.")
    log_odds: float = Field(description="As a candidate's.")
    refused: str | None = Field(description="Why this alone is not accepted; null where only a rival could refuse it.")


class Gates(Answer):
    """What a pose must pass to be `matched`, of the collection's configuration."""

    confidence: float = Field(description="The least.")
    log_odds: float = Field(description="The least that reach it where nothing rivals the pose.")
    lead: float = Field(description="The least lead over the best rival that reaches it,")
    lead_each: float = Field(description="and as much more for each landmark of the overlap,")
    lead_share: float = Field(description="and such a share of the rival's evidence.")


class StageAnswer(Answer):
    """A stage of the method."""

    name: str
    milliseconds: float
    counts: dict[str, int]


class QueryLinks(Answer):
    """Where to go from an answer."""

    self: str | None
    collection: str
    explanation: str | None = Field(description="Why the answer is what it is; null when the query is not stored.")


class QueryAnswer(Answer):
    """Outcome before pose: act on `verdict`, never on a candidate alone."""

    id: str | None = Field(description="Of the stored query; null when it was not stored.")
    collection: str
    verdict: Verdict
    reason: str = Field(description=_REASON)
    frame_id: str | None = Field(description="Of the query.")
    stamp: _Written | None
    method: Method
    revision: int = Field(description="Of the collection that was searched.")
    landmarks: int = Field(description="How many the query has.")
    margin: float | None = Field(
        description="Evidence of the best pose over the best distinct one; null where it was too weak to compare."
    )
    gates: Gates
    candidates: list[CandidateAnswer] = Field(description="Best first.")
    rivals: list[RivalAnswer] = Field(
        description="Other poses that explain the data about as well as the first candidate's, the strongest first."
    )
    stages: list[StageAnswer]
    findings: list[FindingAnswer] | None = Field(
        description="By level, the best first; null unless asked with `explain`. Stored answers keep them."
    )
    findings_total: int | None = Field(
        description=f"How many there were: the {FINDINGS} with the best log-odds are answered."
    )
    links: QueryLinks


class MatchAnswer(Answer):
    """A candidate of a stored query with the landmarks of both sides."""

    query: str
    candidate: CandidateAnswer
    query_landmarks: list[Point] = Field(description="Metres, query frame.")
    submap_landmarks: list[Point] = Field(description="Metres, submap frame.")


class ExplanationLinks(Answer):
    """Where to go from an explanation."""

    self: str
    query: str


class ExplanationAnswer(Answer):
    """Why a stored answer is what it is."""

    query: str
    collection: str
    verdict: Verdict
    reason: str = Field(description=_REASON)
    margin: float | None = Field(description="As in the answer.")
    gates: Gates
    stages: list[StageAnswer]
    findings: list[FindingAnswer] | None = Field(
        description="By level, the best first; null for an answer stored by a version that kept none."
    )
    findings_total: int | None = Field(description="How many there were.")
    rivals: list[RivalAnswer] = Field(description="The strongest first.")
    sentences: dict[str, str] = Field(description="What each reason in this explanation means.")
    links: ExplanationLinks
