"""The documents of the API, as typed values.

Fields that a newer service adds are passed over, so that an older client keeps working. Units and frames: metres and
radians, counter-clockwise; a transform is `submap_T_query`, p_submap = R(yaw) p_query + t.
"""

from datetime import datetime
from typing import Any, Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from urquhart_client.poses import Inlier, InlierColumns, MapPose, Model, SurveyPose, Transform

Verdict = Literal["matched", "ambiguous", "no_match"]
Method = Literal["robust", "paper"]
Effort = Literal["fast", "full"]
PairFormat = Literal["objects", "columns"]

Item = TypeVar("Item", bound=BaseModel)


class Landmark(BaseModel):
    """A tree: `x`, `y` and `height_m` in metres, `dbh_cm` in centimetres, in the frame of its document. Further members
    are kept."""

    model_config = ConfigDict(frozen=True, extra="allow")

    id: str
    x: float
    y: float
    dbh_cm: float | None = None
    height_m: float | None = None
    species: str | None = None


class Candidate(Model):
    """A submap that may be the query's place, and the evidence for and against it.

    `map_pose` is the pose of the *query's* frame in the map, when the submap has a pose there; `survey` the same as
    shift and turn about the middle of the query's trees. `confidence` is 0 to 1,
    `log_odds` the natural logarithm of right against wrong, `evidence` the same before the number of poses to choose
    from is taken off, `level` which search proposed the pose and `support` how much did, `rms` in metres; `refused`
    says why this candidate alone is not accepted, `warnings` what is wrong with the coordinates of one side.
    """

    shown = ("submap_id", "session", "transform", "map_pose", "inlier_count", "rms", "confidence", "refused")

    rank: int
    submap_id: str
    frame_id: str | None = None
    session: str | None = None
    stamp: datetime | None = None
    transform: Transform
    map_pose: MapPose | None = None
    survey: SurveyPose | None = None
    inliers: tuple[Inlier, ...] = ()
    inlier_columns: InlierColumns | None = None
    inlier_count: int
    inlier_ratio: float
    rms: float
    overlap_ratio: float
    support: int
    level: str | None = None
    evidence: float | None = None
    log_odds: float
    confidence: float
    refused: str | None = None
    warnings: tuple[str, ...] = ()
    links: dict[str, Any] = Field(default_factory=dict)


class Stage(Model):
    """What one stage of the method did and how long it took."""

    name: str
    milliseconds: float
    counts: dict[str, int] = Field(default_factory=dict)


class SearchEnd(Model):
    """Why the search ended, and what its limits left out; with up to the noise `promised`, the place is not stored."""

    stopped_by: str
    skipped: tuple[str, ...] = ()
    promised: dict[str, float] | None = None


class Rival(Model):
    """Another pose that explains so many of the trees that it is not ruled out; `transform` as in `Candidate`."""

    submap_id: str
    transform: Transform
    evidence: float
    inlier_count: int
    links: dict[str, Any] = Field(default_factory=dict)


class Finding(Model):
    """What one level found in one submap, and why that alone is not accepted (`refused`, None where it would be)."""

    level: str
    submap_id: str
    support: int
    inlier_count: int
    overlap_count: int
    evidence: float
    log_odds: float
    refused: str | None = None


class Gates(Model):
    """What a pose must pass: the least confidence; the log-odds, and the lead over a rival (`lead` and
    `lead_per_landmark` for each landmark of the overlap, and `lead_ratio` of the rival's evidence), that reach it."""

    confidence: float
    log_odds: float
    lead: float
    lead_per_landmark: float
    lead_ratio: float


class QueryResult(Model):
    """The answer to *where is this?*. Look at `verdict` before any pose.

    `rivals` are what makes it ambiguous. `explain` adds `findings`, and `sentences`: what each reason in it means.
    """

    shown = ("id", "collection", "verdict", "reason", "best", "candidates", "rivals", "revision")

    id: str | None = None
    collection: str
    verdict: Verdict
    reason: str
    frame_id: str | None = None
    stamp: datetime | None = None
    method: str
    effort: str = "full"
    revision: int
    landmark_count: int | None = None
    lead: float | None = None
    warnings: tuple[str, ...] = ()
    gates: Gates | None = None
    candidates: tuple[Candidate, ...] = ()
    rivals: tuple[Rival, ...] = ()
    search: SearchEnd | None = None
    stages: tuple[Stage, ...] = ()
    findings: tuple[Finding, ...] | None = None
    findings_total: int | None = None
    sentences: dict[str, str] | None = None
    links: dict[str, Any] = Field(default_factory=dict)

    @property
    def best(self) -> Candidate | None:
        """The place, when the verdict is `matched`; None otherwise, however good the first candidate looks."""
        return self.candidates[0] if self.verdict == "matched" and self.candidates else None


