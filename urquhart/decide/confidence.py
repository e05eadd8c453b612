"""The confidence of a verified pose: against chance, and against every pose that cannot be ruled out.

Chance. Evidence is a log-likelihood ratio at the best pose. A collection offers very many poses, and the best of many
wrong ones looks better than a single wrong one. So the log-odds are the evidence minus a penalty: the logarithm of how
many times more poses there are in all than the landmarks leave possible (Laplace's approximation of the Bayes factor:
the Occam factor). And where trees stand in rows, a wrong pose along the rows gains a little from each tree; so a little
is subtracted for each landmark of the overlap (`ConfidenceNumbers.alignment`).

Rivals. A forest that repeats itself, such as rows of a plantation, gives wrong poses more evidence than a model of
independent trees predicts. So the evidence that a wrong pose can reach is measured in the data at hand: it is that of
the best distinct pose among all hypotheses, and among the poses that shifting the match along the pattern brings up,
with its own rotation or turned by quarters. In a natural forest these rivals explain nothing. In rows they come close,
and the closer, the fewer trees tell them apart, so a lead counts only as far as it exceeds `Config.lead_per_landmark`
for each landmark of the overlap. Under a pose that is one row off, fewer trees overlap, and the rival would have less
evidence however alike the rows are. Its evidence is therefore extrapolated to the overlap of the match; otherwise the
corner of one orchard would pass for the corner of another. A rival may also be a coincidence itself: among many
submaps, some wrong pose always fits a few trees, and the log-odds of the match have taken that into account already. So
a rival counts as far as chance does not explain it; see `unexplained`.

Confidence. Neither number is a probability yet: trees are not independent, and every level keeps its best of many
poses. Two straight lines turn them into log-odds of being right, one against chance and one against a rival. They are
fitted to answers whose truth is known, by `python -m benchmarks.robust.calibrate`, and kept in `calibration.json`. A
pose is wrong if it is wrong in either way, so the odds are combined as 1 / (1 / chance + 1 / rival).
"""

import json
import math
from dataclasses import dataclass
from importlib.resources import files
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.config import Config
from urquhart.verify.evidence import PoseEvidence
from urquhart.verify.landmark_grid import LandmarkGrid

Refusal = Literal[
    "verification_failed", "rival_too_close", "below_gate", "outside_prior", "deadline", "contradicting_maps"
]
"""Why a pose is not reported as matched. The words are part of the API."""


class Line(NamedTuple):
    """A straight line from an uncalibrated number to calibrated log-odds of being right.

    Attributes:
        slope: calibrated log-odds gained by each unit of the number.
        even: the number at which the line is zero, where right and wrong are equally likely.
    """

    slope: float
    even: float


class Calibration(NamedTuple):
    """The two fitted lines.

    Attributes:
        chance: from the log-odds against chance.
        rival: from the lead over a rival, minus the part of the lead that says nothing.
    """

    chance: Line
    rival: Line


_FITTED: Final = json.loads(files("urquhart").joinpath("calibration.json").read_text(encoding="utf-8"))["in_use"]
CALIBRATION: Final = Calibration(*(Line(**_FITTED[name]) for name in Calibration._fields))
"""The lines in use; `calibration.json` says how they were fitted."""


class ConfidenceNumbers(NamedTuple):
    """Bounds and penalties around the fitted lines. Chosen by hand; the fit of the lines takes them as given."""

    least_rival_logit: float = -4.0
    """Least log-odds against a rival: however close the rivals are, the pose is right now and then."""
    alignment: float = 0.1
    """Evidence for each landmark of the overlap that says nothing against chance: so much more than independent trees
    have the trees of a wrong pose that lies along rows."""
    rival_penalty: float = 0.1
    """Share of a rival's evidence by which the lead over it is reduced. If trees stand within a few centimetres of
    their rows, a pose that is one row off loses much evidence, and still the next row looks the same."""
    comparable: float = 0.5
    """Least share of the query's inliers that a rival in another submap must claim."""
    unknown: float = -8.0
    """Log-odds against chance are clipped here, and below it no rivals are searched: hardly one pose in ten is right
    there. With more noise than the model allows for, right poses lose evidence without limit."""


