"""Parts of answers to queries: candidates with their evidence, rivals, findings, and the gates that a match passes."""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any

from pydantic import Field, PlainSerializer

from server.schemas.common import RENAMED_REASONS, Answer, Formerly, write_stamp
from server.schemas.poses import CandidateTransform, MapPoseAnswer, SurveyPose, Transform
from urquhart.hints import HintWord
from urquhart.propose.query import LevelName
from urquhart.report.explanation import SKIPS, STOPS
from urquhart.trace import Skipped, StoppedBy
from urquhart.verify.distortion import WARNINGS


def glossed(meanings: Mapping[Any, str]) -> str:
    """Each word with its meaning, as one sentence."""
    return "; ".join(f"`{word}`: {text}" for word, text in meanings.items()) + "."


_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
_ID = (
    "Ids are always strings: a landmark that was sent without an id has its position in the list as text, counted "
    'from 0 ("0", "1", ...).'
)
_TRANSFORM = "submap_T_query: p_submap = R(yaw) p_query + (x, y)."
_EVIDENCE = (
    "Natural logarithm of how much likelier the trees of both sides are if this is the same place than if they agree "
    "by chance, over all landmarks."
)
_LOG_ODDS = (
    "`evidence` minus the natural logarithm of the number of poses that there were to choose from, and minus 0.1 for "
    "each landmark of the overlap."
)
_INLIER_COUNT = "Number of pairs of landmarks that agree under the transform."
WARNED = (
    "What is wrong with the coordinates of one side, as stable words. The covariance is widened accordingly. "
    + "; ".join(f"`{word}`: {text}" for word, text in WARNINGS.items() if word != "mirrored")
    + "."
)
"""Description of a candidate's warnings."""


class Inlier(Answer):
    """A landmark of the query and a landmark of the submap that are the same tree under the transform."""

    query: str = Field(description=f"Id of the query's landmark. {_ID}")
    submap: str = Field(description=f"Id of the submap's landmark. {_ID}")
    residual: float = Field(description="Distance between the two landmarks under the transform, in metres.")


class InlierColumns(Answer):
    """Pairs of landmarks as three lists of one length: a quarter of the bytes that `inliers` takes."""

    query: list[int] = Field(description="Positions of the landmarks in the list of the query, counted from 0.")
    submap: list[int] = Field(description="Positions of their partners in the submap's list of landmarks.")
    residual: list[float] = Field(
        description="Distances between the two under the transform, in metres, rounded to a tenth of a millimetre."
    )


_SUPPORT = (
    "How many quads or polygons agree on this pose or, if `level` is `exhaustive`, how many shifts and rotations stood "
    "out. Not comparable between levels."
)
_LEVEL = (
    "The step of the search that proposed the pose: matching `quads`, matching `polygons`, an `exhaustive` trial of "
    "rotations and shifts, or the `paper`'s method. `given`: a pose of the window of a given `prior`."
)
_Support = Annotated[int, Formerly("votes")]
_Refused = Annotated[str | None, RENAMED_REASONS]
_Level = Annotated[LevelName, Formerly(words={"sweep": "exhaustive"})]


class CandidateLinks(Answer):
    """Paths that belong to a candidate."""

    submap: str = Field(description="Path of the submap.")
    match: str | None = Field(description="Path of the drawing of the match. Null if the query is not stored.")


class CandidateAnswer(Answer):
    """A submap that may be the query's place, with the evidence."""

    rank: int = Field(description="Position among the candidates. The best is 1.")
    submap_id: str = Field(description="Id of the submap.")
    session: str | None = Field(description="Session of the submap. Null if it has none.")
    stamp: _Written | None = Field(description="When the submap was observed. Null if that is unknown.")
    frame_id: str | None = Field(
        description="Name of the submap's frame, which `transform` takes points to. Null if it has none."
    )
    transform: CandidateTransform = Field(description=_TRANSFORM)
    map_pose: MapPoseAnswer | None = Field(
        description="The query's pose in the map. Null if the submap has no `map_pose`."
    )
    survey: SurveyPose | None = Field(
        None,
        description="The same pose as shift and turn about the middle of the query's trees, in the map frame if the "
        "submap has a `map_pose`. Null in answers that an older version stored.",
    )
    inliers: list[Inlier] = Field(
        description="Pairs of landmarks that are the same tree. Empty if left out (see `inliers_omitted`), or listed "
        "in `inlier_columns`."
    )
    inlier_columns: InlierColumns | None = Field(
        None,
        description="The pairs of landmarks as columns, if the query asked for them (`pair_format`). Null otherwise, "
        "or if they are left out.",
    )
    inlier_count: int = Field(description="Number of pairs of landmarks that agree, whether they are listed or not.")
    inliers_omitted: int = Field(
        0,
        description="Number of pairs that are left out: none, or all of this candidate's. They are left out if "
        "the query said `pairs: false`, or if better candidates, or other answers of the batch, used up the limit "
        "`answer_pairs`.",
    )
    inlier_ratio: float = Field(
        description="`inlier_count` divided by the number of landmarks inside the overlap of both footprints, of the "
        "side that has fewer there. 0 to 1."
    )
    rms: float = Field(description="Root mean square of the inliers' residuals, in metres.")
    overlap_ratio: Annotated[float, Formerly("overlap")] = Field(
        description="Share of the query's landmarks, 0 to 1, that lie inside the overlap of both footprints."
    )
    support: _Support = Field(description=_SUPPORT)
    level: _Level = Field(description=_LEVEL)
    evidence: float = Field(description=_EVIDENCE)
    log_odds: float = Field(description=_LOG_ODDS)
    confidence: float = Field(ge=0, le=1, description="Calibrated probability that `transform` is right.")
    refused: _Refused = Field(
        description="Why this candidate is not accepted, as a stable word: one of those of `reason`. Null if it is "
        "accepted."
    )
    warnings: list[str] = Field(default_factory=list, description=WARNED)
    links: CandidateLinks = Field(description="Paths that belong to the candidate.")


