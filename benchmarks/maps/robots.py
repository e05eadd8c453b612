"""Robots that each make a map in a frame of their own: their frames are laid onto each other by matches."""

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.maps.graphs import GraphJob, SimulatedDrive, simulate
from benchmarks.pool import Pool
from urquhart import SE2
from urquhart.mapping.frames.joint import FrameMatches, join_frames
from urquhart.mapping.optimisation import optimise
from urquhart.pose_covariance import PoseUncertainty, compose

CASES: Final = ((2, 120), (10, 240))
"""Robots, and submaps of all of them together."""
FALSE: Final = ((0.0, False), (0.3, False), (0.3, True))
DRIFT: Final = 0.02
WRONG: Final = 3.0
"""Metres: a robot whose submaps are on average farther off than this is joined wrongly; drift explains less."""

Frames = dict[int, list[int]]


@dataclass(frozen=True, slots=True)
class RobotJob:
    """One drive, cut into pieces of equal length: one for each robot."""

    robots: int
    drive: GraphJob


@dataclass(slots=True)
class PlacedSubmaps:
    """Submaps by number: the pose of each in the frame of its robot, and its uncertainty."""

    poses: list[SE2]
    uncertainties: list[PoseUncertainty]


def run_job(job: RobotJob) -> dict[str, float]:
    """Make the maps of all robots, then join frames, those with most matches that agree first."""
    made, size = simulate(job.drive), job.drive.submaps
    robot = np.arange(size) * job.robots // size
    placed = _own_maps(made, robot, job.robots)
    frames: Frames = {r: np.flatnonzero(robot == r).tolist() for r in range(job.robots)}
    while True:
        joints = []
        for to, other in combinations(sorted(frames), 2):
            matches = _matches(made, placed, frames[to], frames[other])
            joined = join_frames(matches)
            if joined.verdict == "joined":
                joints.append((joined.agreeing, -to, -other, joined))
        if not joints:
            break
        _, to, other, joined = max(joints, key=lambda one: one[:3])
        assert joined.pose is not None and joined.uncertainty is not None
        for submap in frames[-other]:
            pose, frame = placed.poses[submap], joined.uncertainty.origin_covariance(joined.pose)
            placed.uncertainties[submap] = compose(joined.pose, frame, pose, placed.uncertainties[submap])
            placed.poses[submap] = joined.pose @ pose
        frames[-to] += frames.pop(-other)
    errors = _errors(made, placed, frames, robot)
    right = len(frames) == 1 and max(errors) < WRONG
    return {
        "frames": float(len(frames)),
        "right": float(right),
        "mapped": float(not right and max(_in_one_map(made, robot)) < WRONG),
        "wrong": float(sum(error >= WRONG for error in errors)),
        "error": float(np.mean(errors)),
        "false": float(made.false.sum()),
    }


def _in_one_map(made: SimulatedDrive, robot: NDArray[np.int64]) -> list[float]:
    """The errors of robots whose submaps become one map; no odometry leads from one robot to another."""
    given, size = made.constraints, len(robot)
    own = ~given.trusted | (robot[given.first] == robot[given.second])
    found = optimise(size, replace(given, **{name: getattr(given, name)[own] for name in given.__slots__}))
    frames: Frames = {part: np.flatnonzero(found.part == part).tolist() for part in range(len(found.in_map))}
    poses = PlacedSubmaps([found.pose(k) for k in range(size)], [])
    errors = _errors(made, poses, frames, robot)
    return errors if len(frames) == 1 else [np.inf]


def _own_maps(made: SimulatedDrive, robot: NDArray[np.int64], robots: int) -> PlacedSubmaps:
    given, placed = made.constraints, PlacedSubmaps([], [])
    for r in range(robots):
        mine = np.flatnonzero(robot == r)
        inside = (robot[given.first] == r) & (robot[given.second] == r)
        some = replace(given, **{name: getattr(given, name)[inside] for name in given.__slots__})
        found = optimise(len(mine), replace(some, first=some.first - mine[0], second=some.second - mine[0]))
        placed.poses += [found.pose(k) for k in range(len(mine))]
        placed.uncertainties += [found.uncertainty(k) for k in range(len(mine))]
    return placed


