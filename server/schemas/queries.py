"""Bodies of the query routes, also of several queries at once."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainSerializer, model_validator
from pydantic_core import PydanticCustomError

from server.schemas.candidates import CandidateAnswer, FindingAnswer, Gates, RivalAnswer, SearchAnswer, StageAnswer
from server.schemas.common import (
    STAMPED,
    Answer,
    Body,
    Formerly,
    Label,
    Metres,
    Point,
    ResourceId,
    Stamp,
    write_stamp,
)
from server.schemas.landmarks import LandmarkBody
from urquhart import Method, Verdict
from urquhart.report.explanation import REASONS
from urquhart.verify.distortion import WARNINGS

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
_REASON = (
    "Why this verdict, as a stable word. " + "; ".join(f"`{word}`: {text}" for word, text in REASONS.items()) + "."
)
FINDINGS = 64
"""Most findings in an answer: the default configuration makes no more."""
_XY: Any = [[0.4, 2.9], [5.1, -1.7], [-2.6, 1.3], [1.8, -6.0], [-6.2, -3.8], [7.0, 5.9]]
_DBH: Any = [0.31, 0.22, 0.45, 0.28, 0.19, 0.37]


class Exclude(Body):
    """What must not be found: the submaps of `submap_ids`, and those for which `session` and `within_seconds` hold.

    `{"session": "mine", "within_seconds": 60}` leaves out the last minute of that session and nothing of others.
    """

    submap_ids: Annotated[list[ResourceId], Field(fail_fast=True)] = Field(
        default_factory=list, description="Submaps to leave out; ids that are not there are passed over."
    )
    session: Label | None = Field(
        None,
        description="Leave out the submaps of this session; with `within_seconds` only those as close in time.",
    )
    within_seconds: Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)] | None = Field(
        None,
        description="Leave out submaps with a stamp at most so many seconds from the query's, which must have one; "
        "with `session` only those of that session.",
    )


class Near(Body):
    """About where in a map the query is: only submaps that come near there are searched."""

    frame_id: Label = Field("map", description="The map's frame, as in `map_pose`.")
    x: Metres = Field(description="Metres in the map's frame, as `x` of a `map_pose`.")
    y: Metres = Field(description="Metres in the map's frame, as `y` of a `map_pose`.")
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
        False,
        description="Add what each level found in each submap (`findings`), and in words what the reasons mean "
        "(`sentences`).",
    )
    pairs: Annotated[bool, Field(strict=True)] = Field(
        True,
        description="Answer the landmark pairs of each candidate in `inliers`. Without them an answer is much smaller; "
        "`inlier_count`, the pose and the verdict are the same.",
    )
    per_session: Annotated[bool, Field(strict=True)] = Field(
        False, description="Who has been here, and when: the best candidate of every session, each matched by itself."
    )
    timeout_ms: Annotated[int, Field(ge=1, le=3_600_000, strict=True)] | None = Field(
        None,
        description="Milliseconds within which the answer is needed, counted from when the request is there as a "
        "whole; at most, and by default, the limit `query_seconds`. The answer at the deadline is `no_match` with the "
        "reason `deadline` and what was found so far.",
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
    stamp: Stamp | None = Field(None, description=STAMPED)

    @model_validator(mode="after")
    def _one_source(self) -> "QueryInput":
        sources = (self.xy, self.landmarks, self.submap_id)
        if all(source is None for source in sources):
            raise PydanticCustomError("no_landmarks", "give the trees as `xy` or `landmarks`, or a `submap_id`")
        if self.submap_id is not None and (self.xy is not None or self.landmarks is not None):
            raise PydanticCustomError("two_sources", "give either landmarks or a `submap_id`, not both")
        return self


class QueryLinks(Answer):
    """Where to go from an answer."""

    self: str | None = Field(description="Path of this answer; null when the query is not stored.")
    collection: str = Field(description="Path of the collection.")
    explanation: str | None = Field(
        description="Path of the page that says why the answer is what it is; null when the query is not stored."
    )


_LEAD = (
    "Evidence of the best pose minus that of the best distinct pose; null where nothing was strong enough to compare."
)
_SEARCH = "Why the search ended, and what its limits left out; null in answers that an older version stored."


class QueryAnswer(Answer):
    """Outcome before pose: act on `verdict`, never on a candidate alone."""

    id: str | None = Field(description="Id of the stored query; null when it was not stored.")
    collection: str = Field(description="Id of the collection.")
    verdict: Verdict = Field(description="What to act on: `matched`, `ambiguous` or `no_match`.")
    reason: str = Field(description=_REASON)
    frame_id: str | None = Field(description="The query's frame, as it was sent.")
    stamp: _Written | None = Field(description="When the query was observed, as it was sent.")
    method: Method = Field(description="The method that was asked for.")
    revision: int = Field(description="Revision of the collection that was searched.")
    landmarks: int = Field(description="How many landmarks the query has.")
    lead: Annotated[float | None, Formerly("margin")] = Field(description=_LEAD)
    warnings: list[str] = Field(
        default_factory=list,
        description="What is wrong with the query as a whole, as stable words. Looked for with `explain`. "
        f"`mirrored`: {WARNINGS['mirrored']}.",
    )
    gates: Gates = Field(description="What was asked of a match.")
    candidates: list[CandidateAnswer] = Field(description="Best first.")
    rivals: list[RivalAnswer] = Field(
        description="Other poses that explain the data about as well as the first candidate's, the strongest first."
    )
    search: SearchAnswer | None = Field(None, description=_SEARCH)
    stages: list[StageAnswer] = Field(description="What each stage of the search did, in order.")
    findings: list[FindingAnswer] | None = Field(
        description="What each level found, by level, the best first; null unless asked with `explain`. Stored answers "
        "keep it."
    )
    findings_total: int | None = Field(
        description=f"How many findings there were; the answer has the {FINDINGS} with the best log-odds. Null like "
        "`findings`."
    )
    sentences: dict[str, str] | None = Field(
        None,
        description="What the verdict's reason, each `refused` and each warning in this answer mean, by word; null "
        "unless asked with `explain`.",
    )
    links: QueryLinks = Field(description="Where to go from here.")


class MatchAnswer(Answer):
    """A candidate of a stored query with the landmarks of both sides."""

    query: str = Field(description="Id of the stored query.")
    candidate: CandidateAnswer = Field(description="The candidate, as in the answer.")
    query_landmarks: list[Point] = Field(description="[x, y] of the query's landmarks: metres, query frame.")
    submap_landmarks: list[Point] = Field(description="[x, y] of the submap's landmarks: metres, submap frame.")


class ExplanationLinks(Answer):
    """Where to go from an explanation."""

    self: str = Field(description="Path of this explanation.")
    query: str = Field(description="Path of the stored answer.")


class ExplanationAnswer(Answer):
    """Why a stored answer is what it is."""

    query: str = Field(description="Id of the stored query.")
    collection: str = Field(description="Id of the collection.")
    verdict: Verdict = Field(description="What to act on: `matched`, `ambiguous` or `no_match`.")
    reason: str = Field(description=_REASON)
    lead: float | None = Field(description=_LEAD)
    gates: Gates = Field(description="What was asked of a match.")
    search: SearchAnswer | None = Field(None, description=_SEARCH)
    stages: list[StageAnswer] = Field(description="What each stage of the search did, in order.")
    findings: list[FindingAnswer] | None = Field(
        description="What each level found, by level, the best first; null for an answer stored by a version that kept "
        "none."
    )
    findings_total: int | None = Field(description="How many findings there were; null like `findings`.")
    rivals: list[RivalAnswer] = Field(description="Other poses that explain the data about as well, strongest first.")
    sentences: dict[str, str] = Field(description="What each reason in this explanation means, by word.")
    links: ExplanationLinks = Field(description="Where to go from here.")


_EXAMPLE: Any = QueryInput.model_config["json_schema_extra"]["examples"][0]  # type: ignore[index]


class BatchInput(Body):
    """Several queries, each as it would be asked alone."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"queries": [_EXAMPLE, {"submap_id": "p7"}]}]})

    # Read one by one, so that one that is wrong does not spoil the others.
    queries: list[dict[str, Any]] = Field(min_length=1, description="Bodies of `query`.")
    timeout_ms: Annotated[int, Field(ge=1, le=3_600_000, strict=True)] | None = Field(
        None,
        description="Milliseconds within which the whole batch is needed; at most, and by default, the limit "
        "`batch_seconds`. Queries that were not begun by then have the problem `out-of-time` in their place.",
    )


class BatchProblem(Answer):
    """In the place of an answer: why there is none."""

    problem: dict[str, Any] = Field(description="The problem that the query would have been answered with alone.")


class BatchAnswer(Answer):
    """An answer or a problem for each query, in their order."""

    results: list[QueryAnswer | BatchProblem]
