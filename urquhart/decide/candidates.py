"""Verified poses as an answer reports them: candidates, rivals, and the findings of each level."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.decide.confidence import Refusal, log_odds, probability, refusal, rival_threshold
from urquhart.pose_covariance import PoseUncertainty
from urquhart.propose.query import LevelName, Proposal, Query
from urquhart.se2 import SE2
from urquhart.verify.evidence import PoseEvidence
from urquhart.verify.uncertainty import pose_uncertainty


class CandidateNumbers(NamedTuple):
    """What an answer says about its candidates. Chosen by hand, not fitted."""

    rivals: int = 8
    """Most rivals in an answer: a lattice has one at every planting distance."""


CANDIDATES: Final = CandidateNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A submap with a verified transform.

    Attributes:
        key: the submap, as given to `Recognizer.add`.
        level: the level that proposed the transform.
        transform: `submap_T_query`, in the frames as posted.
        uncertainty: of the transform, about the centroid of the inliers.
        query_indices, submap_indices: (K,) int64, the one-to-one inliers, positions as posted.
        residuals: (K,) float64, metres.
        support: number of quads, polygons, or correlation peaks that proposed the transform, by level.
        inlier_ratio: inliers among the landmarks of the overlap, of the side that has fewer there.
        rms: metres, root mean square of the residuals.
        overlap_ratio: share of the query's landmarks inside the overlap of the footprints.
        overlap_count: number of landmarks inside the overlap, of the side that has more there.
        evidence: log-likelihood ratio, natural logarithm, of the same place against chance.
        log_odds: evidence minus a penalty for the number of possible poses; see `confidence.log_odds`.
        lead: evidence minus that of the best distinct pose; None if no pose was compared.
        confidence: probability that the transform is right.
        refused: why this candidate alone would not be reported as matched; None if it would.
        warnings: faults in the coordinates of one side, words of `urquhart.verify.distortion.WARNINGS`. Distortions are
            looked for only in candidates that are not refused.
    """

    key: int
    level: LevelName
    transform: SE2
    uncertainty: PoseUncertainty
    query_indices: NDArray[np.int64]
    submap_indices: NDArray[np.int64]
    residuals: NDArray[np.float64]
    support: int
    inlier_ratio: float
    rms: float
    overlap_ratio: float
    overlap_count: int
    evidence: float
    log_odds: float
    lead: float | None
    confidence: float
    refused: Refusal | None
    warnings: tuple[str, ...] = ()

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of the transform's x, y and yaw: (3, 3), about the query's origin, along the axes of the submap's frame."""
        return self.uncertainty.origin_covariance(self.transform)


@dataclass(frozen=True, slots=True)
class Rival:
    """Another pose that cannot be ruled out: the reason why an answer is `ambiguous`.

    Attributes:
        key: the submap, often the candidate's own.
        transform: `submap_T_query`, in the frames as posted.
        evidence: log-likelihood ratio, natural logarithm, extrapolated to the overlap of the first candidate, as far as
            chance does not explain it; see `confidence.unexplained`.
        inliers: number of one-to-one inliers under this pose.
    """

    key: int
    transform: SE2
    evidence: float
    inliers: int


@dataclass(frozen=True, slots=True)
class Finding:
    """The best pose of one level in one submap, and why it alone would not be reported as matched.

    Attributes:
        level, key, support: the level that proposed the pose, the submap, and the number of features that support it.
        inliers, overlap_count: one-to-one inliers, and landmarks inside the overlap, of the side that has more there.
        evidence, log_odds: as in `Candidate`.
        refused: the reason; None if only a rival could still refuse it.
    """

    level: LevelName
    key: int
    support: int
    inliers: int
    overlap_count: int
    evidence: float
    log_odds: float
    refused: Refusal | None


def make_finding(proposal: Proposal, query: Query) -> Finding:
    """The finding that explains a proposal."""
    v = proposal.verified
    odds = log_odds(v, query.grid, query.volume)
    refused = refusal(v, odds, None, query.config.lead_per_landmark, query.gate)
    return Finding(
        proposal.level, proposal.key, proposal.support, len(v.residuals), v.overlap, v.evidence, odds, refused
    )


def make_rivals(
    rivals: Iterable[tuple[int, PoseEvidence, float]], best: PoseEvidence, query: Query
) -> tuple[Rival, ...]:
    """The rivals that `best` does not clearly lead, the strongest first, at most `CANDIDATES.rivals`.

    Args:
        rivals: the submap, the pose between centred frames, and the evidence of each that counts.
    """
    behind = rival_threshold(best, query.gate, query.config.lead_per_landmark)
    close = [(key, rival, evidence) for key, rival, evidence in rivals if evidence > max(behind, 0.0)]
    close.sort(key=lambda found: -found[2])
    return tuple(
        Rival(key, _as_posted(rival.transform, key, query), evidence, len(rival.residuals))
        for key, rival, evidence in close[: CANDIDATES.rivals]
    )


def make_candidate(proposal: Proposal, query: Query, lead: float | None) -> Candidate:
    """The candidate that reports a proposal: in the frames as posted, with covariance and confidence.

    Args:
        lead: evidence minus that of the best distinct pose; None if no pose was compared.
    """
    v, features, submap = proposal.verified, query.features, query.submaps.features(proposal.key)
    transform = _as_posted(v.transform, proposal.key, query)
    odds = log_odds(v, query.grid, query.volume)
    refused = refusal(v, odds, lead, query.config.lead_per_landmark, query.gate)
    seen, stored = features.landmarks[v.query] + features.origin, submap.landmarks[v.submap] + submap.origin
    uncertainty, warnings = pose_uncertainty(
        seen, stored, transform, v.residuals, query.config, distorted=refused is None
    )
    return Candidate(
        key=proposal.key,
        level=proposal.level,
        transform=transform,
        uncertainty=uncertainty,
        query_indices=v.query,
        submap_indices=v.submap,
        residuals=v.residuals,
        support=proposal.support,
        inlier_ratio=len(v.residuals) / min(v.query_overlap, v.submap_overlap),
        rms=float(np.sqrt((v.residuals**2).mean())),
        overlap_ratio=v.query_overlap / len(features.landmarks),
        overlap_count=v.overlap,
        evidence=v.evidence,
        log_odds=odds,
        lead=lead,
        confidence=probability(v, odds, lead, query.config),
        refused=refused,
        warnings=warnings,
    )


def _as_posted(pose: SE2, key: int, query: Query) -> SE2:
    """Convert a pose of the query in submap `key` from centred frames to the frames as posted."""
    return SE2.shift(query.submaps.features(key).origin) @ pose @ SE2.shift(query.features.origin).inverse()
