"""A robot's track through a real stem map, cut into submaps that overlap, each with its own noise, gaps and drift.

Stands in for the paper's two flights (section V-C), whose data are not public: sub-maps of a minute each, mapped one by
one, with partial overlap, position noise, missed trees and a little drift inside each.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

from server.stem_maps.reader import read_stem_map
from urquhart.se2 import SE2

ROOT: Final = Path(__file__).resolve().parents[2]
SHIPPED: Final = ROOT / "data" / "stem_maps"
BESIDE: Final = ROOT.parent / "shared" / "data"
"""Maps that the project may not ship; used where a checkout has them beside it."""
MAPS: Final = {
    "lansing": (SHIPPED / "lansing.csv",),
    "bei": (SHIPPED / "bei.csv",),
    "scbi": (BESIDE / "scbi__a.csv",),
    "fennoscandia_spruce": (BESIDE / "fennoscandia_spruce.csv",),
    "rainier": tuple(
        BESIDE / "rainier" / f"{stand}.csv" for stand in "ab08 ag05 ao03 av02 av14 pp17 tb13 to11".split()
    ),
}
"""Files of each map; the eight stands of rainier are eight maps whose figures are pooled."""

LEVELS: Final = {"5 cm, 95 %": (0.05, 0.95), "10 cm, 90 %": (0.1, 0.9)}
"""Noise of each coordinate of a tree in one submap (metres), and the chance that the submap has it. Real stems stand
about twice as close as the trees of the paper's simulation, and the same noise matters as much more. At the second
level true pairs are left about 0.2 m apart, as the paper's human associations leave theirs (0.17 and 0.21 m)."""
DRIFT: Final = (0.1, math.radians(0.15))
"""Metres and radians: standard deviation of a random walk in position and heading at the end of one submap."""
TREES: Final = 60
"""Trees within the sensor's range, which follows from it and the map's density: forests differ, a view is a view."""
RANGE: Final = (10.0, 50.0)
"""Metres: least and largest range."""
STRETCH, ADVANCE = 1.0, 1.0
"""Ranges: the stretch of track in one submap, and from one submap to the next. Two in a row share about 60 %."""
LANES: Final = 2.5
"""Ranges between the lanes of the track, so that only submaps in a row overlap, as on a flight."""
MOST: Final = 24
"""Submaps of one track."""
LEAST: Final = 12
"""Trees that submaps in a row must share. bei is one species in clumps with nothing between them: where a track leaves
a clump there is nothing to merge by, for people either, and it ends."""
_POSES: Final = 12


@dataclass(frozen=True, slots=True, eq=False)
class TrackSubmap:
    """A submap of a track.

    Attributes:
        xy: (N, 2) float64, metres, its own frame.
        trees: (N,) int64, which tree of the map each landmark is.
        pose: map_T_submap, before drift.
    """

    xy: NDArray[np.float64]
    trees: NDArray[np.int64]
    pose: SE2


def read_maps(names: tuple[str, ...]) -> tuple[dict[str, list[NDArray[np.float64]]], dict[str, str]]:
    """Trees (N, 2), metres, of each file of each map; and for maps that are not there, the reason."""
    maps, missing = {}, {}
    for name in names:
        absent = [path for path in MAPS[name] if not path.exists()]
        if absent:
            missing[name] = f"no {absent[0].relative_to(ROOT.parent)} beside the checkout"
        else:
            # Trees at one point (two in lansing) cannot be told apart by anybody.
            maps[name] = [np.unique(read_stem_map(path).xy, axis=0) for path in MAPS[name]]
    return maps, missing


def sensor_range(trees: NDArray[np.float64]) -> float:
    """Metres, for trees (N, 2): about `TREES` in view, and room for two lanes in the shorter side of the map."""
    density = len(trees) / ConvexHull(trees).volume
    room = float(np.ptp(trees, axis=0).min()) / (LANES + 2.0)
    return min(max(math.sqrt(TREES / (math.pi * density)), RANGE[0]), RANGE[1], room)


def track(trees: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """Corner points (K, 2), metres, of lanes up and down the longer side of the map, a range inside its edge."""
    low, high = trees.min(axis=0) + reach, trees.max(axis=0) - reach
    along = int(np.argmax(high - low))
    corners = []
    lanes = np.arange(low[1 - along], high[1 - along] + 1e-9, LANES * reach)
    for i, across in enumerate(lanes.tolist()):
        ends = (low[along], high[along])[:: 1 if i % 2 == 0 else -1]
        corners += [(end, across) if along == 0 else (across, end) for end in ends]
    return np.array(corners)


def cut(trees: NDArray[np.float64], sigma: float, detection: float, rng: np.random.Generator) -> list[TrackSubmap]:
    """Drive a track through trees (N, 2) once: submaps in the order they were made, with noise as in `LEVELS`."""
    reach = sensor_range(trees)
    corners = track(trees, reach)
    walked = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    starts = np.arange(0.0, walked[-1] - STRETCH * reach, ADVANCE * reach)[:MOST]
    tree = cKDTree(trees)
    submaps = []
    for start in starts.tolist():
        at = np.linspace(start, start + STRETCH * reach, _POSES)
        poses = np.column_stack([np.interp(at, walked, corners[:, k]) for k in range(2)])
        in_view = tree.query_ball_point(poses, reach)
        seen = np.unique(np.concatenate([np.asarray(found, np.int64) for found in in_view]))
        seen = rng.permutation(seen[rng.random(len(seen)) < detection])
        pose = SE2(float(poses[0, 0]), float(poses[0, 1]), float(rng.uniform(-np.pi, np.pi)))
        submaps.append(TrackSubmap(pose.inverse().apply(_place(trees[seen], poses, sigma, rng)), seen, pose))
    return _longest_run(submaps)


def _longest_run(submaps: list[TrackSubmap]) -> list[TrackSubmap]:
    """The longest part of a track in which submaps in a row share `LEAST` trees."""
    runs, run = [], submaps[:1]
    for before, after in pairwise(submaps):
        if len(np.intersect1d(before.trees, after.trees)) < LEAST:
            runs.append(run)
            run = []
        run.append(after)
    return max([*runs, run], key=len)


def _place(
    trees: NDArray[np.float64], poses: NDArray[np.float64], sigma: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Where trees (N, 2), metres, map frame, are put when seen each from the nearest pose (K, 2), which has drifted."""
    nearest = cKDTree(poses).query(trees)[1]
    steps = rng.normal(0.0, 1.0, (len(poses), 3)) / math.sqrt(len(poses))
    drift = np.cumsum(steps, axis=0)[nearest] * np.array([DRIFT[0], DRIFT[0], DRIFT[1]])
    offset, c, s = trees - poses[nearest], np.cos(drift[:, 2]), np.sin(drift[:, 2])
    turned = np.column_stack([c * offset[:, 0] - s * offset[:, 1], s * offset[:, 0] + c * offset[:, 1]])
    return np.asarray(poses[nearest] + turned + drift[:, :2] + rng.normal(0.0, sigma, trees.shape))
