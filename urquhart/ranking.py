"""Candidates in order, and the verdict: `matched` only when chance and every rival have been ruled out."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from urquhart.confidence import log_odds
from urquhart.config import Config
from urquhart.features import Features
from urquhart.proposing import Level, Proposal, Sighting
from urquhart.se2 import SE2, covariance
from urquhart.verification import Verified

Verdict = Literal["matched", "ambiguous", "no_match"]
_LEAST_NOISE: Final = 0.02
"""Metres: no tree is located better than this, however well a few of them happen to agree."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A submap with a verified transform.

    Attributes:
        key: the submap, as given to `Recognizer.add`.
        level: which features proposed the transform.
        transform: `submap_T_query`, in the frames as posted.
        covariance: (3, 3) float64 over (x, y, yaw): metres, radians.
        query_indices, submap_indices: (K,) int64, the one-to-one inliers, positions as posted.
        residuals: (K,) float64, metres.
        votes: features that voted for the submap.
        inlier_ratio: inliers among the landmarks of the overlap, of the side that has fewer there.
        rms: metres, root mean square of the residuals.
        overlap: share of the query's landmarks inside the overlap of the footprints.
        evidence: log-likelihood ratio of the same place against chance.
        log_odds: evidence less the logarithm of the share of all poses that the landmarks leave possible.
        lead: evidence over that of the best distinct pose; None where it was too weak to be compared.
        confidence: probability that the transform is right.
        refused: why this candidate alone would not be reported as matched, else None.
    """

    key: int
    level: Level
    transform: SE2
    covariance: NDArray[np.float64]
    query_indices: NDArray[np.int64]
    submap_indices: NDArray[np.int64]
    residuals: NDArray[np.float64]
    votes: int
    inlier_ratio: float
    rms: float
    overlap: float
    evidence: float
    log_odds: float
    lead: float | None
    confidence: float
    refused: str | None


def refusal(verified: Verified, odds: float, lead: float | None, config: Config) -> str | None:
    """Why a verified pose is not to be reported as matched, or None.

    In rows of trees a wrong pose gathers a little from each of many trees: the evidence must also be enough for each.
    """
    if verified.evidence <= 0.0:
        return "verification_failed"
    if odds < config.gate or verified.evidence < config.share * max(verified.query_overlap, verified.submap_overlap):
        return "below_gate"
    if lead is not None and _clear_lead(verified.evidence, lead, config) < config.gate:
        return "runner_up_too_close"
    return None


def confidence(evidence: float, odds: float, lead: float | None, config: Config) -> float:
    """Probability that a pose is right: against chance by its log-odds, against its rival by its lead over it."""
    against = math.exp(min(-odds, 500.0))
    if lead is not None:
        against += math.exp(min(-_clear_lead(evidence, lead, config), 500.0))
    return 1.0 / (1.0 + against)


def decide(candidates: Sequence[Candidate]) -> tuple[Verdict, str]:
    """Verdict and reason from candidates, best first."""
    if not candidates:
        return "no_match", "verification_failed"
    reason = candidates[0].refused
    if reason is None:
        return "matched", "verified"
    return ("ambiguous" if reason == "runner_up_too_close" else "no_match"), reason


def best_by_submap(proposals: Iterable[Proposal]) -> list[Proposal]:
    """The best proposal of each submap that has two inliers at least (fewer fix no pose), best first, ties by key."""
    best: dict[int, Proposal] = {}
    for proposal in proposals:
        known = best.get(proposal.key)
        if len(proposal.verified.residuals) >= 2 and (
            known is None or proposal.verified.evidence > known.verified.evidence
        ):
            best[proposal.key] = proposal
    return sorted(best.values(), key=lambda p: (-p.verified.evidence, p.key))


def make_candidate(
    proposal: Proposal, submap: Features, query: Sighting, lead: float | None, config: Config
) -> Candidate:
    """A proposal as it is reported: in the frames as posted, with covariance and confidence.

    Args:
        lead: evidence over the best distinct pose, where there was one to compare.
    """
    v, features = proposal.verified, query.features
    transform = SE2.shift(submap.origin) @ v.transform @ SE2.shift(features.origin).inverse()
    inliers = len(v.residuals)
    degrees = max(2 * inliers - 3, 1)
    variance = max(float((v.residuals**2).sum()) / degrees, _LEAST_NOISE**2)
    odds = log_odds(v, query.pattern, query.volume)
    return Candidate(
        key=proposal.key,
        level=proposal.level,
        transform=transform,
        covariance=covariance(features.landmarks[v.query] + features.origin, transform, variance),
        query_indices=v.query,
        submap_indices=v.submap,
        residuals=v.residuals,
        votes=proposal.votes,
        inlier_ratio=inliers / min(v.query_overlap, v.submap_overlap),
        rms=float(np.sqrt((v.residuals**2).mean())),
        overlap=v.query_overlap / len(features.landmarks),
        evidence=v.evidence,
        log_odds=odds,
        lead=lead,
        confidence=confidence(v.evidence, odds, lead, config),
        refused=refusal(v, odds, lead, config),
    )


def _clear_lead(evidence: float, lead: float, config: Config) -> float:
    return lead - config.margin * evidence