CONFIDENCE: Final = ConfidenceNumbers()
QUARTERS: Final = 4
"""Rotations at which rivals in the submap of the best pose are searched: its own, and three quarter turns."""


def log_odds(verified: PoseEvidence, query: LandmarkGrid, volume: float) -> float:
    """Log-odds of a verified pose against chance: evidence minus the logarithm of all poses over those left possible,
    and minus `ConfidenceNumbers.alignment` for each landmark of the overlap.

    With K inliers of noise s, the information on x, y and yaw about the inliers' centroid is K / s^2, K / s^2 and
    S / s^2, where S is the sum of squared distances from the centroid. So the inliers leave possible a volume of poses
    of (2 pi)^1.5 s^3 / (K sqrt(S)), by Laplace's approximation.

    Args:
        query: landmarks of the query.
        volume: logarithm of the volume of all poses; see `propose.query.log_volume`.
    """
    return odds_of_coincidence(verified, query, volume) - CONFIDENCE.alignment * verified.overlap


def odds_of_coincidence(verified: PoseEvidence, query: LandmarkGrid, volume: float) -> float:
    """Log-odds against a coincidence of independent trees: `log_odds` without what trees in rows give to a wrong pose.

    A rival that owes its evidence to rows is no coincidence.
    """
    if len(verified.query) < 2:
        return -math.inf
    shifts, turns = _log_left(verified, query)
    return verified.evidence + min(shifts + turns - volume, 0.0)


def odds_of_coincidence_nearby(rival: PoseEvidence, query: LandmarkGrid, area: float) -> float:
    """The same for a rival in the submap of the best pose.

    It is found by shifts within an area, at the rotation of the best pose and its quarter turns. So there are fewer
    poses in all, and chance explains less.

    Args:
        query: landmarks of the query.
        area: square metres in which shifts are searched.
    """
    if len(rival.query) < 2:
        return -math.inf
    shifts, _ = _log_left(rival, query)
    return rival.evidence + min(shifts - math.log(QUARTERS * area), 0.0)


def _log_left(verified: PoseEvidence, query: LandmarkGrid) -> tuple[float, float]:
    """Logarithms of the area of shifts, square metres, and of the range of turns, radians, that inliers leave possible.

    There are at least two inliers.
    """
    inliers = query.landmarks[verified.query]
    spread = float(((inliers - inliers.mean(axis=0)) ** 2).sum())
    whole, noise = math.log(2.0 * math.pi), math.log(verified.noise)
    return whole + 2.0 * noise - math.log(len(inliers)), 0.5 * whole + noise - 0.5 * math.log(spread)


def unexplained(evidence: float, odds: float) -> float:
    """The part of a rival's evidence that counts: as if chance did not explain any of it.

    With the probability p that its log-odds give, a rival is a repetition of the forest; otherwise it is a coincidence,
    which the log-odds of the best pose account for already. So only p times the odds of error count that its evidence
    would give.

    Args:
        evidence: of the rival, extrapolated to the overlap of the best pose.
        odds: log-odds of the rival against a coincidence.
    """
    repeats = -float(np.logaddexp(0.0, -max(odds, CONFIDENCE.unknown)))
    return evidence + repeats / (CALIBRATION.rival.slope * (1.0 + CONFIDENCE.rival_penalty))


def chance_logit(odds: float) -> float:
    """Calibrated log-odds that a pose with log-odds `odds` is right, and not a coincidence."""
    slope, even = CALIBRATION.chance
    return slope * (max(odds, CONFIDENCE.unknown) - even)


def rival_logit(verified: PoseEvidence, lead: float | None, margin: float) -> float:
    """Calibrated log-odds that a pose is right, and not its best rival.

    Args:
        lead: evidence minus that of the rival; None if there is no rival, and then the log-odds are infinite.
        margin: `Config.lead_per_landmark`.
    """
    if lead is None:
        return math.inf
    return rival_logit_from(verified.evidence, lead, verified.overlap, margin)


