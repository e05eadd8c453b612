"""Scoring a transform against every landmark: the only thing that may call a match a match.

Two point patterns laid over each other by a transform are either the same trees seen twice or two unrelated patches of
forest. Inside the overlap of the two footprints each landmark is evidence: with a partner at a distance that noise
explains it speaks for the transform, the more so the thinner the forest is there; without one it speaks against. The
sum of the logarithms is the log-likelihood ratio reported as `evidence`.

With m the chance that a tree of the overlap which one side saw is seen by the other, s the noise of one coordinate of a
residual and d the density of landmarks about it, a landmark with a partner at distance r contributes

    log( (1 - m) + m exp(-r^2 / 2 s^2) / (2 pi s^2 d) )

and one without contributes log(1 - m). Stem diameters add theirs where both sides have them. Nobody knows m and s
beforehand: the evidence is taken at the best of a few, within what sensors do (`NOISE`, `DETECTION`).
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.budget import UNBOUNDED, Budget
from urquhart.features.describe import Features
from urquhart.se2 import SE2
from urquhart.verify.diameters import weigh_diameters
from urquhart.verify.pairing import Pattern, count_inliers, inside, lay_out, pair_up, refine

NOISE: Final = (0.05, 0.1, 0.2, 0.35, 0.6, 0.9)
"""Metres: trial values for the noise of one coordinate of a residual."""
DETECTION: Final = (0.5, 0.65, 0.8, 0.9)
"""Trial values for the chance that a tree seen once is seen again. A floor well above zero keeps a few chance partners
among many landmarks without one from ever adding up."""
LOOSE: Final = 2.0
"""Where the trees stand far enough apart, a promising pose is tried once more with partners this much farther away."""
_SEMIFINALISTS: Final = 12
_ROOM: Final = 0.3
"""Share of the distance between trees: with partners much farther away, rows of trees fit under any shift."""


@dataclass(frozen=True, slots=True, eq=False)
class Verified:
    """A refined transform and what speaks for it.

    Attributes:
        transform: `submap_T_query` between the *centred* frames.
        evidence: log-likelihood ratio, natural logarithm, of the same place against chance.
        sized: how much of it is from stem diameters.
        query, submap: (K,) int64, the one-to-one inliers.
        residuals: (K,) float64, metres.
        query_overlap, submap_overlap: landmarks of each side inside the overlap of the footprints.
        noise: metres, the noise of one coordinate that explains the residuals best.
        overlap: landmarks inside the overlap, of the side that has more there.
    """

    transform: SE2
    evidence: float
    sized: float
    query: NDArray[np.int64]
    submap: NDArray[np.int64]
    residuals: NDArray[np.float64]
    query_overlap: int
    submap_overlap: int
    noise: float

    @property
    def overlap(self) -> int:
        return max(self.query_overlap, self.submap_overlap)


def pattern(features: Features, reach: float) -> Pattern:
    """Make `features` ready for verification with partners up to `reach` metres away."""
    hull, diameters = features.tessellation.hull, features.diameters
    return lay_out(features.landmarks, features.density, hull, diameters, LOOSE * reach)


def verify(query: Pattern, submap: Pattern, start: SE2, reach: float, budget: Budget = UNBOUNDED) -> Verified:
    """Refine `start` (`submap_T_query`, centred frames) on its own inliers and weigh it against all landmarks.

    Partners are sought within `reach` first, then, if that speaks for the pose, within `LOOSE` times as far, where the
    trees stand far enough apart; the better explanation stands. Surveys by compass and tape are that noisy.
    """
    return verify_best(query, submap, np.array([[start.x, start.y, start.yaw]]), reach, budget)


def verify_best(
    query: Pattern, submap: Pattern, starts: NDArray[np.float64], reach: float, budget: Budget = UNBOUNDED
) -> Verified:
    """The strongest of several poses `starts` (S, 3), S > 0, each refined and weighed as in `verify`.

    Raises:
        OutOfTime: the deadline passed before all were weighed.
    """
    settled = settle_all(query, submap, starts, reach, 0.0, budget)
    return weigh_settled(query, submap, settled[settled[:, 3].argmax()])


def settle_rough(
    query: Pattern,
    submap: Pattern,
    starts: NDArray[np.float64],
    reach: float,
    count: int,
    budget: Budget = UNBOUNDED,
) -> NDArray[np.float64]:
    """The best row (6,), as `settle` gives it, of poses `starts` (S, 3), S > 0, that are good to a metre or two.

    Partners are sought far away first; the `count` poses that then bring most landmarks together are settled.

    Raises:
        OutOfTime: the deadline passed before all were settled.
    """
    cost = pose_cost(query, submap)
    if budget.fits(len(starts), cost):
        return settle_rough_at_once(query, submap, starts, reach, count)
    portions = budget.portions(len(starts), cost)
    near = np.concatenate([refine_all(query, submap, starts[rows], LOOSE * reach) for rows in portions])
    scores = count_inliers(query.landmarks, submap, near, reach)
    chosen = near[np.argsort(-scores, kind="stable")[:count]]
    settled = settle_all(query, submap, chosen, reach, 0.0, budget)
    best: NDArray[np.float64] = settled[settled[:, 3].argmax()]
    return best


@kernel
def settle_rough_at_once(
    query: Pattern, submap: Pattern, starts: NDArray[np.float64], reach: float, count: int
) -> NDArray[np.float64]:
    """What `settle_rough` gives, in one step: for ordinary sizes that is fastest."""
    near = refine_all(query, submap, starts, LOOSE * reach)
    scores = count_inliers(query.landmarks, submap, near, reach)
    settled = settle(query, submap, near[np.argsort(-scores, kind="mergesort")[:count]], reach, 0.0)
    best: NDArray[np.float64] = settled[settled[:, 3].argmax()]
    return best


def pose_cost(query: Pattern, submap: Pattern) -> float:
    """Steps that it takes to refine and weigh one pose, see `Budget.portions`."""
    return 100.0 * (len(query.landmarks) + len(submap.landmarks))


@kernel
def refine_all(query: Pattern, submap: Pattern, starts: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """Poses (S, 3), each refined as `refine` does it."""
    near = np.empty_like(starts)
    for k in range(len(starts)):
        near[k, 0], near[k, 1], near[k, 2] = refine(
            query.landmarks, submap, starts[k, 0], starts[k, 1], starts[k, 2], reach
        )
    return near


def settle_all(
    query: Pattern, submap: Pattern, starts: NDArray[np.float64], reach: float, least: float, budget: Budget
) -> NDArray[np.float64]:
    """`settle`, in portions. Raises OutOfTime where the deadline passes between two of them."""
    portions = budget.portions(len(starts), pose_cost(query, submap))
    return np.concatenate([settle(query, submap, starts[rows], reach, least) for rows in portions])


def weigh_settled(query: Pattern, submap: Pattern, settled: NDArray[np.float64]) -> Verified:
    """All that speaks for a pose as `settle` gives it, a row (6,)."""
    x, y, yaw, _, reach, _ = settled.tolist()
    return weigh_pose(query, submap, SE2(x, y, yaw), reach)


@kernel
def settle(
    query: Pattern, submap: Pattern, starts: NDArray[np.float64], reach: float, least: float
) -> NDArray[np.float64]:
    """Poses (S, 3) refined, rows (S, 6): x, y, yaw, evidence, reach of the partners, landmarks of the overlap.

    The landmarks are those of the side that has more of them there.
    `least`: evidence that makes the second try, with partners farther away, worth its time.
    """
    settled = np.empty((len(starts), 6))
    wide = min(LOOSE * reach, _ROOM * query.spacing, _ROOM * submap.spacing)
    for k in range(len(starts)):
        x, y, yaw = refine(query.landmarks, submap, starts[k, 0], starts[k, 1], starts[k, 2], reach)
        evidence, _, _, _, _, seen, stored, _ = weigh(query, submap, x, y, yaw, reach)
        overlap, used = max(seen, stored), reach
        if evidence > least and wide > reach:
            there = refine(query.landmarks, submap, x, y, yaw, wide)
            loose, _, _, _, _, seen, stored, _ = weigh(query, submap, there[0], there[1], there[2], wide)
            if loose > evidence:
                (x, y, yaw), evidence, overlap, used = there, loose, max(seen, stored), wide
        settled[k, 0], settled[k, 1], settled[k, 2] = x, y, yaw
        settled[k, 3], settled[k, 4], settled[k, 5] = evidence, used, overlap
    return settled


def best_hypotheses(
    query: Pattern,
    submap: Pattern,
    hypotheses: NDArray[np.float64],
    reach: float,
    count: int,
    budget: Budget = UNBOUNDED,
) -> NDArray[np.float64]:
    """Those `count` of `hypotheses` (H, 3) that bring most landmarks together, the best first.

    Hypotheses are x, y, yaw of `submap_T_query` between the centred frames. Where they are many, a third of the
    landmarks chooses those that all of them are spent on.

    Raises:
        OutOfTime: the deadline passed before all were counted.
    """
    if len(hypotheses) > 2 * _SEMIFINALISTS:
        third = np.ascontiguousarray(query.landmarks[::3])
        rough = count_all(third, submap, hypotheses, reach, budget)
        hypotheses = hypotheses[np.argsort(-rough, kind="stable")[: max(_SEMIFINALISTS, count)]]
    scores = count_all(query.landmarks, submap, hypotheses, reach, budget)
    return hypotheses[np.argsort(-scores, kind="stable")[:count]]


def count_all(
    landmarks: NDArray[np.float64], submap: Pattern, poses: NDArray[np.float64], reach: float, budget: Budget
) -> NDArray[np.float64]:
    """`count_inliers`, in portions. Raises OutOfTime where the deadline passes between two of them."""
    portions = budget.portions(len(poses), 20.0 * len(landmarks))
    return np.concatenate([count_inliers(landmarks, submap, poses[rows], reach) for rows in portions])


def weigh_pose(query: Pattern, submap: Pattern, pose: SE2, reach: float) -> Verified:
    """The evidence for `pose` (`submap_T_query`, centred frames) as it is."""
    evidence, sized, first, second, residuals, query_overlap, submap_overlap, noise = weigh(
        query, submap, pose.x, pose.y, pose.yaw, reach
    )
    return Verified(pose, evidence, sized, first, second, residuals, query_overlap, submap_overlap, noise)


@kernel
def weigh(
    query: Pattern, submap: Pattern, x: float, y: float, yaw: float, reach: float
) -> tuple[float, float, NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], int, int, float]:
    """Evidence for a transform from every landmark of the overlap; see the head of this file and `Verified`."""
    c, s = math.cos(yaw), math.sin(yaw)
    first, second, squared = pair_up(query.landmarks, submap, x, y, yaw, reach)
    seen, stored = query.landmarks, submap.landmarks
    paired_query, paired_submap = np.zeros(len(seen), np.bool_), np.zeros(len(stored), np.bool_)
    for k in range(len(first)):
        paired_query[first[k]] = True
        paired_submap[second[k]] = True
    query_overlap = submap_overlap = len(first)
    for i in range(len(seen)):
        if not paired_query[i] and inside(
            submap, c * seen[i, 0] - s * seen[i, 1] + x, s * seen[i, 0] + c * seen[i, 1] + y
        ):
            query_overlap += 1
    for j in range(len(stored)):
        dx, dy = stored[j, 0] - x, stored[j, 1] - y
        if not paired_submap[j] and inside(query, c * dx + s * dy, -s * dx + c * dy):
            submap_overlap += 1
    alone = query_overlap + submap_overlap - 2 * len(first)

    peaks = np.empty(len(first))
    best, best_noise = -np.inf, 0.0
    for noise in NOISE:
        for k in range(len(first)):
            # The denser side decides: chance finds partners where either side is crowded.
            density = max(query.density[first[k]], submap.density[second[k]])
            peaks[k] = math.exp(-squared[k] / (2.0 * noise * noise)) / (2.0 * math.pi * noise * noise * density)
        for detection in DETECTION:
            total, product = alone * math.log(1.0 - detection), 1.0
            for k in range(len(first)):
                product *= 1.0 - detection + detection * peaks[k]
                # One logarithm for many factors, taken before they leave the range of a float.
                if product > 1e100 or product < 1e-100:
                    total, product = total + math.log(product), 1.0
            total += math.log(product)
            if total > best:
                best, best_noise = total, noise
    sized = weigh_diameters(query.sizes, query.spread, submap.sizes, submap.spread, first, second)
    return best + sized, sized, first, second, np.sqrt(squared), query_overlap, submap_overlap, best_noise
