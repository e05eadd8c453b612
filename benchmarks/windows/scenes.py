"""Plots and the maps that they are searched in: real stem maps, as a sensor in the air would see their trees.

The map has the thicker stems rather than the thinner ones, each off by the noise, and some false trees. The plot has
nearly all stems. Its position is known as a GNSS receiver under trees knows it, its heading from a compass or not at
all. Half of the windows do not hold the plot: they lie elsewhere in the same forest.
"""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.tracks import BESIDE, ROOT
from benchmarks.robust.stands import STANDS, read
from urquhart import SE2, Prior
from urquhart.evaluation.simulation import plantation

Points = NDArray[np.float64]

FITTED: Final = ("scbi", "longleaf", "lansing", "boreas_sp", "ab08", "ag05", "ao03", "av02", "hauersteig_1925")
"""Forests that the confidence is fitted on, beside `PLANTED["fitted"]`."""
HELD_OUT: Final = ("bei", "fennoscandia_spruce", "quesnel_treetops", "av14")
"""Forests of the published figures, beside `PLANTED["held out"]` and the plots of `TOPS`."""
PLANTED: Final = {
    "fitted": {"rows 3 x 3": ((3.0, 3.0), 0.25), "rows 4 x 2": ((4.0, 2.0), 0.5), "rows 5 x 5": ((5.0, 5.0), 0.15)},
    "held out": {"rows 3 x 2": ((3.0, 2.0), 0.2), "rows 4 x 4": ((4.0, 4.0), 0.4)},
}
"""Simulated plantations: metres between trees, and how far they stand from their planting points."""
NOISE: Final = (0.3, 0.6, 1.0)
"""Metres: how far each coordinate of a tree is off in the map."""
TOPS: Final = ROOT.parent / "shared" / "cases" / "survey" / "29-als-tops"
"""Twelve plots with simulated tree tops, made by others."""
ELSEWHERE: Final = 22
"""Windows without the plot for each plot and noise of `TOPS`."""
SURVEYED: Final = 0.1
"""Metres: noise of the plot's own survey."""
SEEN: Final = 0.97
"""Share of the stems that the plot's survey has."""
STEMS: Final = (12, 32)
"""Stems of a plot at the mean density of its forest."""
RADIUS: Final = (6.0, 20.0)
"""Metres: least and largest radius of a plot."""
HALF: Final = 75.0
"""Metres: half the side of the square of map that is searched at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Forest:
    """The trees of one map: positions (N, 2), metres, and diameters (N,), centimetres, or None."""

    name: str
    xy: Points
    thick: Points | None


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """One plot, the map that it is searched in, and the truth.

    Attributes:
        plot, diameters: (N, 2), metres, the plot's frame; (N,) or None.
        tops: (T, 2), metres, map frame.
        prior: of `map_T_plot`.
        truth: `map_T_plot`; None if the window does not hold the plot.
    """

    plot: Points
    diameters: Points | None
    tops: Points
    prior: Prior
    truth: SE2 | None


def names(part: str) -> list[str]:
    """The forests of a part (`fitted` or `held out`) whose files are here."""
    real = FITTED if part == "fitted" else HELD_OUT
    return [name for name in real if _path(name).exists()] + list(PLANTED[part])


@lru_cache(maxsize=4)
def forest(name: str, seed: int) -> Forest:
    """The trees of a forest; those that lie on a raster are moved off it."""
    rng = np.random.default_rng([seed, 11, *name.encode()])
    for planted in PLANTED.values():
        if name in planted:
            spacing, jitter = planted[name]
            return Forest(name, plantation(150.0, 150.0, rng, spacing=spacing, jitter=jitter, survival=0.95), None)
    xy, thick = read(_path(name))
    if name == "quesnel_treetops":
        xy = xy + rng.uniform(-1.0, 1.0, xy.shape)
    return Forest(name, xy, thick)


def scenes(name: str, noise: float, *, heading: bool, seed: int, counts: tuple[int, int]) -> Iterator[Scene]:
    """Plots of a forest in windows that hold them, and in windows that do not: so many of each as `counts` says."""
    trees = forest(name, seed)
    rng = np.random.default_rng([seed, 12, int(100 * noise), int(heading), *name.encode()])
    low, high = trees.xy.min(axis=0), trees.xy.max(axis=0)
    density = len(trees.xy) / float(np.prod(high - low))
    for number in range(sum(counts)):
        radius = float(np.clip(math.sqrt(rng.integers(*STEMS) / (math.pi * density)), *RADIUS))
        sigma = float(rng.choice([2.0, 4.0, 6.0])) if heading else 2.0
        inside = number < counts[0]
        for _ in range(100):
            centre = rng.uniform(low + radius, high - radius)
            there = centre if inside else rng.uniform(low + radius, high - radius)
            far = float(np.hypot(*(there - centre)))
            if (inside or far > 4.0 * sigma + 3.0) and _count(trees.xy, centre, radius) >= STEMS[0] // 2:
                break
        else:
            continue
        yaw = float(rng.uniform(-math.pi, math.pi))
        pose = SE2(float(centre[0]), float(centre[1]), yaw)
        plot, diameters = _survey(trees, pose, radius, rng)
        tops = _seen_from_above(trees, there, noise, rng)
        x, y = (there + rng.normal(0.0, sigma, 2)).tolist()
        turn = math.radians(2.0)
        prior = Prior.with_sigma(x, y, sigma, yaw + float(rng.normal(0.0, turn)) if heading else None, turn)
        yield Scene(plot, diameters, tops, prior, pose if inside else None)


def als_scenes(noise: float, *, outside: bool, seed: int) -> Iterator[Scene]:
    """The plots of `TOPS`: each where its receiver says, or if `outside`, in windows elsewhere."""
    tops = _table(TOPS / f"tops_{noise:.1f}.csv", 1, 2)
    low, high = tops.min(axis=0), tops.max(axis=0)
    rng = np.random.default_rng([seed, 13, int(100 * noise)])
    for path in sorted(TOPS.glob("plot_??.csv")):
        plot, thick = _table(path, 1, 2), _table(path, 3)[:, 0]
        known: dict[str, Any] = json.loads(path.with_suffix(".truth.json").read_text(encoding="utf-8"))
        true, gnss = np.array(known["true"]), np.array(known["gnss"])
        truth, turn = SE2(float(true[0]), float(true[1]), 0.0), math.radians(2.0)
        if not outside:
            yield Scene(plot, thick, tops, Prior.with_sigma(float(gnss[0]), float(gnss[1]), 4.0, 0.0, turn), truth)
            continue
        for number in range(ELSEWHERE):
            there, sigma = true, 2.0 if number % 2 else 4.0
            while np.hypot(*(there - true)) < 20.0:
                there = rng.uniform(low + 10.0, high - 10.0)
            yield Scene(plot, thick, tops, Prior.with_sigma(float(there[0]), float(there[1]), sigma, 0.0, turn), None)


def _path(name: str) -> Path:
    return STANDS.get(name, BESIDE / f"{name}__a.csv")


def _table(path: Path, *columns: int) -> Points:
    return np.loadtxt(path, delimiter=",", skiprows=1, usecols=columns, ndmin=2)


def _count(xy: Points, centre: Points, radius: float) -> int:
    return int((np.hypot(*(xy - centre).T) <= radius).sum())


def _survey(trees: Forest, pose: SE2, radius: float, rng: np.random.Generator) -> tuple[Points, Points | None]:
    """The stems of a plot, in its own frame, and their diameters in half of the plots that could have them."""
    near = np.hypot(*(trees.xy - (pose.x, pose.y)).T) <= radius
    near &= rng.random(len(near)) < SEEN
    plot = pose.inverse().apply(trees.xy[near]) + rng.normal(0.0, SURVEYED, (int(near.sum()), 2))
    measured = trees.thick is not None and rng.random() < 0.5
    return plot, trees.thick[near] if measured and trees.thick is not None else None


def _seen_from_above(trees: Forest, centre: Points, noise: float, rng: np.random.Generator) -> Points:
    """The trees of a map about a point, as they are seen from the air."""
    near = (np.abs(trees.xy - centre) <= HALF).all(axis=1)
    xy = trees.xy[near]
    if trees.thick is None:
        seen = np.full(len(xy), rng.uniform(0.6, 0.95))
    else:
        thick = np.nan_to_num(trees.thick[near], nan=0.0)
        rank = np.argsort(np.argsort(-thick, kind="stable"), kind="stable") / max(len(xy), 1)
        seen = 0.02 + 0.95 / (1.0 + np.exp((rank - rng.uniform(0.5, 0.9)) / 0.1))
    tops = xy[rng.random(len(xy)) < seen]
    false = centre + rng.uniform(-HALF, HALF, (int(rng.uniform(0.0, 0.15) * len(tops)), 2))
    false = false[[_count(trees.xy, one, 10.0) > 0 for one in false]] if len(false) else false
    return np.concatenate([tops + rng.normal(0.0, noise, tops.shape), false])
