"""The search for rivals: other poses that explain many of the trees, in any submap."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from urquhart._kernel import kernel
from urquhart.budget import UNBOUNDED, Budget
from urquhart.config import Config
from urquhart.decide.confidence import QUARTERS, comparable, extrapolated, rival_logit, rival_threshold
from urquhart.decide.shifts import chosen_landmarks, shifted
from urquhart.se2 import SE2
from urquhart.verify.evidence import PoseEvidence, evidence_of_row
from urquhart.verify.landmark_grid import LandmarkGrid
from urquhart.verify.pairing import count_inliers
from urquhart.verify.refinement import count_all, pose_cost, refine_and_score, refine_and_score_all, verify


class RivalNumbers(NamedTuple):
    """How a match is shifted in the search for its rivals. Chosen by hand, not fitted."""

    peaks: int = 4
    """Shifts that are tried at each quarter turn. In all, twice as many are refined, those with the most partners."""
    peaks_in_rows: int = 16
    """The same if trees stand in rows: there, the best rival may overlap less than many others."""
    in_rows: float = 0.25
    """Share of the match's evidence that no rival reaches in a natural forest. If one does, trees stand in rows."""
    close: float = 0.25
    """Noise, as a share of the distance to the nearest tree, above which partners are mistaken for their
    neighbours."""
    steps: int = 5
    """Starts of a refinement along each axis, from one reach before a pose to one reach behind it."""
    same_turn: float = math.radians(6.0)
    """Radians: poses whose rotations differ by more are distinct."""
    slack: float = 30.0
    """Evidence that a second try, with partners farther away, hardly ever adds to a wrong pose."""


RIVALS: Final = RivalNumbers()


def pose_row(pose: SE2) -> NDArray[np.float64]:
    """A pose as an array (3,) for kernels: x, y, yaw."""
    return np.array([pose.x, pose.y, pose.yaw])


@kernel
def distinct(a: NDArray[np.float64], b: NDArray[np.float64], spacing: float, reach: float) -> bool:
    """Whether two poses of the query are different places.

    `a`, `b`: x, y, yaw, centred frames, perhaps with more numbers after them; `spacing`: metres, distance between trees
    of the submap; `reach`: metres, largest distance of partners.
    """
    turn = abs((a[2] - b[2] + 3.0 * math.pi) % (2.0 * math.pi) - math.pi)
    return math.hypot(a[0] - b[0], a[1] - b[1]) > min(0.5 * spacing, 2.0 * reach) or turn > RIVALS.same_turn


def same_place(
    first: LandmarkGrid,
    first_pose: SE2,
    second: LandmarkGrid,
    second_pose: SE2,
    config: Config,
    budget: Budget = UNBOUNDED,
) -> bool:
    """Whether two submaps that both match a query are the same patch of forest, seen twice.

    The two poses, chained, give the transform between the submaps. If the submaps overlap, that transform also explains
    their landmarks, and has no rival or is clearly better than its rivals. Two ends of one plantation fit each other
    equally well under many transforms: they are not the same place.

    Args:
        first_pose, second_pose: `submap_T_query`, centred frames.

    Raises:
        DeadlinePassed: the deadline passed first.
    """
    margin = config.lead_per_landmark
    chained = verify(second, first, first_pose @ second_pose.inverse(), config.reach, budget)
    if chained.evidence <= 0.0:
        return False
    least = rival_threshold(chained, 0.0, margin) - RIVALS.slack
    rivals = find_rivals(
        second, first, pose_row(chained.transform), RivalSearch(config.reach, least, RIVALS.peaks), budget
    )
    lead = chained.evidence - extrapolated(rivals[:, 3], rivals[:, 5], chained.overlap).max(initial=-math.inf)
    return rival_logit(chained, lead, margin) > 0.0


def hill_climb(
    query: LandmarkGrid,
    submap: LandmarkGrid,
    best: PoseEvidence,
    odds: float,
    config: Config,
    budget: Budget = UNBOUNDED,
) -> tuple[PoseEvidence, list[tuple[PoseEvidence, float]]]:
    """Move from a pose to its best rival, as long as that explains the trees better.

    In rows of trees, a proposed pose is often off by a planting distance, and its rivals include the right pose.

    Args:
        best: the pose to start from, centred frames.
        odds: log-odds against a rival from which on it no longer matters.

    Returns:
        The best pose; and its rivals, the strongest first: distinct poses in the same submap against which its log-odds
        are below `odds`, each with its evidence. The evidence is extrapolated to the overlap of the best pose, but not
        for a rival that pairs other trees of the query.

    Raises:
        DeadlinePassed: the deadline passed before all rivals were compared.
    """
    reach, margin = config.reach, config.lead_per_landmark
    seen = [np.empty((0, 6))]
    while True:
        place = pose_row(best.transform)
        least = rival_threshold(best, odds, margin) - RIVALS.slack
        found = find_rivals(query, submap, place, RivalSearch(reach, least, RIVALS.peaks), budget)
        seen.append(found)
        if found[:, 3].max(initial=-math.inf) > best.evidence:
            better = evidence_of_row(query, submap, found[found[:, 3].argmax()])
        else:
            better = polish(query, submap, best, reach, budget)
        if better is best:
            break
        seen.append(np.array([[*place, best.evidence, reach, best.overlap]]))
        best = better
    behind = rival_threshold(best, odds, margin)
    if found[:, 3].max(initial=-math.inf) > RIVALS.in_rows * best.evidence:
        least = behind - RIVALS.slack
        seen.append(find_rivals(query, submap, place, RivalSearch(reach, least, RIVALS.peaks_in_rows), budget))
    poses = np.concatenate(seen)
    given = extrapolated(poses[:, 3], poses[:, 5], best.overlap)
    rivals: list[tuple[PoseEvidence, float]] = []
    for row, evidence in zip(poses[given > behind], given[given > behind].tolist(), strict=True):
        if distinct(row, place, submap.spacing, reach):
            if not budget.fits(1, pose_cost(query, submap)):
                budget.check()
            rival = evidence_of_row(query, submap, row)
            counted = evidence if comparable(rival, best) else rival.evidence
            if counted > behind:
                rivals.append((rival, counted))
    return best, _apart(sorted(rivals, key=lambda found: -found[1]), submap.spacing, reach)


