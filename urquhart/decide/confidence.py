"""How sure a verified transform is: against chance, and against every other pose that explains the data about as well.

Chance. Evidence is a log-likelihood ratio at the best pose; a collection offers a great many poses, and the best of
many wrong ones is better than one wrong one. The log-odds are the evidence less the logarithm of the share of all poses
that the landmarks leave possible (Laplace's approximation of the Bayes factor: the Occam factor).

Rivals. A forest that repeats itself (rows of a plantation) gives wrong poses evidence that no model of independent
trees foresees. What a wrong pose can reach here is read off the data at hand: the best distinct pose among all
hypotheses, and the best that shifting the match along the pattern, straight on or turned by quarters, brings up. In a
natural forest these rivals explain nothing; in rows they come close, and closer the fewer trees there are to tell them
apart: a lead counts by what it is more than `Config.margin` for each landmark of the overlap. Shifted by a row, fewer
trees overlap, and a rival would have less evidence however alike the rows are: it is credited with what it cannot see
at the rate at which it explains what it does see, or the corner of one orchard would pass for that of another.

Confidence. Neither number is a probability as it stands: trees are not independent, and every level takes its best of
many. Two straight lines make them into one, fitted to answers whose truth is known (`calibrate` in the benchmarks,
which also draws how well it holds on others): the odds of being right against chance, and against a rival. Being wrong
in either way is being wrong, so the two are added up as 1 / (1 + 1 / chance + 1 / rival).
"""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from urquhart.config import Config
from urquhart.verify.evidence import PoseEvidence
from urquhart.verify.landmark_grid import LandmarkGrid

Refusal = Literal["verification_failed", "runner_up_too_close", "below_gate", "deadline", "contradicting_maps"]
"""Why a pose is not reported as matched; the words are stable."""

_CHANCE: Final = (0.7, -1.5)
"""Odds against chance: their logarithm grows so much with the log-odds, and is nought where these are so much."""
_RIVAL: Final = (0.265, -5.4)
"""Odds against a rival: their logarithm grows so much with the lead beyond what says nothing, and is nought where that
is so much."""
_LEAST: Final = -4.0
"""Logarithm of the odds that a pose keeps however close its rivals: one of them all is right now and then."""
_RIVAL_PENALTY: Final = 0.1
"""Share of a rival's evidence that its defeat is discounted by: where trees stand to a few centimetres in their rows, a
lane that is one row off costs it dear, and yet the next lane looks the same."""
_COMPARABLE: Final = 0.5
"""A rival claims at least this share of the query's inliers."""
_UNKNOWN: Final = -8.0
"""Log-odds below which a pose is as likely right as at this value: where noise is larger than anything foreseen, the
evidence of right poses falls without end."""


def log_odds(verified: PoseEvidence, query: LandmarkGrid, volume: float) -> float:
    """Log-odds of a verified pose against chance.

    Args:
        volume: logarithm of the volume of all poses, see `propose.query.log_volume`.

    With K inliers of noise s, the information on x, y and yaw about the inliers' centroid is K / s^2, K / s^2 and
    S / s^2, where S is the sum of squared distances from the centroid: the pose is left a volume of
    (2 pi)^1.5 s^3 / (K sqrt(S)).
    """
    inliers = query.landmarks[verified.query]
    if len(inliers) < 2:
        return -math.inf
    spread = float(((inliers - inliers.mean(axis=0)) ** 2).sum())
    left = (
        1.5 * math.log(2.0 * math.pi) + 3.0 * math.log(verified.noise) - math.log(len(inliers)) - 0.5 * math.log(spread)
    )
    return verified.evidence + min(left - volume, 0.0)


def chance_logit(odds: float) -> float:
    """Logarithm of the odds that a pose with these log-odds is right and not a work of chance."""
    slope, even = _CHANCE
    return slope * (max(odds, _UNKNOWN) - even)


