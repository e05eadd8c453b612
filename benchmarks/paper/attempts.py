"""Every pair of a drive tried with a method, and what three ways of scoring make of the same correspondences.

letter     reported when there are enough correspondences to run RANSAC (the paper's section V-B)
inliers    reported when enough of them agree with the transform that RANSAC finds
verified   reported when the transform, refined, explains all landmarks: the Recognizer's own bar for a pose
"""

from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.drive import Drive
from benchmarks.paper.methods import Correspondences, Method, Points, Robust
from urquhart import SE2, Config, describe
from urquhart.decide.confidence import log_odds, refusal
from urquhart.evaluation.scores import Outcomes, is_right, score
from urquhart.paper.ransac import PointPairs, RansacFit, ransac
from urquhart.propose.query import log_volume
from urquhart.verify.landmark_grid import landmark_grid
from urquhart.verify.refinement import verify

Scoring = Literal["letter", "inliers", "verified"]
SCORINGS: Final[tuple[Scoring, ...]] = ("letter", "inliers", "verified")
MINIMA: Final[dict[Scoring, tuple[int, ...]]] = {
    "letter": (4, 8, 16, 32, 64),
    "inliers": (3, 4, 5, 6, 8, 12, 16, 32),
    "verified": (2, 3, 4, 6, 8, 16),
}
"""Least correspondences (letter: the paper's own range; verified) or inliers for a pair to be reported."""


@dataclass(frozen=True, slots=True, eq=False)
class Attempts:
    """What a method made of P pairs, arrays (P,).

    Attributes:
        gate: distance of the whole observations, for methods that have one, else 0.
        correspondences, inliers: how many, int64.
        right: bool, whether RANSAC's transform is within the paper's bounds.
        accepted: bool, whether verification lets that transform, refined, pass.
        verified_right: bool, whether the refined transform is within the bounds.
    """

    gate: NDArray[np.float64]
    correspondences: NDArray[np.int64]
    inliers: NDArray[np.int64]
    right: NDArray[np.bool_]
    accepted: NDArray[np.bool_]
    verified_right: NDArray[np.bool_]

    def outcomes(
        self, positive: NDArray[np.bool_], scoring: Scoring, minimum: int, largest_gate: float = np.inf
    ) -> Outcomes:
        """Outcomes over pairs that are positive or not (P,), under one way of scoring."""
        enough = (self.inliers if scoring == "inliers" else self.correspondences) >= minimum
        reported, right = enough & (self.gate <= largest_gate), self.right
        if scoring == "verified":
            reported, right = reported & self.accepted, self.verified_right
        return score(reported, right, positive)


class Verifier:
    """All-landmark verification of a transform between two of several observations, the same for every method."""

    def __init__(self, observations: list[Points], config: Config) -> None:
        self.config, self.reach = config, config.reach
        self._features = [describe(xy, config) for xy in observations]
        self._grids = [landmark_grid(features, self.reach) for features in self._features]

    def refine(self, first: int, second: int, first_T_second: SE2) -> tuple[SE2, bool]:
        """The transform refined on all landmarks, frames as given, and whether it would pass as a match."""
        into, out = SE2.shift(self._features[first].origin), SE2.shift(self._features[second].origin)
        query = self._grids[second]
        found = verify(query, self._grids[first], into.inverse() @ first_T_second @ out, self.reach)
        odds = log_odds(found, query, log_volume(1, query))
        refused = refusal(found, odds, None, self.config.lead_per_landmark, self.config.gate)
        return into @ found.transform @ out.inverse(), refused is None


def agree(
    query: Points, submap: Points, found: Correspondences, config: Config, rng: np.random.Generator
) -> RansacFit | None:
    """submap_T_query by the paper's RANSAC from correspondences between landmarks (N, 2) and (M, 2), metres."""
    return ransac(
        PointPairs(query[found[0]], submap[found[1]], config.ransac_distance),
        rng,
        ratio=config.ransac_ratio,
        iterations=config.ransac_iterations,
    )


def attempt(drive: Drive, method: Method, config: Config, rng: np.random.Generator) -> dict[str, Attempts]:
    """Try every pair of a drive with each variant of `method`; `config` holds what RANSAC and verification need."""
    seen = [o.xy for o in drive.observations]
    described: list[Any] = [method.describe(xy) for xy in seen]
    verifier = Verifier(seen, config)
    sheets = {name: _Sheet(len(drive.first)) for name in method.variants}
    for p, (i, j) in enumerate(zip(drive.first.tolist(), drive.second.tolist(), strict=True)):
        gate = method.gate(described[j], described[i])
        for name, found in method.match(described[j], described[i], rng).items():
            sheet = sheets[name]
            sheet.gate[p], sheet.correspondences[p] = gate, len(found[0])
            consensus = agree(seen[j], seen[i], found, config, rng)
            if consensus is None:
                continue
            better, sheet.accepted[p] = verifier.refine(i, j, consensus.transform)
            sheet.inliers[p] = consensus.inliers.sum()
            sheet.poses[p], sheet.refined[p] = _row(consensus.transform), _row(better)
    return {name: sheet.judge(drive.truth) for name, sheet in sheets.items()}


def ask(drive: Drive, method: Robust) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which pairs (P,) the robust method reports, and which of its transforms (P,) are within the bounds."""
    collections = [method.describe(o.xy) for o in drive.observations]
    matched, poses = np.zeros(len(drive.first), np.bool_), np.full((len(drive.first), 3), np.nan)
    for p, (i, j) in enumerate(zip(drive.first.tolist(), drive.second.tolist(), strict=True)):
        answer = method.answer(drive.observations[j].xy, collections[i])
        matched[p] = answer.matched
        if answer.transform is not None:
            poses[p] = _row(answer.transform)
    return matched, is_right(poses, drive.truth)


class _Sheet:
    """`Attempts` while they are being filled in; poses are (P, 3) x, y, yaw of first_T_second, NaN without one."""

    def __init__(self, count: int) -> None:
        self.gate, self.accepted = np.zeros(count), np.zeros(count, np.bool_)
        self.correspondences, self.inliers = np.zeros(count, np.int64), np.zeros(count, np.int64)
        self.poses, self.refined = np.full((count, 3), np.nan), np.full((count, 3), np.nan)

    def judge(self, truth: NDArray[np.float64]) -> Attempts:
        right, refined = is_right(self.poses, truth), is_right(self.refined, truth)
        return Attempts(self.gate, self.correspondences, self.inliers, right, self.accepted, refined)


def _row(transform: SE2) -> tuple[float, float, float]:
    return transform.x, transform.y, transform.yaw