def _apart(rivals: list[tuple[PoseEvidence, float]], spacing: float, reach: float) -> list[tuple[PoseEvidence, float]]:
    """The rivals, the strongest first, without those that are the same place as a stronger one."""
    kept: list[tuple[PoseEvidence, float]] = []
    for rival, counted in rivals:
        row = pose_row(rival.transform)
        if all(distinct(row, pose_row(other.transform), spacing, reach) for other, _ in kept):
            kept.append((rival, counted))
    return kept


def polish(
    query: LandmarkGrid, submap: LandmarkGrid, best: PoseEvidence, reach: float, budget: Budget = UNBOUNDED
) -> PoseEvidence:
    """The best pose that refinement reaches from starts around `best`, if trees stand close compared with the noise.

    There, partners are easily mistaken for their neighbours: refinement may end between two trees, at a local optimum.

    Raises:
        DeadlinePassed: the deadline passed first.
    """
    if best.noise < RIVALS.close * neighbour_distance(query.landmarks):
        return best
    steps = np.linspace(-reach, reach, RIVALS.steps)
    starts = np.array([[best.transform.x + x, best.transform.y + y, best.transform.yaw] for x in steps for y in steps])
    found = refine_and_score_all(query, submap, starts, reach, best.evidence, budget)
    first = found[found[:, 3].argmax()]
    return evidence_of_row(query, submap, first) if first[3] > best.evidence else best


def neighbour_distance(landmarks: NDArray[np.float64]) -> float:
    """Median distance, metres, from a landmark to the nearest other one; landmarks (N, 2), N >= 2."""
    distances = np.asarray(cKDTree(landmarks).query(landmarks, k=2)[0])
    return float(np.median(distances[:, 1]))


class RivalSearch(NamedTuple):
    """How far a search for rivals goes.

    Attributes:
        reach: metres, largest distance of partners.
        least: evidence above which a pose is also tried with partners farther away.
        peaks: shifts at each quarter turn.
    """

    reach: float
    least: float
    peaks: int


def find_rivals(
    query: LandmarkGrid,
    submap: LandmarkGrid,
    best: NDArray[np.float64],
    search: RivalSearch,
    budget: Budget = UNBOUNDED,
) -> NDArray[np.float64]:
    """Distinct poses in the same submap, found by shifting `best` along the pattern of the trees.

    At the match's rotation and its quarter turns, the displacements between all pairs of landmarks are counted on a
    grid; the peaks are the shifts that put most trees onto trees. In a natural forest they are weak chance peaks.

    Args:
        best: (3,), x, y, yaw of `submap_T_query`, centred frames.
        search: how far to go.

    Returns:
        Rows (R, 6), as `refine_and_score` returns them.

    Raises:
        DeadlinePassed: the deadline passed first.
    """
    reach, least, peaks = search
    if budget.fits(QUARTERS * peaks, pose_cost(query, submap)):
        return find_rivals_at_once(query, submap, best, reach, least, peaks)
    # One quarter turn after the other: besides the pairs, up to 640,000 cells are searched for each peak.
    chosen = chosen_landmarks(query, submap, best, reach)
    turned = [
        shifted(chosen, submap, best, reach, peaks, quarter.start) for quarter in budget.portions(QUARTERS, math.inf)
    ]
    starts = np.concatenate(turned)
    counted = count_all(query.landmarks, submap, starts, reach, budget)
    scored = refine_and_score_all(query, submap, starts[np.argsort(-counted)[: 2 * peaks]], reach, least, budget)
    return np.array([row for row in scored if distinct(row, best, submap.spacing, reach)]).reshape(-1, 6)


@kernel
def find_rivals_at_once(
    query: LandmarkGrid, submap: LandmarkGrid, best: NDArray[np.float64], reach: float, least: float, peaks: int
) -> NDArray[np.float64]:
    """The result of `find_rivals` in one compiled call, which is fastest for ordinary sizes."""
    starts = np.empty((2 * (QUARTERS * peaks + 1), 3))
    count = 0
    chosen = chosen_landmarks(query, submap, best, reach)
    for quarter in range(QUARTERS):
        shifts = shifted(chosen, submap, best, reach, peaks, quarter)
        starts[count : count + len(shifts)] = shifts
        count += len(shifts)
    counted = count_inliers(query.landmarks, submap, starts[:count], reach)
    scored = refine_and_score(query, submap, starts[np.argsort(-counted)[: 2 * peaks]], reach, least)
    kept = 0
    for k in range(len(scored)):
        if distinct(scored[k], best, submap.spacing, reach):
            scored[kept] = scored[k]
            kept += 1
    return scored[:kept].copy()