def rival_logit(verified: PoseEvidence, lead: float | None, margin: float) -> float:
    """Logarithm of the odds that a pose is right and not its best rival, over which it leads by `lead` of evidence."""
    if lead is None:
        return math.inf
    return rival_logit_from(verified.evidence, lead, verified.overlap, margin)


def rival_logit_from(evidence: float, lead: float, overlap: int, margin: float) -> float:
    """`rival_logit` by numbers: `overlap` landmarks could have been inliers."""
    slope, even = _RIVAL
    return max(slope * (lead - margin * overlap - _RIVAL_PENALTY * max(evidence - lead, 0.0) - even), _LEAST)


def rival_threshold(verified: PoseEvidence, odds: float, margin: float) -> float:
    """Evidence up to which a rival leaves the odds against it at `odds` (a logarithm) or better."""
    slope, even = _RIVAL
    behind = verified.evidence - margin * verified.overlap - even - odds / slope
    return behind / (1.0 + _RIVAL_PENALTY) if behind > 0.0 else behind


@dataclass(frozen=True, slots=True)
class Gates:
    """What a pose must pass to be reported as matched.

    Attributes:
        confidence: the least there may be.
        log_odds: the least that reach it where nothing rivals the pose.
        lead: the least evidence over the best rival that reaches it where chance is out of the question,
        lead_each: and as much more for each landmark of the overlap,
        lead_share: and such a share of the rival's evidence, where it has any.
    """

    confidence: float
    log_odds: float
    lead: float
    lead_each: float
    lead_share: float

    @staticmethod
    def of(config: Config) -> "Gates":
        """The gates that a configuration puts in force."""
        slope, even = _CHANCE
        sure = 1.0 / (1.0 + math.exp(-config.gate))
        steep, level = _RIVAL
        return Gates(sure, config.gate / slope + even, config.gate / steep + level, config.margin, _RIVAL_PENALTY)


def combine(chance: float, rival: float) -> float:
    """Logarithm of the odds of being right from those against chance and against the best rival."""
    return -float(np.logaddexp(-chance, -rival))


def refusal(verified: PoseEvidence, odds: float, lead: float | None, config: Config) -> Refusal | None:
    """Why a verified pose is not to be reported as matched, or None.

    Args:
        odds: log-odds against chance.
        lead: evidence over the best distinct pose, where there was one to compare.
    """
    if verified.evidence <= 0.0:
        return "verification_failed"
    chance, rival = chance_logit(odds), rival_logit(verified, lead, config.margin)
    if combine(chance, rival) >= config.gate:
        return None
    # A rival that explains nothing itself is none: then the match is too weak for what a forest may bring about.
    close = lead is not None and lead < verified.evidence
    return "runner_up_too_close" if close and chance >= config.gate else "below_gate"


def probability(verified: PoseEvidence, odds: float, lead: float | None, config: Config) -> float:
    """Probability that a pose is right; `odds` and `lead` as in `refusal`."""
    return 1.0 / (1.0 + math.exp(-combine(chance_logit(odds), rival_logit(verified, lead, config.margin))))


def extrapolated(evidence: NDArray[np.float64], overlap: NDArray[np.float64], wanted: int) -> NDArray[np.float64]:
    """Evidence of rivals as if `wanted` landmarks overlapped under them, not `overlap`, where those are fewer."""
    return np.asarray(np.where(evidence > 0.0, evidence * np.maximum(wanted / np.maximum(overlap, 1.0), 1.0), evidence))


def comparable(rival: PoseEvidence, best: PoseEvidence) -> bool:
    """Whether a rival claims enough of the trees that the best pose claims for only one of the two to be right.

    A few trees fit anywhere by chance, and chance has been reckoned with; and a query larger than a submap may well lie
    in two of them at once.
    """
    shared = len(np.intersect1d(rival.query, best.query, assume_unique=True))
    return shared >= _COMPARABLE * len(best.query)
