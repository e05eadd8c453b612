"""The decision within a prior's window: is the observation there, where, and is that the only place for it?

The posterior of all poses of the window is summed up about the best one, and apart from it. Rivals are other places in
the window, and windows that surely do not hold the observation: its mirror image, or where the prior says it is not.
`urquhart.prior.confidence` says what each is worth.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.decide.candidates import Candidate, Finding, Rival, make_candidate
from urquhart.decide.confidence import CALIBRATION, Refusal
from urquhart.decide.verdict import Recognition, Verdict, unsearched
from urquhart.features.describe import Features
from urquhart.pose_covariance import PoseUncertainty
from urquhart.prior.confidence import window_chance_logit, window_logit, window_rival_logit
from urquhart.prior.window import Window, WindowSearch
from urquhart.propose.query import Proposal, Query
from urquhart.se2 import SE2
from urquhart.verify.evidence import PoseEvidence, evidence_of_pose
from urquhart.verify.landmark_grid import GRID


class DecisionNumbers(NamedTuple):
    """What a pose within a window must pass. Chosen by hand, not fitted, unless a field says otherwise."""

    same: float = 2.0
    """Metres: poses whose middles are closer are one place."""
    same_turn: float = math.radians(12.0)
    """Radians: poses whose rotations differ by more are different places."""
    fine: float = 0.125
    """Metres between the shifts from which the pose and its covariance are computed."""
    fine_steps: int = 8
    """Such shifts on either side of the best pose, along each axis."""
    fine_turns: int = 4
    """Rotations on either side of the best pose."""
    fine_turn: float = math.radians(0.75)
    """Radians between these rotations."""


DECISION: Final = DecisionNumbers()
_LEAST_PAIRS: Final = 4
"""Pairs of trees without which no pose is accepted. Two fix a pose, so a third and a fourth confirm it. A gap beside a
clump of trees was accepted with two: the clump's density counted for all of the footprint, and spoke for the pose.
"""
_MOVES: Final = 4
"""Most fine grids, each about the best pose of the one before, until the best pose is within the grid. One is enough
within the window; a place 1.2 m outside of it takes two or three."""


@dataclass(frozen=True, slots=True, eq=False)
class WindowMatch:
    """The best place of a window.

    Attributes:
        pose: `map_T_query` between centred frames.
        covariance: (3, 3) float64 over x, y, yaw of the observation's middle: square metres, square radians.
        evidence: of the best pose on the grid.
        near, apart: logarithms of posterior over chance of this place, and of all others in the window.
        repeated: the same of a window that surely does not hold the observation; see `repetition`.
        rival: the best pose of another place, with its evidence; None if the window has no other place.
        outside: whether the trees fit best outside of the window, farther than the uncertainty of the pose explains.
    """

    pose: SE2
    covariance: NDArray[np.float64]
    evidence: float
    near: float
    apart: float
    repeated: float
    rival: tuple[SE2, float] | None
    outside: bool

    @property
    def chance_logit(self) -> float:
        """Log-odds that this place is right, and not a coincidence."""
        return window_chance_logit(self.near)

    @property
    def rival_logit(self) -> float:
        """Log-odds that this place is right, and neither a rival in the window nor a repetition of the forest."""
        return window_rival_logit(self.near, max(self.apart, self.repeated))

    @property
    def logit(self) -> float:
        """Log-odds that this place is right."""
        return window_logit(self.near, self.apart, self.repeated)

    def refusal(self, gate: float) -> Refusal | None:
        """Why the place must not be reported as matched; `gate`: see `Options.gate`."""
        if self.logit >= gate:
            return "outside_prior" if self.outside else None
        if self.evidence <= 0.0:
            return "verification_failed"
        return "rival_too_close" if self.chance_logit >= gate > self.rival_logit else "below_gate"


def match_window(search: WindowSearch) -> WindowMatch:
    """Search a window, and judge its best place. Raises DeadlinePassed."""
    window = search.here()
    posterior, best = window.posterior, window.poses[window.posterior.argmax()]
    here = _is_same(window.poses, best)
    near = float(np.logaddexp.reduce(posterior[here]))
    apart = float(np.logaddexp.reduce(posterior[~here])) if not here.all() else -math.inf
    rival = None
    if not here.all():
        other = int(np.where(here, -math.inf, posterior).argmax())
        rival = (_pose(window.poses[other]), float(window.evidence[other]))
    fine, settled = _around(search, best)
    mean, covariance = _moments(fine.poses, fine.posterior)
    # The trees alone, because a narrow prior draws the pose to itself, even from many standard deviations away.
    held = not settled or not search.region.allows(*_moments(fine.poses, fine.evidence))
    outside = held or not np.isfinite(search.region.log_density(mean[None]))[0]
    evidence = float(window.evidence[window.posterior.argmax()])
    return WindowMatch(_pose(mean), covariance, evidence, near, apart, repetition(search), rival, bool(outside))


def repetition(search: WindowSearch) -> float:
    """Logarithm of posterior over chance of a window that surely does not hold the observation.

    It is that of the second of the decoys: a single one may fit by chance, because the trees near the axis of a mirror
    image stay where they are. Raises DeadlinePassed.
    """
    sums = sorted((float(np.logaddexp.reduce(decoy.posterior)) for decoy in search.decoys()), reverse=True)
    return sums[1]


def _is_same(poses: NDArray[np.float64], best: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which poses (P, 3) are at the place of `best` (3,)."""
    turn = np.abs((poses[:, 2] - best[2] + 3.0 * math.pi) % (2.0 * math.pi) - math.pi)
    return np.asarray((np.hypot(*(poses[:, :2] - best[:2]).T) < DECISION.same) & (turn <= DECISION.same_turn))