def rival_logit_from(evidence: float, lead: float, overlap: int, margin: float) -> float:
    """The result of `rival_logit` from numbers; `overlap`: landmarks inside the overlap, of the side with more."""
    slope, even = CALIBRATION.rival
    beyond = lead - margin * overlap - CONFIDENCE.rival_penalty * max(evidence - lead, 0.0)
    return max(slope * (beyond - even), CONFIDENCE.least_rival_logit)


def rival_threshold(verified: PoseEvidence, odds: float, margin: float) -> float:
    """The largest evidence of a rival with which `rival_logit` is still at least `odds`.

    `margin`: `Config.lead_per_landmark`.
    """
    slope, even = CALIBRATION.rival
    behind = verified.evidence - margin * verified.overlap - even - odds / slope
    return behind / (1.0 + CONFIDENCE.rival_penalty) if behind > 0.0 else behind


@dataclass(frozen=True, slots=True)
class Gates:
    """What a pose must pass to be reported as matched.

    Attributes:
        confidence: the least confidence.
        log_odds: the least log-odds that give this confidence to a pose without rivals.
        lead: the least evidence over the best rival that gives it where chance is ruled out. Added to it are:
        lead_per_landmark: evidence for each landmark of the overlap.
        lead_ratio: share of the rival's evidence, where that is above zero.
    """

    confidence: float
    log_odds: float
    lead: float
    lead_per_landmark: float
    lead_ratio: float

    @staticmethod
    def of(config: Config, gate: float | None = None) -> "Gates":
        """The gates of a search with this configuration; `gate`: see `Options.gate`, by default `Config.gate`."""
        gate = config.gate if gate is None else gate
        sure = 1.0 / (1.0 + math.exp(-gate))
        odds, lead = (gate / line.slope + line.even for line in CALIBRATION)
        return Gates(sure, odds, lead, config.lead_per_landmark, CONFIDENCE.rival_penalty)


def combine(chance: float, rival: float) -> float:
    """Log-odds of being right, from those against chance and those against the best rival: the odds of error add up."""
    return -float(np.logaddexp(-chance, -rival))


def refusal(verified: PoseEvidence, odds: float, lead: float | None, margin: float, gate: float) -> Refusal | None:
    """Why a verified pose must not be reported as matched; None if it may be.

    Args:
        odds: its `log_odds`.
        lead: evidence minus that of the best distinct pose; None if no pose was compared.
        margin: `Config.lead_per_landmark`.
        gate: least log-odds of being right; see `Options.gate`.
    """
    if verified.evidence <= 0.0:
        return "verification_failed"
    chance, rival = chance_logit(odds), rival_logit(verified, lead, margin)
    if combine(chance, rival) >= gate:
        return None
    # A rival without evidence of its own is no rival: then the match itself is too weak.
    close = lead is not None and lead < verified.evidence
    return "rival_too_close" if close and chance >= gate > rival else "below_gate"


def probability(verified: PoseEvidence, odds: float, lead: float | None, config: Config) -> float:
    """Probability that a pose is right; `odds` and `lead` as in `refusal`."""
    return 1.0 / (1.0 + math.exp(-combine(chance_logit(odds), rival_logit(verified, lead, config.lead_per_landmark))))


def extrapolated(evidence: NDArray[np.float64], overlap: NDArray[np.float64], wanted: int) -> NDArray[np.float64]:
    """Evidence (R,) of rivals, extrapolated from their `overlap` (R,) to `wanted` landmarks, if that is more.

    Evidence that is not positive stays as it is.
    """
    return np.asarray(np.where(evidence > 0.0, evidence * np.maximum(wanted / np.maximum(overlap, 1.0), 1.0), evidence))


def comparable(rival: PoseEvidence, best: PoseEvidence) -> bool:
    """Whether a rival claims so many of the best pose's trees that only one of the two can be right.

    A few trees fit anywhere by chance, which the log-odds account for. And a query that is larger than a submap may lie
    in two of them at once.
    """
    shared = len(np.intersect1d(rival.query, best.query, assume_unique=True))
    return shared >= CONFIDENCE.comparable * len(best.query)
