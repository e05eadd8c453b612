"""What the search of one scene finds, as numbers of known truth."""

import math
import time
from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.windows.scenes import Scene
from urquhart import Config, LandmarkError, describe
from urquhart.prior.decision import match_window
from urquhart.prior.region import window_extent
from urquhart.prior.window import WINDOW, search_window
from urquhart.verify.landmark_grid import landmark_grid

RIGHT: Final = (1.5, math.radians(6.0))
"""How far a right pose may be from the true one: metres at the plot's middle, radians. With tree tops that are off by
1 m, the true pose itself is known to half of that."""
FOUND: Final = np.dtype(
    [
        ("inside", np.bool_),  # whether the window holds the plot
        ("right", np.bool_),  # whether the best pose is the plot's
        ("verdict", np.int8),  # position in VERDICTS
        ("near", np.float64),  # as in WindowMatch
        ("apart", np.float64),
        ("repeated", np.float64),
        ("evidence", np.float64),
        ("logit", np.float64),
        ("stems", np.int16),
        ("poses", np.int32),
        ("seconds", np.float32),
    ]
)
"""One search, as a row."""
VERDICTS: Final = ("no_match", "ambiguous", "matched")
MATCHED: Final = 2


def search(scene: Scene, config: Config) -> NDArray[Any] | None:
    """Search one scene; a row of `FOUND`, or None if its trees fix no pose."""
    row = np.zeros((), FOUND)
    began = time.perf_counter()
    try:
        plot = describe(scene.plot, config, scene.diameters)
        middle, radius = window_extent(scene.prior, plot)
        near = np.hypot(*(scene.tops - middle).T) <= radius + WINDOW.around
        about = describe(scene.tops[near], config)
    except LandmarkError:
        return None
    window = search_window((plot, landmark_grid(plot, config.reach)), about, scene.prior)
    found = match_window(window)
    row["seconds"] = time.perf_counter() - began
    refused = found.refusal(config.gate)
    row["verdict"] = MATCHED if refused is None else int(refused == "rival_too_close")
    row["inside"], row["stems"], row["poses"] = scene.truth is not None, len(scene.plot), len(window.poses)
    row["near"], row["apart"], row["repeated"] = found.near, found.apart, found.repeated
    row["evidence"], row["logit"] = found.evidence, found.logit
    if scene.truth is not None:
        true = scene.truth.apply(plot.origin[None])[0] - about.origin
        away = math.hypot(found.pose.x - true[0], found.pose.y - true[1])
        turned = abs(math.remainder(found.pose.yaw - scene.truth.yaw, 2.0 * math.pi))
        row["right"] = away < RIGHT[0] and turned < RIGHT[1]
    return row


def search_all(scenes: Iterable[Scene], config: Config) -> NDArray[Any]:
    """Rows (Q,) of `FOUND`."""
    rows = [row for scene in scenes if (row := search(scene, config)) is not None]
    return np.array(rows, FOUND) if rows else np.empty(0, FOUND)
