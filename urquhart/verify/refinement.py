"""Verification of proposed poses: each is refined on its own inliers, then scored by all landmarks.

Many poses are held in an array (S, 6) float64, a row each:

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
    """Which poses are refined, and how far away partners are searched. Chosen by hand, not fitted."""

    semifinalists: int = 12
    """Hypotheses that are scored by all landmarks: the best ones by a third of the landmarks."""
    room: float = 0.3
    """Largest distance of partners, as a share of the distance between trees. With partners much farther away, rows of
    trees fit under any shift."""


REFINEMENT: Final = RefinementNumbers()


def verify(
    query: LandmarkGrid, submap: LandmarkGrid, start: SE2, reach: float, budget: Budget = UNBOUNDED
) -> PoseEvidence:
    """Refine `start` (`submap_T_query`, centred frames) on its own inliers, and score it by all landmarks.

    Partners are searched within `reach` metres first. If there is evidence for the pose, and trees stand far enough
    apart, they are searched again within `GRID.loose` times `reach`, and the better result is kept.

    Raises:
        DeadlinePassed: the deadline passed first.
    """
    return verify_best(query, submap, np.array([[start.x, start.y, start.yaw]]), reach, budget)


def verify_best(
    query: LandmarkGrid, submap: LandmarkGrid, starts: NDArray[np.float64], reach: float, budget: Budget = UNBOUNDED
) -> PoseEvidence:
    """The pose with the most evidence among `starts` (S, 3), S > 0, each refined and scored as by `verify`.

    `starts`: x, y, yaw of `submap_T_query`, centred frames, metres and radians.

    Raises:
        DeadlinePassed: the deadline passed first.
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
    """The best of rough poses `starts` (S, 3), S > 0, right to a metre or two, as a row (6,) of `refine_and_score`.

    The poses are first refined with partners within `GRID.loose` times `reach`, metres. The `count` poses that then
    have the most partners are refined again, and scored.

    Raises:
        DeadlinePassed: the deadline passed first.
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
    """The result of `refine_rough` in one compiled call, which is fastest for ordinary sizes."""
    near = refine_all(query, submap, starts, GRID.loose * reach)
    scores = count_inliers(query.landmarks, submap, near, reach)
    scored = refine_and_score(query, submap, near[np.argsort(-scores, kind="mergesort")[:count]], reach, 0.0)
    best: NDArray[np.float64] = scored[scored[:, 3].argmax()]
    return best


def pose_cost(query: LandmarkGrid, submap: LandmarkGrid) -> float:
    """Cost of refining and scoring one pose, in steps of `Budget.portions`."""
    return 100.0 * (len(query.landmarks) + len(submap.landmarks))


@kernel
def refine_all(
    query: LandmarkGrid, submap: LandmarkGrid, starts: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """Poses `starts` (S, 3), each refined by `refine` with partners within `reach` metres."""
    near = np.empty_like(starts)
    for k in range(len(starts)):
        near[k, 0], near[k, 1], near[k, 2] = refine(
            query.landmarks, submap, starts[k, 0], starts[k, 1], starts[k, 2], reach
        )
    return near


def refine_and_score_all(
    query: LandmarkGrid, submap: LandmarkGrid, starts: NDArray[np.float64], reach: float, least: float, budget: Budget
) -> NDArray[np.float64]:
    """The result of `refine_and_score`, computed in portions. Raises DeadlinePassed."""
    portions = budget.portions(len(starts), pose_cost(query, submap))
    return np.concatenate([refine_and_score(query, submap, starts[rows], reach, least) for rows in portions])


@kernel
def refine_and_score(
    query: LandmarkGrid, submap: LandmarkGrid, starts: NDArray[np.float64], reach: float, least: float
) -> NDArray[np.float64]:
    """Refine poses `starts` (S, 3), and score them: rows (S, 6), as the module's docstring describes them.

    `reach`: metres, largest distance of partners; `least`: evidence above which a pose is also tried with partners
    farther away.
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
    """The `count` hypotheses with the most partners, the best first.

    If there are many hypotheses, a third of the landmarks selects those that are scored by all landmarks.

    `hypotheses`: (H, 3), x, y, yaw of `submap_T_query`, centred frames; `reach`: metres, largest distance of partners.

    Raises:
        DeadlinePassed: the deadline passed first.
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
    """The result of `count_inliers`, computed in portions. Raises DeadlinePassed."""
    portions = budget.portions(len(poses), 20.0 * len(landmarks))
    return np.concatenate([count_inliers(landmarks, submap, poses[rows], reach) for rows in portions])