class RivalLinks(Answer):
    """Paths that belong to a rival."""

    submap: str = Field(description="Path of the submap.")


class RivalAnswer(Answer):
    """Another pose that explains so many of the trees that it is not ruled out."""

    submap_id: str = Field(
        description="Id of the submap. Often the first candidate's: in rows of trees, its pose moved to the next row."
    )
    transform: Transform = Field(description=_TRANSFORM)
    evidence: float = Field(
        description="Evidence of the pose, extrapolated to the overlap of the first candidate, and less what chance "
        "explains."
    )
    inlier_count: int = Field(description=_INLIER_COUNT)
    links: RivalLinks = Field(description="Paths that belong to the rival.")


class FindingAnswer(Answer):
    """What one level of the search found in one submap, before it was compared with rivals."""

    level: _Level = Field(description=_LEVEL)
    submap_id: str = Field(description="Id of the submap.")
    support: _Support = Field(description=_SUPPORT)
    inlier_count: Annotated[int, Formerly("inliers")] = Field(description=_INLIER_COUNT)
    overlap_count: Annotated[int, Formerly("overlap")] = Field(
        description="Number of the query's landmarks inside the overlap of both footprints, or of the submap's if "
        "those are more."
    )
    evidence: float = Field(description=_EVIDENCE)
    log_odds: float = Field(description=_LOG_ODDS)
    refused: _Refused = Field(
        description="Why this finding is not accepted, as a stable word: one of those of `reason`. Null if only a "
        "rival could refuse it."
    )


HINTED = (
    "What is probably wrong with the query's coordinates, if nothing was found and `explain` was set. Empty if nothing "
    "that was tried makes the query match."
)
"""Description of the hints of an answer."""


class HintAnswer(Answer):
    """What is probably wrong with the query's coordinates: it would be `matched` without it."""

    word: HintWord = Field(
        description="What is wrong, as a stable word. `mirrored`: an axis or the direction of angles is reversed; "
        "`feet`: the query is in feet; `metres`: the map is in feet; `mercator`: one side is in Web Mercator; "
        "`scaled`: one side is larger."
    )
    factor: float = Field(
        description="Number by which the query's coordinates must be multiplied; 1 if only an axis is reversed."
    )
    submap_id: str = Field(description="Id of the submap that it then matches.")
    inlier_count: int = Field(description="Number of pairs of landmarks that then agree.")
    sentence: str = Field(description="The hint in words.")


class GatesAnswer(Answer):
    """What a pose must pass to be `matched`, from the query's `min_confidence` and the collection's configuration.

    Against a rival, the lead must be at least `lead` + `lead_per_landmark` * (landmarks of the overlap) +
    `lead_ratio` * (evidence of the rival).
    """

    confidence: float = Field(
        description="Least confidence that is `matched`: the query's `min_confidence`, or that of the collection's "
        "`gate`, with the probability of an error rounded to two digits."
    )
    log_odds: float = Field(
        description="Least `log_odds` with which a pose without rivals reaches that confidence. With a rival, more is "
        "needed: the odds of an error by chance and of one by a rival add up."
    )
    lead: float = Field(
        description="Constant part of the lead in evidence that a pose needs over its strongest rival. "
        "`lead_per_landmark` and `lead_ratio` are added to it."
    )
    lead_per_landmark: Annotated[float, Formerly("lead_each")] = Field(
        description="Lead in evidence needed for each landmark of the overlap, added to `lead`. It is the "
        "parameter of the same name in the collection's `config`."
    )
    lead_ratio: Annotated[float, Formerly("lead_share")] = Field(
        description="Lead in evidence needed as a share of the rival's evidence, added to `lead`."
    )


class PromiseAnswer(Answer):
    """How good a query must be for the search to find its place, if that is stored: in the paper's forest 99 times in
    100; rows of trees, and stands with neighbours nearer than 3 m, need the effort `full`."""

    sigma: float = Field(description="Noise of each coordinate, in metres.")
    detection: float = Field(description="Share of the trees that the query sees.")
    landmarks: int = Field(description="Fewest trees of the query.")


class SearchAnswer(Answer):
    """How the search ended and what its limits left out, so whether a longer search could have found more."""

    stopped_by: Annotated[StoppedBy, Formerly(words={"settled": "decided"})] = Field(
        description=f"Why the search ended, as a stable word. {glossed(STOPS)}"
    )
    skipped: list[Skipped] = Field(
        description=f"Limits that left something out, as stable words. Empty if none did. {glossed(SKIPS)}"
    )
    promised: PromiseAnswer | None = Field(
        None,
        description="How good the query must be for this to mean that its place is not stored. Null unless "
        "`stopped_by` is `evidence_bound`.",
    )
    sentence: str = Field(description="`stopped_by` and `skipped` as a sentence.")


class StageAnswer(Answer):
    """A stage of the search."""

    name: str = Field(description="Name of the stage.")
    milliseconds: float = Field(description="How long the stage took, in milliseconds.")
    counts: dict[str, int] = Field(description="How many things the stage made or looked at, by their name.")
