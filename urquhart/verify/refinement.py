"""Verification of proposed poses: each is refined on its own inliers, then scored by all landmarks.

Many poses are kept as an array (S, 6) float64 with a row for each:

    x, y, yaw   `submap_T_query` between centred frames, metres and radians
    evidence    log-likelihood ratio of the same place against chance
    reach       metres within which partners were sought
    overlap     landmarks of the overlap, of the side that has more of them there
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.budget import UNBOUNDED, Budget
from urquhart.se2 import SE2
from urquhart.verify.evidence import PoseEvidence, evidence_of_row, score_pose
from urquhart.verify.landmark_grid import GRID, LandmarkGrid
from urquhart.verify.pairing import count_inliers, refine


class RefinementNumbers(NamedTuple):
    """Which poses are refined, and how far away partners are sought. Chosen by hand, not fitted."""

    semifinalists: int = 12
    """Hypotheses that all landmarks are spent on, of those that a third of the landmarks likes best."""
    room: float = 0.3
    """Share of the distance between trees: with partners much farther away, rows of trees fit under any shift."""


REFINEMENT: Final = RefinementNumbers()


def verify(
    query: LandmarkGrid, submap: LandmarkGrid, start: SE2, reach: float, budget: Budget = UNBOUNDED
) -> PoseEvidence:
    """Refine `start` (`submap_T_query`, centred frames) on its own inliers and weigh it against all landmarks.

    Partners are sought within `reach` first. If that speaks for the pose and trees stand far enough apart, they are
    sought again within `GRID.loose` times `reach`, and the better explanation stands.
    """
    return verify_best(query, submap, np.array([[start.x, start.y, start.yaw]]), reach, budget)


def verify_best(
    query: LandmarkGrid, submap: LandmarkGrid, starts: NDArray[np.float64], reach: float, budget: Budget = UNBOUNDED
) -> PoseEvidence:
    """The strongest of several poses `starts` (S, 3), S > 0, each refined and weighed as in `verify`.

    Raises:
        OutOfTime: the deadline passed before all were weighed.
    """
    scored = refine_and_score_all(query, submap, starts, reach, 0.0, budget)
    return evidence_of_row(query, submap, scored[scored[:, 3].argmax()])


def refine_rough(
    query: LandmarkGrid,
    submap: LandmarkGrid,
    starts: NDArray[np.float64],
    reach: float,
    count: int,
    budget: Budget = UNBOUNDED,
) -> NDArray[np.float64]:
    """The best of poses `starts` (S, 3), S > 0, that are good to a metre or two: a row (6,) of `refine_and_score`.

    Partners are sought far away first; the `count` poses that then bring most landmarks together are refined again.

    Raises:
        OutOfTime: the deadline passed before all were scored.
    """
    cost = pose_cost(query, submap)
    if budget.fits(len(starts), cost):
        return refine_rough_at_once(query, submap, starts, reach, count)
    portions = budget.portions(len(starts), cost)
    near = np.concatenate([refine_all(query, submap, starts[rows], GRID.loose * reach) for rows in portions])
    scores = count_inliers(query.landmarks, submap, near, reach)
    chosen = near[np.argsort(-scores, kind="stable")[:count]]
    scored = refine_and_score_all(query, submap, chosen, reach, 0.0, budget)
    best: NDArray[np.float64] = scored[scored[:, 3].argmax()]
    return best


@kernel
def refine_rough_at_once(
    query: LandmarkGrid, submap: LandmarkGrid, starts: NDArray[np.float64], reach: float, count: int
) -> NDArray[np.float64]:
    """What `refine_rough` gives, in one step: for ordinary sizes that is fastest."""
    near = refine_all(query, submap, starts, GRID.loose * reach)
    scores = count_inliers(query.landmarks, submap, near, reach)
    scored = refine_and_score(query, submap, near[np.argsort(-scores, kind="mergesort")[:count]], reach, 0.0)
    best: NDArray[np.float64] = scored[scored[:, 3].argmax()]
    return best


def pose_cost(query: LandmarkGrid, submap: LandmarkGrid) -> float:
    """Steps that it takes to refine and weigh one pose, see `Budget.portions`."""
    return 100.0 * (len(query.landmarks) + len(submap.landmarks))


@kernel
def refine_all(
    query: LandmarkGrid, submap: LandmarkGrid, starts: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """Poses (S, 3), each refined as `refine` does it."""
    near = np.empty_like(starts)
    for k in range(len(starts)):
        near[k, 0], near[k, 1], near[k, 2] = refine(
            query.landmarks, submap, starts[k, 0], starts[k, 1], starts[k, 2], reach
        )
    return near


def refine_and_score_all(
    query: LandmarkGrid, submap: LandmarkGrid, starts: NDArray[np.float64], reach: float, least: float, budget: Budget
) -> NDArray[np.float64]:
    """`refine_and_score`, in portions. Raises OutOfTime where the deadline passes between two of them."""
    portions = budget.portions(len(starts), pose_cost(query, submap))
    return np.concatenate([refine_and_score(query, submap, starts[rows], reach, least) for rows in portions])


@kernel
def refine_and_score(
    query: LandmarkGrid, submap: LandmarkGrid, starts: NDArray[np.float64], reach: float, least: float
) -> NDArray[np.float64]:
    """Poses (S, 3) refined, rows (S, 6): x, y, yaw, evidence, reach of the partners, landmarks of the overlap.

    The landmarks are those of the side that has more of them there.
    `least`: evidence that makes the second try, with partners farther away, worth its time.
    """
    scored = np.empty((len(starts), 6))
    wide = min(GRID.loose * reach, REFINEMENT.room * query.spacing, REFINEMENT.room * submap.spacing)
    for k in range(len(starts)):
        x, y, yaw = refine(query.landmarks, submap, starts[k, 0], starts[k, 1], starts[k, 2], reach)
        evidence, _, _, _, _, seen, stored, _ = score_pose(query, submap, x, y, yaw, reach)
        overlap, used = max(seen, stored), reach
        if evidence > least and wide > reach:
            there = refine(query.landmarks, submap, x, y, yaw, wide)
            loose, _, _, _, _, seen, stored, _ = score_pose(query, submap, there[0], there[1], there[2], wide)
            if loose > evidence:
                (x, y, yaw), evidence, overlap, used = there, loose, max(seen, stored), wide
        scored[k, 0], scored[k, 1], scored[k, 2] = x, y, yaw
        scored[k, 3], scored[k, 4], scored[k, 5] = evidence, used, overlap
    return scored


def best_hypotheses(
    query: LandmarkGrid,
    submap: LandmarkGrid,
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
    if len(hypotheses) > 2 * REFINEMENT.semifinalists:
        third = np.ascontiguousarray(query.landmarks[::3])
        rough = count_all(third, submap, hypotheses, reach, budget)
        hypotheses = hypotheses[np.argsort(-rough, kind="stable")[: max(REFINEMENT.semifinalists, count)]]
    scores = count_all(query.landmarks, submap, hypotheses, reach, budget)
    return hypotheses[np.argsort(-scores, kind="stable")[:count]]


def count_all(
    landmarks: NDArray[np.float64], submap: LandmarkGrid, poses: NDArray[np.float64], reach: float, budget: Budget
) -> NDArray[np.float64]:
    """`count_inliers`, in portions. Raises OutOfTime where the deadline passes between two of them."""
    portions = budget.portions(len(poses), 20.0 * len(landmarks))
    return np.concatenate([count_inliers(landmarks, submap, poses[rows], reach) for rows in portions])
