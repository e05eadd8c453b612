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
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.config import Config
from urquhart.pairing import Pattern, count_inliers
from urquhart.se2 import SE2
from urquhart.verification import Verified, settle, verify, weigh_settled

_QUARTERS: Final = 4
_PEAKS: Final = 4
"""Shifts for each quarter; twice as many in all are refined, those that bring most landmarks together."""
_DEEP: Final = 16
"""As many where trees stand in rows: the best rival may overlap less than many others do."""
_IN_ROWS: Final = 0.25
"""Share of the match's evidence that no rival of a natural forest has."""
_SAMPLED: Final = 500
_SAME_TURN: Final = math.radians(6.0)
_CHANCE: Final = (0.7, -1.5)
"""Odds against chance: their logarithm grows so much with the log-odds, and is nought where these are so much."""
_RIVAL: Final = (0.265, -5.4)
"""Odds against a rival: their logarithm grows so much with the lead beyond what says nothing, and is nought where that
is so much."""
_LEAST: Final = -4.0
"""Logarithm of the odds that a pose keeps however close its rivals: one of them all is right now and then."""
_ALIKE: Final = 0.1
"""Share of a rival's evidence that its defeat is discounted by: where trees stand to a few centimetres in their rows, a
lane that is one row off costs it dear, and yet the next lane looks the same."""
_COMPARABLE: Final = 0.5
"""A rival claims at least this share of the query's inliers."""
_SLACK: Final = 30.0
"""Evidence that partners farther away hardly ever add to a wrong pose."""
_UNKNOWN: Final = -8.0
"""Log-odds below which a pose is as likely right as at this value: where noise is larger than anything foreseen, the
evidence of right poses falls without end."""


def log_volume(submaps: int, query: Pattern) -> float:
    """Logarithm of the volume of all poses, square metres times radians, in `submaps` footprints like the query's."""
    return math.log(max(submaps, 1)) + math.log(2.0 * math.pi * query.area)