def _matches(made: SimulatedDrive, placed: PlacedSubmaps, staying: list[int], moving: list[int]) -> FrameMatches:
    """The matches between the submaps of two frames."""
    given, rows = made.constraints, []
    for first, second in ((staying, moving), (moving, staying)):
        between = np.isin(given.first, first) & np.isin(given.second, second) & ~given.trusted
        rows += [(int(edge), first is staying) for edge in np.flatnonzero(between)]
    poses, about, own, shared = [], [], [], []
    ends = np.empty((len(rows), 2), np.int64)
    for number, (edge, forward) in enumerate(rows):
        match = SE2(*given.poses[edge].tolist())
        known = PoseUncertainty.about_point(np.zeros(2), match, given.covariances[edge])
        stayer, mover = int(given.first[edge]), int(given.second[edge])
        if not forward:
            stayer, mover = mover, stayer
            back = _turned(known.covariance, -match.yaw)
            match, known = match.inverse(), PoseUncertainty.about_point(known.target, match.inverse(), back)
        to_T_stayer, from_T_mover = placed.poses[stayer], placed.poses[mover]
        to_T_from = to_T_stayer @ match @ from_T_mover.inverse()
        ends[number] = stayer, mover
        poses.append([to_T_from.x, to_T_from.y, to_T_from.yaw])
        about.append(from_T_mover.apply(known.source[None])[0])
        own.append(_turned(known.covariance, to_T_stayer.yaw))
        here = placed.uncertainties[stayer].covariance_about(to_T_stayer, known.target)
        there = placed.uncertainties[mover].covariance_about(from_T_mover, known.source)
        shared.append(here + _turned(there, to_T_from.yaw))
    count, nothing = len(rows), np.zeros(len(rows), np.bool_)
    return FrameMatches(
        ends[:, 0],
        ends[:, 1],
        np.array(poses).reshape(count, 3),
        np.array(about).reshape(count, 2),
        np.array(own).reshape(count, 3, 3),
        np.array(shared).reshape(count, 3, 3),
        nothing,
    )


def _turned(covariance: NDArray[np.float64], yaw: float) -> NDArray[np.float64]:
    """A covariance (3, 3) along axes turned by `yaw`, radians."""
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turn @ covariance @ turn.T)


def _errors(made: SimulatedDrive, placed: PlacedSubmaps, frames: Frames, robot: NDArray[np.int64]) -> list[float]:
    """Mean distance, metres, of each robot's submaps from their true positions, in the frame of the first submap."""
    truth = [SE2(*pose) for pose in made.truth.tolist()]
    off = np.zeros(len(truth))
    for members in frames.values():
        first = min(members)
        base = truth[first] @ placed.poses[first].inverse()
        for submap in members:
            off[submap] = (base @ placed.poses[submap]).distance(truth[submap])[0]
    return [float(off[robot == r].mean()) for r in range(int(robot.max()) + 1)]


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Two and ten robots, without false matches and with them, alone and in groups."""
    cells = [(robots, submaps, share, grouped) for robots, submaps in CASES for share, grouped in FALSE]
    jobs = [
        RobotJob(robots, GraphJob(submaps, DRIFT, share, grouped, seed + k))
        for robots, submaps, share, grouped in cells
        for k in range(3 if quick else 100)
    ]
    results = pool.map(run_job, jobs, "robots")
    rows = []
    for robots, submaps, share, grouped in cells:
        some = [
            result
            for job, result in zip(jobs, results, strict=True)
            if (job.robots, job.drive.false, job.drive.grouped) == (robots, share, grouped)
        ]
        row: dict[str, Any] = {"robots": robots, "submaps": submaps, "share": share, "grouped": grouped}
        row |= {"drives": len(some)} | {
            name: sum(one[name] for one in some) for name in ("right", "mapped", "wrong", "false")
        }
        row |= {
            "apart": sum(one["frames"] > 1 for one in some),
            "error": float(np.mean([one["error"] for one in some])),
        }
        rows.append(row)
    return {"rows": rows}
