"""Bodies of the query routes: single queries, batches, stored answers and explanations."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, PlainSerializer, model_validator
from pydantic_core import PydanticCustomError

from server.schemas.candidates import (
    HINTED,
    CandidateAnswer,
    FindingAnswer,
    GatesAnswer,
    HintAnswer,
    RivalAnswer,
    SearchAnswer,
    StageAnswer,
    glossed,
)
from server.schemas.common import (
    FRAME_NAME,
    RENAMED_REASONS,
    STAMPED,
    Answer,
    Body,
    DefaultedBody,
    Formerly,
    Label,
    Point,
    ResourceId,
    Stamp,
    write_stamp,
)
from server.schemas.examples import QUERY_INPUTS
from server.schemas.maps.keyframes import KeyframedBody
from server.schemas.poses import Near, PriorPose
from urquhart import Effort, Method, Verdict
from urquhart.options import EFFORTS
from urquhart.report.explanation import REASONS
from urquhart.verify.distortion import WARNINGS

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
_REASON = f"Why this verdict, as a stable word. {glossed(REASONS)}"
FINDINGS = 64
"""Most findings in an answer. The default configuration produces no more."""


class Exclude(DefaultedBody):
    """Submaps to leave out of the search: those of `submap_ids`, and those for which all other given members hold.

    `{"session": "mine", "within_seconds": 60}` leaves out the last minute of the session `mine`, and no other submaps.
    """

    submap_ids: Annotated[list[ResourceId], Field(fail_fast=True)] = Field(
        default_factory=list, description="Ids of submaps to leave out. Unknown ids are ignored."
    )
    session: Label | None = Field(
        None,
        description="Leave out the submaps of this session. With `within_seconds`, only those that are also that close "
        "in time.",
    )
    within_seconds: Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)] | None = Field(
        None,
        description="Leave out submaps whose stamp differs from the query's by at most this many seconds. The query "
        "must have a `stamp`. With `session`, only submaps of that session.",
    )


class QueryOptions(DefaultedBody):
    """Where to search, how, and what to return."""

    limit: Annotated[int, Field(ge=1, strict=True)] = Field(5, description="Most candidates to return.")
    method: Method = Field("robust", description="`robust`: the method of this service; `paper`: the published one.")
    effort: Effort = Field("full", description=f"How far to search if nothing is found. {glossed(EFFORTS)}")
    min_confidence: Annotated[float, Field(gt=0.5, lt=1.0, strict=True)] | None = Field(
        None,
        description="Least `confidence` that is `matched`. By default that of the collection: 0.998993 if unchanged.",
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1, strict=True)] | None = Field(
        None, description="Seed of random choices. The same seed, body and revision give the same answer."
    )
    explain: Annotated[bool, Field(strict=True)] = Field(
        False,
        description="Whether to add what each level of the search found in each submap (`findings`), and what the "
        "reasons mean (`sentences`).",
    )
    pairs: Annotated[bool, Field(strict=True)] = Field(
        True,
        description="Whether to list the landmark pairs of each candidate in `inliers`. Without them the answer is "
        "much smaller; verdict, poses and `inlier_count` are the same.",
    )
    pair_format: Literal["objects", "columns"] = Field(
        "objects",
        description="How the pairs are listed: as `objects` with ids in `inliers`, or as `columns` of positions in "
        "`inlier_columns`, which take a quarter of the bytes. Stored answers list objects, so `columns` does not go "
        "with `store`.",
    )
    per_session: Annotated[bool, Field(strict=True)] = Field(
        False,
        description="Whether to return the best candidate of every session, to learn who was here and when. Each is "
        "matched by itself.",
    )
    timeout_ms: Annotated[int, Field(ge=1, le=3_600_000, strict=True)] | None = Field(
        None,
        description="Milliseconds within which you need the answer, counted from when the whole request has arrived. "
        "The limit `query_seconds` is the maximum and the default. At the deadline the answer is `no_match` with the "
        "reason `deadline` and the candidates found so far.",
    )
    near: Near | None = Field(
        None, description="Roughly where the trees were observed, if you know. Only submaps near there are searched."
    )
    prior: PriorPose | None = Field(
        None,
        description="The rough pose of the query, if you know it, such as that of a GNSS receiver. Then every pose "
        "whose position (in the ellipse of the covariance) and whose heading are each within 3.5 standard deviations "
        "is tried, in all submaps there together, and none outside; jointly that may be up to 4.9. Less evidence is "
        "enough than in the whole collection, and trees may be off by up to 1 m, as tree tops are. Needs the method "
        "`robust`; `effort` and `limit` do not matter.",
    )
    exclude: Exclude = Field(default_factory=Exclude, description="Submaps to leave out of the search.")


class QueryInput(KeyframedBody, QueryOptions):
    """Trees that were observed, or the id of a stored submap, to be found among the stored submaps."""

    model_config = ConfigDict(json_schema_extra={"examples": QUERY_INPUTS})

    submap_id: ResourceId | None = Field(
        None,
        description="Id of a stored submap whose landmarks to search for, instead of `xy` or `landmarks`. The submap "
        "itself is left out of the search.",
    )
    store: Annotated[bool, Field(strict=True)] = Field(
        False, description="Whether to store the answer, so that it can be read, drawn and explained later."
    )
    frame_id: Label | None = Field(None, description=FRAME_NAME)
    stamp: Stamp | None = Field(None, description=STAMPED)

    @model_validator(mode="after")
    def _one_source(self) -> "QueryInput":
        sources = (self.xy, self.landmarks, self.keyframes, self.submap_id)
        if all(source is None for source in sources):
            raise PydanticCustomError(
                "no_landmarks", "give the trees as `xy`, `landmarks` or `keyframes`, or a `submap_id`"
            )
        if self.submap_id is not None and any(source is not None for source in sources[:3]):
            raise PydanticCustomError("two_sources", "give either landmarks or a `submap_id`, not both")
        if self.store and self.pair_format != "objects":
            raise PydanticCustomError(
                "stored_columns", "a stored answer lists its pairs as objects: leave out `pair_format`, or `store`"
            )
        return self


class QueryLinks(Answer):
    """Paths that belong to an answer."""

    self: str | None = Field(description="Path of the stored answer. Null if the query is not stored.")
    collection: str = Field(description="Path of the collection.")
    explanation: str | None = Field(
        description="Path of the explanation of the answer. Null if the query is not stored."
    )


_VERDICT = "The outcome. Decide by it: `matched`, `ambiguous` or `no_match`."
_LEAD = (
    "Evidence of the best pose minus that of its strongest rival. Null if no other pose was strong enough to compare."
)
_GATES = "What a pose had to pass to be `matched`."
_RIVALS = "Other poses that explain so many of the trees that they are not ruled out, strongest first."
_SEARCH = "Why the search ended and what its limits left out. Null in answers that an older version stored."
_STAGES = "What each stage of the search did, in order."


class QueryAnswer(Answer):
    """Where the trees were seen. Decide by `verdict`, not by the pose of a candidate."""

    id: str | None = Field(description="Id of the stored query. Null if it is not stored.")
    collection: str = Field(description="Id of the collection.")
    verdict: Verdict = Field(description=_VERDICT)
    reason: Annotated[str, RENAMED_REASONS] = Field(description=_REASON)
    frame_id: str | None = Field(description="Name of the query's frame, as it was sent.")
    stamp: _Written | None = Field(description="When the query's trees were observed, as it was sent.")
    method: Method = Field(description="The method that was asked for.")
    effort: Effort = Field("full", description="The effort that was asked for.")
    revision: int = Field(description="Revision of the collection that was searched.")
    landmark_count: Annotated[int, Formerly("landmarks")] = Field(description="Number of landmarks in the query.")
    lead: Annotated[float | None, Formerly("margin")] = Field(description=_LEAD)
    warnings: list[str] = Field(
        default_factory=list,
        description="What is wrong with the query as a whole, as stable words. Always empty without `explain`. "
        f"`mirrored`: {WARNINGS['mirrored']}.",
    )
    hints: list[HintAnswer] = Field(default_factory=list, description=HINTED)
    gates: GatesAnswer = Field(description=_GATES)
    candidates: list[CandidateAnswer] = Field(description="Submaps that may be the query's place, best first.")
    rivals: list[RivalAnswer] = Field(description=_RIVALS)
    search: SearchAnswer | None = Field(None, description=_SEARCH)
    stages: list[StageAnswer] = Field(description=_STAGES)
    findings: list[FindingAnswer] | None = Field(
        description="What each level of the search found, level by level, best first. Null without `explain`."
    )
    findings_total: int | None = Field(
        description=f"Number of findings, of which `findings` lists the {FINDINGS} with the best log-odds. Null "
        "without `explain`."
    )
    sentences: dict[str, str] | None = Field(
        None,
        description="The meaning of each reason, `refused` and warning in this answer, by its word. Null without "
        "`explain`.",
    )
    links: QueryLinks = Field(description="Paths that belong to the answer.")


class MatchAnswer(Answer):
    """A candidate of a stored query, with the landmarks of both sides."""

    query_id: str = Field(description="Id of the stored query.")
    candidate: CandidateAnswer = Field(description="The candidate, as in the answer.")
    query_landmarks: list[Point] = Field(
        description="Positions of the query's landmarks as [x, y], in metres, in the query's frame."
    )
    submap_landmarks: list[Point] = Field(
        description="Positions of the submap's landmarks as [x, y], in metres, in the submap's frame."
    )
    query_ids: list[str] = Field(description="Ids of the query's landmarks, in the order of `query_landmarks`.")
    submap_ids: list[str] = Field(description="Ids of the submap's landmarks, in the order of `submap_landmarks`.")


class ExplanationLinks(Answer):
    """Paths that belong to an explanation."""

    self: str = Field(description="Path of this explanation.")
    query: str = Field(description="Path of the stored answer.")


class ExplanationAnswer(Answer):
    """Why a stored answer has its verdict."""

    query_id: str = Field(description="Id of the stored query.")
    collection: str = Field(description="Id of the collection.")
    verdict: Verdict = Field(description=_VERDICT)
    reason: Annotated[str, RENAMED_REASONS] = Field(description=_REASON)
    lead: float | None = Field(description=_LEAD)
    gates: GatesAnswer = Field(description=_GATES)
    search: SearchAnswer | None = Field(None, description=_SEARCH)
    stages: list[StageAnswer] = Field(description=_STAGES)
    findings: list[FindingAnswer] | None = Field(
        description="What each level of the search found, level by level, best first. Null if an older version stored "
        "the answer without findings."
    )
    findings_total: int | None = Field(
        description="Number of findings, of which `findings` lists the strongest. Null if `findings` is null."
    )
    rivals: list[RivalAnswer] = Field(description=_RIVALS)
    sentences: dict[str, str] = Field(
        description="The meaning of each reason, `refused` and warning in this explanation, by its word."
    )
    links: ExplanationLinks = Field(description="Paths that belong to the explanation.")


class BatchInput(Body):
    """Several queries in one request."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"queries": [QUERY_INPUTS[0], {"submap_id": "p7"}]}]})

    # Each is validated by itself, so that an invalid query does not affect the others.
    queries: list[dict[str, Any]] = Field(
        min_length=1, description="The queries, each with the members of a `QueryInput`."
    )
    timeout_ms: Annotated[int, Field(ge=1, le=3_600_000, strict=True)] | None = Field(
        None,
        description="Milliseconds within which you need the whole batch. The limit `batch_seconds` is the maximum and "
        "the default. A query that has not begun by then gets the problem `deadline-exceeded`.",
    )


class BatchProblem(Answer):
    """The result of a query that failed."""

    problem: dict[str, Any] = Field(
        description="The problem document that the query alone would have been answered with."
    )


class BatchAnswer(Answer):
    """The results of a batch."""

    results: list[QueryAnswer | BatchProblem] = Field(
        description="An answer or a problem for each query, in the order of the queries."
    )