def log_odds(verified: Verified, query: Pattern, volume: float) -> float:
    """Log-odds of a verified pose against chance.

    Args:
        volume: logarithm of the volume of all poses, see `log_volume`.

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


def against_chance(odds: float) -> float:
    """Logarithm of the odds that a pose with these log-odds is right and not a work of chance."""
    slope, even = _CHANCE
    return slope * (max(odds, _UNKNOWN) - even)


def against_rival(verified: Verified, lead: float | None, margin: float) -> float:
    """Logarithm of the odds that a pose is right and not its best rival, over which it leads by `lead` of evidence."""
    if lead is None:
        return math.inf
    return against_rival_by(verified.evidence, lead, verified.overlap, margin)


def against_rival_by(evidence: float, lead: float, overlap: int, margin: float) -> float:
    """`against_rival` by numbers: `overlap` landmarks could have been inliers."""
    slope, even = _RIVAL
    return max(slope * (lead - margin * overlap - _ALIKE * max(evidence - lead, 0.0) - even), _LEAST)


def surely_behind(verified: Verified, odds: float, margin: float) -> float:
    """Evidence up to which a rival leaves the odds against it at `odds` (a logarithm) or better."""
    slope, even = _RIVAL
    behind = verified.evidence - margin * verified.overlap - even - odds / slope
    return behind / (1.0 + _ALIKE) if behind > 0.0 else behind


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
        return Gates(sure, config.gate / slope + even, config.gate / steep + level, config.margin, _ALIKE)


def together(chance: float, rival: float) -> float:
    """Logarithm of the odds of being right from those against chance and against the best rival."""
    return -float(np.logaddexp(-chance, -rival))


def credited(evidence: NDArray[np.float64], overlap: NDArray[np.float64], wanted: int) -> NDArray[np.float64]:
    """Evidence of rivals as if `wanted` landmarks overlapped under them, not `overlap`, where those are fewer."""
    return np.asarray(np.where(evidence > 0.0, evidence * np.maximum(wanted / np.maximum(overlap, 1.0), 1.0), evidence))


def comparable(rival: Verified, best: Verified) -> bool:
    """Whether a rival claims enough of the trees that the best pose claims for only one of the two to be right.

    A few trees fit anywhere by chance, and chance has been reckoned with; and a query larger than a submap may well lie
    in two of them at once.
    """
    shared = len(np.intersect1d(rival.query, best.query, assume_unique=True))
    return shared >= _COMPARABLE * len(best.query)


def pose_row(pose: SE2) -> NDArray[np.float64]:
    """A pose as kernels take it: x, y, yaw."""
    return np.array([pose.x, pose.y, pose.yaw])


@kernel
def distinct(a: NDArray[np.float64], b: NDArray[np.float64], spacing: float, reach: float) -> bool:
    """Whether two poses of the query (x, y, yaw first, centred frames) put it in different places.

    `spacing`: metres, distance between trees of the submap.
    """
    turn = abs((a[2] - b[2] + 3.0 * math.pi) % (2.0 * math.pi) - math.pi)
    return math.hypot(a[0] - b[0], a[1] - b[1]) > min(0.5 * spacing, 2.0 * reach) or turn > _SAME_TURN


def same_place(first: Pattern, first_pose: SE2, second: Pattern, second_pose: SE2, reach: float, margin: float) -> bool:
    """Whether two submaps that both match a query are the same patch of forest seen twice.

    `first_pose`, `second_pose`: `submap_T_query`, centred frames. Chained they give the transform between the submaps.
    Submaps of one region overlap, and then that transform explains their landmarks too: so well that nothing else comes
    to mind, or at least clearly better than its own rivals. Two ends of one plantation explain each other as well under
    many transforms, and are not the same place.
    """
    chained = verify(second, first, first_pose @ second_pose.inverse(), reach)
    if chained.evidence <= 0.0:
        return False
    least = surely_behind(chained, 0.0, margin) - _SLACK
    rivals = find_rivals(second, first, pose_row(chained.transform), reach, least, _PEAKS)
    lead = chained.evidence - credited(rivals[:, 3], rivals[:, 5], chained.overlap).max(initial=-math.inf)
    return against_rival(chained, lead, margin) > 0.0


def climb(
    query: Pattern, submap: Pattern, best: Verified, reach: float, odds: float, margin: float
) -> tuple[Verified, list[tuple[Verified, float]]]:
    """Change over to the best rival as long as one explains the data better; the best pose, and what rivals it.

    In rows of trees a hypothesis is easily one planting distance off: its rivals include the right pose. The rivals are
    distinct, each with the evidence it is credited with, and leave the odds against them below `odds` (a logarithm);
    the strongest first. Nothing lies at two places of one submap: there a rival that claims other trees is one as well,
    but is credited with nothing that it cannot see.
    """
    seen = [np.empty((0, 6))]
    while True:
        place = pose_row(best.transform)
        found = find_rivals(query, submap, place, reach, surely_behind(best, odds, margin) - _SLACK, _PEAKS)
        seen.append(found)
        if found[:, 3].max(initial=-math.inf) <= best.evidence:
            break
        seen.append(np.array([[*place, best.evidence, reach, best.overlap]]))
        best = weigh_settled(query, submap, found[found[:, 3].argmax()])
    behind = surely_behind(best, odds, margin)
    if found[:, 3].max(initial=-math.inf) > _IN_ROWS * best.evidence:
        seen.append(find_rivals(query, submap, place, reach, behind - _SLACK, _DEEP))
    poses = np.concatenate(seen)
    given = credited(poses[:, 3], poses[:, 5], best.overlap)
    rivals: list[tuple[Verified, float]] = []
    for row, evidence in zip(poses[given > behind], given[given > behind].tolist(), strict=True):
        if distinct(row, place, submap.spacing, reach):
            rival = weigh_settled(query, submap, row)
            counted = evidence if comparable(rival, best) else rival.evidence
            if counted > behind:
                rivals.append((rival, counted))
    return best, sorted(rivals, key=lambda found: -found[1])


@kernel
def find_rivals(
    query: Pattern, submap: Pattern, best: NDArray[np.float64], reach: float, least: float, peaks: int
) -> NDArray[np.float64]:
    """Poses in the same submap that shifting `best` (3,) along the pattern brings up, as `settle` gives them.

    For the match's rotation and its turns by quarters, the displacements between all pairs of landmarks are counted on
    a grid; its peaks are the shifts that put most trees onto trees. In a natural forest they are chance and weak.
    `least`: evidence that makes a second look at one, with partners farther away, worth its time.
    """
    starts = np.empty((_QUARTERS * peaks + 1, 3))
    count = 0
    for quarter in range(_QUARTERS):
        yaw = best[2] + quarter * math.pi / 2.0
        shifts = shift_peaks(query.landmarks, submap.landmarks, yaw, reach, peaks + (quarter == 0))
        for p in range(len(shifts)):
            starts[count, 0], starts[count, 1], starts[count, 2] = shifts[p, 0], shifts[p, 1], yaw
            count += 1
    counted = count_inliers(query.landmarks, submap, starts[:count], reach)
    settled = settle(query, submap, starts[np.argsort(-counted)[: 2 * peaks]], reach, least)
    kept = 0
    for k in range(len(settled)):
        if distinct(settled[k], best, submap.spacing, reach):
            settled[kept] = settled[k]
            kept += 1
    return settled[:kept].copy()


@kernel
def shift_peaks(
    query: NDArray[np.float64], submap: NDArray[np.float64], yaw: float, cell: float, peaks: int
) -> NDArray[np.float64]:
    """The `peaks` shifts (peaks, 2), metres, that bring most landmarks of the turned query onto the submap's.

    Shifts are counted in square cells; a peak is the fullest block of two by two, so that no border splits it, and
    blanks its neighbourhood for the next.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    # A few hundred landmarks show a pattern as well as all of a large map would.
    query = query[:: 1 + len(query) // _SAMPLED]
    turned = np.empty_like(query)
    for i in range(len(query)):
        turned[i, 0] = c * query[i, 0] - s * query[i, 1]
        turned[i, 1] = s * query[i, 0] + c * query[i, 1]
    # Shifts that leave less than about half of either footprint in common say little and are many: keep the middle.
    extent = min(np.ptp(submap[:, 0]), np.ptp(submap[:, 1])) + min(np.ptp(turned[:, 0]), np.ptp(turned[:, 1]))
    half = min(max(0.25 * extent, 4.0 * cell), 400.0 * cell)
    side = int(2.0 * half / cell) + 2
    counts = np.zeros((side, side), np.int32)
    for i in range(len(query)):
        for j in range(len(submap)):
            a = (submap[j, 0] - turned[i, 0] + half) / cell
            b = (submap[j, 1] - turned[i, 1] + half) / cell
            if 0.0 <= a < side and 0.0 <= b < side:
                counts[int(a), int(b)] += 1
    blocks = np.zeros((side - 1, side - 1), np.int32)
    for a in range(side - 1):
        for b in range(side - 1):
            blocks[a, b] = counts[a, b] + counts[a + 1, b] + counts[a, b + 1] + counts[a + 1, b + 1]
    found = np.empty((peaks, 2))
    for p in range(peaks):
        at = np.argmax(blocks)
        a, b = at // (side - 1), at % (side - 1)
        found[p, 0], found[p, 1] = (a + 1) * cell - half, (b + 1) * cell - half
        blocks[max(a - 2, 0) : a + 3, max(b - 2, 0) : b + 3] = -1
    return found
