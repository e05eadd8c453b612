"""Pose graphs of simulated drives with drift and false loops: what is kept, how far off the poses are, how long."""

import time
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.pool import Pool
from urquhart.mapping.optimisation import optimise
from urquhart.mapping.pose_arrays import compose, congruent, inverse, rotations, squared_distances, wrapped
from urquhart.mapping.pose_graph import PoseConstraints

Poses = NDArray[np.float64]

SIZES: Final = (120, 1000)
DRIFTS: Final = (0.01, 0.03, 0.05)
"""Share of the distance by which odometry is off, as one standard deviation of each step."""
FALSE: Final = (0.0, 0.1, 0.3)
SPACING: Final = 12.0
"""Metres between submaps."""
LANE: Final = 20.0
"""Metres between lanes."""
REACH: Final = 26.0
"""Metres within which two submaps match: half of the trees of a view of 25 m are then in both."""
LOOP: Final = (0.04, 0.04, 0.002)
"""Metres and radians: standard deviations of a match, as those of 60 trees with 0.15 m of noise are."""
TURN: Final = 0.3
"""Radians of heading for each unit of drift: at 3 % a step turns the robot by half a degree."""
REACHED: Final = 0.6
"""Share of the pairs within reach that match."""
TOGETHER: Final = 3
"""False loops in a row that agree with each other, where they come in groups: the same wrong place, seen thrice."""


@dataclass(frozen=True, slots=True)
class GraphJob:
    """One drive: submaps, drift, share of false loops, whether these come in groups that agree, seed."""

    submaps: int
    drift: float
    false: float
    grouped: bool
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedDrive:
    """Constraints of a drive, the true poses (S, 3), those by odometry alone, and which constraints are false."""

    constraints: PoseConstraints
    truth: Poses
    odometry: Poses
    false: NDArray[np.bool_]


def simulate(job: GraphJob) -> SimulatedDrive:
    """A robot drives lanes up and down a square, then lanes across them."""
    rng = np.random.default_rng([job.seed, job.submaps, round(1000 * job.drift), round(100 * job.false)])
    truth = lanes(job.submaps, rng)
    chain = np.column_stack([np.arange(job.submaps - 1), np.arange(1, job.submaps)])
    near = cKDTree(truth[:, :2]).query_pairs(REACH, output_type="ndarray").astype(np.int64)
    near = near[(np.diff(near, axis=1)[:, 0] > 1) & (rng.random(len(near)) < REACHED)]
    pairs = np.concatenate([chain, near])
    trusted = np.arange(len(pairs)) < len(chain)
    step = np.array([job.drift * SPACING, job.drift * SPACING, job.drift * TURN])
    sigma = np.where(trusted[:, None], step, np.array(LOOP))
    poses = compose(compose(inverse(truth[pairs[:, 0]]), truth[pairs[:, 1]]), rng.normal(size=sigma.shape) * sigma)
    false = np.zeros(len(pairs), np.bool_)
    false[rng.permutation(np.flatnonzero(~trusted))[: round(job.false * len(near))]] = True
    _falsify(pairs, poses, np.flatnonzero(false), truth, job.grouped, rng)
    covariances = congruent(rotations(poses[:, 2]), sigma[:, :, None] ** 2 * np.eye(3))
    constraints = PoseConstraints(
        pairs[:, 0], pairs[:, 1], poses, np.zeros((len(pairs), 2)), covariances, trusted, trusted & ~trusted
    )
    odometry = truth[:1].repeat(job.submaps, axis=0)
    for i in range(job.submaps - 1):
        odometry[i + 1] = compose(odometry[i : i + 1], poses[i : i + 1])[0]
    return SimulatedDrive(constraints, truth, odometry, false)


def lanes(submaps: int, rng: np.random.Generator) -> Poses:
    """True poses (S, 3): lanes up and down a square, then lanes across, with some noise in position and heading."""
    side = SPACING * max(3.0, np.sqrt(submaps * LANE / SPACING / 2.0))
    ends = np.arange(0.0, side + 1e-9, LANE)
    up = [(x, y) for k, x in enumerate(ends) for y in ((0.0, side) if k % 2 == 0 else (side, 0.0))]
    across = [(x, y) for k, y in enumerate(ends[::-1]) for x in ((side, 0.0) if k % 2 == 0 else (0.0, side))]
    corners = np.array([*up, *across])
    walked = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    at = np.arange(submaps) * SPACING % walked[-1]
    xy = np.column_stack([np.interp(at, walked, corners[:, k]) for k in range(2)])
    xy += rng.normal(0.0, 1.0, xy.shape)
    return np.column_stack([xy, rng.uniform(-np.pi, np.pi, submaps)])