class Explanation(Model):
    """Why a stored query was answered as it was; `findings` is None if the version that stored it kept none."""

    shown = ("query_id", "collection", "verdict", "reason", "lead", "findings", "rivals", "sentences")

    query_id: str
    collection: str
    verdict: Verdict
    reason: str
    lead: float | None = None
    gates: Gates
    stages: tuple[Stage, ...] = ()
    findings: tuple[Finding, ...] | None = None
    findings_total: int | None = None
    rivals: tuple[Rival, ...] = ()
    sentences: dict[str, str] = Field(default_factory=dict)
    links: dict[str, Any] = Field(default_factory=dict)


class SpatialExtent(Model):
    """Bounding box (x minimum, y minimum, x maximum, y maximum), metres, of what a collection covers in one map."""

    frame_id: str
    bbox: tuple[float, float, float, float]


class Extent(Model):
    """What a collection covers: by map, and from the first stamp to the last."""

    spatial: tuple[SpatialExtent, ...] = ()
    temporal: tuple[datetime, datetime] | None = None


class Collection(Model):
    """Submaps that share a configuration. A listing leaves `frames`, `config` and `extent` out (None).

    `crs` and `origin` are those of the map frame "map"; `frames` has them for every other map frame, and `systems` the
    names of all. A tree counts in `counts` for each submap that it is in, and in `stands` once.
    """

    id: str
    title: str | None = None
    crs: str | None = None
    origin: tuple[float, float] | None = None
    fingerprint: str
    revision: int
    counts: dict[str, int] = Field(default_factory=dict)
    stands: dict[str, int] = Field(default_factory=dict)
    systems: tuple[str, ...] = ()
    created: datetime | None = None
    updated: datetime | None = None
    frames: dict[str, dict[str, Any]] | None = None
    config: dict[str, Any] | None = None
    extent: Extent | None = None
    links: dict[str, Any] = Field(default_factory=dict)


class SubmapReceipt(Model):
    """What became of a submap that was sent. `etag` names the content that is stored now, None where nothing is.

    `outcome` is `not_stored` where a `query` came with too few trees, or trees on one line; `reason` and `detail` say
    why, and `query` is the answer all the same. `cleared` names the optional members that a PUT left out and thereby
    cleared, e.g. `session`.
    """

    id: str | None
    collection: str
    outcome: Literal["created", "replaced", "unchanged", "not_stored"]
    reason: str | None = None
    detail: str | None = None
    counts: dict[str, int] = Field(default_factory=dict)
    etag: str | None
    revision: int
    cleared: tuple[str, ...] = ()
    links: dict[str, Any] | None = None
    query: QueryResult | None = None


class Submap(Model):
    """A stored submap. A listing leaves `landmarks` out (None)."""

    id: str
    collection: str
    frame_id: str | None = None
    stamp: datetime | None = None
    session: str | None = None
    map_pose: MapPose | None = None
    properties: dict[str, Any] | None = None
    counts: dict[str, int] = Field(default_factory=dict)
    etag: str
    revision: int
    created: datetime | None = None
    updated: datetime | None = None
    landmarks: tuple[Landmark, ...] | None = None
    links: dict[str, Any] = Field(default_factory=dict)


class SessionSummary(Model):
    """A session: the submaps of one drive, flight or survey."""

    session: str
    submaps: int
    landmarks: int = 0
    first: datetime | None = None
    last: datetime | None = None


class Polygon(Model):
    """An interior Urquhart polygon: landmark positions counter-clockwise, triangle positions, descriptor."""

    vertices: tuple[int, ...]
    triangles: tuple[int, ...]
    descriptor: tuple[float, ...]


class Tessellation(Model):
    """What the method sees in a submap; triangles are positions in `landmarks`, counter-clockwise."""

    submap_id: str
    fingerprint: str
    counts: dict[str, int] = Field(default_factory=dict)
    landmarks: tuple[Landmark, ...] = ()
    triangles: tuple[tuple[int, int, int], ...] = ()
    polygons: tuple[Polygon, ...] = ()


class Limits(Model):
    """What requests are held to, by the name that a refusal gives."""

    limits: dict[str, int | float]
    rates: dict[str, float] = Field(default_factory=dict)
    retention: dict[str, float] = Field(default_factory=dict)
    versions: dict[str, str] = Field(default_factory=dict)


class Page(Model, Generic[Item]):
    """One page of a listing; `next` is the cursor of the page after it, None on the last."""

    items: tuple[Item, ...]
    next: str | None = None