def _moments(poses: NDArray[np.float64], log: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean (3,) and covariance (3, 3) of poses (P, 3) of a fine grid; `log`: logarithms (P,) of their weights."""
    weights = np.exp(log - log.max())
    weights /= weights.sum()
    mean = weights @ poses
    off = poses - mean
    steps = np.array([DECISION.fine, DECISION.fine, DECISION.fine_turn])
    return mean, (off * weights[:, None]).T @ off + np.diag(steps**2 / 12.0)


def _around(search: WindowSearch, best: NDArray[np.float64]) -> tuple[Window, bool]:
    """A fine grid about the pose near `best` (3,) that the trees fit best, in the window or not; and whether that pose
    is within the grid, and not at its rim."""
    line = DECISION.fine * np.arange(-DECISION.fine_steps, DECISION.fine_steps + 1)
    turns = DECISION.fine_turn * np.arange(-DECISION.fine_turns, DECISION.fine_turns + 1)
    grid = np.stack(np.meshgrid(line, line, turns, indexing="ij"), axis=-1).reshape(-1, 3)
    rim = (np.abs(grid) >= np.abs(grid).max(axis=0)).any(axis=1)
    middle = best
    for _ in range(_MOVES):
        fine = search.around(middle + grid)
        top = int(fine.evidence.argmax())
        if not rim[top]:
            return fine, True
        middle = fine.poses[top]
    return fine, False


def _pose(row: NDArray[np.float64]) -> SE2:
    return SE2(float(row[0]), float(row[1]), float(row[2]))


def decide_within(query: Query, submap: Features, places: Mapping[int, SE2], match: WindowMatch) -> Recognition:
    """The answer for the best place of a window, reported in the submap that has most partners there.

    Args:
        submap: the trees of the map that were searched.
        places: `map_T_submap` of the submaps they are from, frames as posted.
    """
    map_T_query = SE2.shift(submap.origin) @ match.pose @ SE2.shift(query.features.origin).inverse()
    refused = match.refusal(query.gate)
    found = {key: _paired(query, key, place, map_T_query) for key, place in places.items()}
    key = max(found, key=lambda one: (len(found[one].residuals), -one))
    verified = replace(found[key], evidence=match.evidence)
    if len(verified.residuals) < 2:
        return unsearched("no_proposal", query.trace.done())
    if refused is None and len(verified.residuals) < _LEAST_PAIRS:
        refused = "verification_failed"
    # On the scale of the other candidates, so that the same gates apply.
    odds = match.chance_logit / CALIBRATION.chance.slope + CALIBRATION.chance.even
    lead = match.near - max(match.apart, match.repeated)
    plain = make_candidate(Proposal(key, "given", len(verified.residuals), verified), query, None)
    uncertainty = _in_submap(match.covariance, places[key], plain.transform, query.features.origin)
    candidate = replace(
        plain,
        uncertainty=uncertainty,
        log_odds=odds,
        lead=lead,
        confidence=1.0 / (1.0 + math.exp(-match.logit)),
        refused=refused,
        warnings=("far_origin",) if uncertainty.is_far(plain.transform) else (),
    )
    verdict: Verdict = "no_match" if refused else "matched"
    rivals: tuple[Rival, ...] = ()
    if refused == "rival_too_close":
        verdict = "ambiguous"
        if match.rival is not None:
            pose, evidence = match.rival
            there = places[key].inverse() @ SE2.shift(submap.origin) @ pose @ SE2.shift(query.features.origin).inverse()
            pairs = _paired(query, key, places[key], places[key] @ there)
            rivals = (Rival(key, there, evidence, len(pairs.residuals)),)
    stages, end = query.trace.done(), query.trace.end("window")
    return Recognition(verdict, refused or "verified", (candidate,), rivals, lead, stages, (_finding(candidate),), end)


def _finding(one: Candidate) -> Finding:
    inliers = len(one.residuals)
    return Finding(one.level, one.key, one.support, inliers, one.overlap_count, one.evidence, one.log_odds, one.refused)


def _paired(query: Query, key: int, map_T_submap: SE2, map_T_query: SE2) -> PoseEvidence:
    """The partners of the query's trees in one submap, under a pose in the map."""
    submap_T_query = map_T_submap.inverse() @ map_T_query
    centred = SE2.shift(query.submaps.features(key).origin).inverse() @ submap_T_query
    there = centred @ SE2.shift(query.features.origin)
    return evidence_of_pose(query.grid, query.submaps.grid(key), there, GRID.loose * query.reach)


def _in_submap(
    covariance: NDArray[np.float64], map_T_submap: SE2, submap_T_query: SE2, middle: NDArray[np.float64]
) -> PoseUncertainty:
    """The uncertainty of `submap_T_query`, from the covariance of the observation's `middle` along the map's axes."""
    turn = np.eye(3)
    turn[:2, :2] = SE2(0.0, 0.0, -map_T_submap.yaw).apply(np.eye(2)).T
    return PoseUncertainty.about_point(middle, submap_T_query, turn @ covariance @ turn.T)