def _falsify(
    pairs: NDArray[np.int64],
    poses: Poses,
    false: NDArray[np.int64],
    truth: Poses,
    grouped: bool,
    rng: np.random.Generator,
) -> None:
    """Make constraints false, in place: random submaps at random poses; in groups, neighbours at one wrong place."""
    size = TOGETHER if grouped else 1
    for group in np.array_split(false, max(1, len(false) // size)):
        first, second = (rng.integers(0, len(truth) - size, 2)).tolist()
        if abs(first - second) < 2 * size:
            second = (first + 2 * size + 1) % (len(truth) - size)
        wrong = np.array([[*rng.uniform(-20.0, 20.0, 2), rng.uniform(-np.pi, np.pi)]])
        for k, edge in enumerate(group.tolist()):
            i, j = first + k % size, second + k % size
            pairs[edge] = i, j
            # As if the second place lay at `wrong` in the first one.
            there = compose(compose(truth[first : first + 1], wrong), inverse(truth[second : second + 1]))
            exact = compose(compose(inverse(truth[i : i + 1]), there), truth[j : j + 1])
            poses[edge] = compose(exact, rng.normal(size=(1, 3)) * np.array([LOOP]))[0]


def run_job(job: GraphJob) -> dict[str, float]:
    """Optimise one drive."""
    made = simulate(job)
    began = time.perf_counter()
    found = optimise(job.submaps, made.constraints)
    seconds = time.perf_counter() - began
    truth = compose(inverse(made.truth[:1]).repeat(job.submaps, axis=0), made.truth)
    before = compose(inverse(made.odometry[:1]).repeat(job.submaps, axis=0), made.odometry)
    off = found.poses - truth
    off[:, 2] = wrapped(off[:, 2])
    refused = np.array([reason is not None for reason in found.refusals])
    right = ~made.false & ~made.constraints.trusted
    return {
        "loops": float((~made.constraints.trusted).sum()),
        "false": float(made.false.sum()),
        "false_kept": float((made.false & ~refused).sum()),
        "right_refused": float((right & refused).sum()),
        "parts": float(len(found.in_map)),
        "before": float(np.hypot(*(before - truth)[:, :2].T).mean()),
        "after": float(np.hypot(*off[:, :2].T).mean()),
        "nees": float(squared_distances(off[1:], found.covariances[1:]).mean()) if len(found.in_map) == 1 else np.nan,
        "seconds": seconds,
    }


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Every size, drift, share of false loops, alone and in groups."""
    sizes = SIZES[:1] if quick else SIZES
    jobs = [
        GraphJob(size, drift, false, grouped, seed + k)
        for size in sizes
        for drift in DRIFTS
        for false in FALSE
        for grouped in ((False,) if false == 0.0 else (False, True))
        for k in range(3 if quick else 20 if size < 500 else 1)
    ]
    results = pool.map(run_job, jobs, "drives")
    rows: list[dict[str, Any]] = []
    cells = list(dict.fromkeys((job.submaps, job.drift, job.false, job.grouped) for job in jobs))
    for cell in cells:
        some = [
            result
            for job, result in zip(jobs, results, strict=True)
            if (job.submaps, job.drift, job.false, job.grouped) == cell
        ]
        size, drift, false, grouped = cell
        row: dict[str, Any] = {"submaps": size, "drift": drift, "share": false, "grouped": grouped, "drives": len(some)}
        row |= {name: sum(one[name] for one in some) for name in ("loops", "false", "false_kept", "right_refused")}
        row |= {name: float(np.nanmean([one[name] for one in some])) for name in ("before", "after", "nees", "seconds")}
        row |= {"whole": sum(one["parts"] == 1 for one in some), "worst": max(one["after"] for one in some)}
        rows.append(row)
    return {"rows": rows, "picture": _picture(seed)}


def _picture(seed: int) -> dict[str, Any]:
    """One drive before and after, as lists."""
    job = GraphJob(120, 0.03, 0.3, True, seed)
    made = simulate(job)
    found = optimise(job.submaps, made.constraints)
    ends = [
        [int(a), int(b), bool(false), reason is not None]
        for a, b, false, trusted, reason in zip(
            made.constraints.first,
            made.constraints.second,
            made.false,
            made.constraints.trusted,
            found.refusals,
            strict=True,
        )
        if not trusted
    ]
    origin = made.truth[:1].repeat(job.submaps, axis=0)
    back = compose(inverse(found.poses[:1]).repeat(job.submaps, axis=0), found.poses)
    after = compose(origin, back)
    return {
        "truth": np.round(made.truth[:, :2], 2).tolist(),
        "before": np.round(made.odometry[:, :2], 2).tolist(),
        "after": np.round(after[:, :2], 2).tolist(),
        "loops": ends,
    }
