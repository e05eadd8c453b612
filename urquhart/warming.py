"""Compilation of the kernels before the first query.

The kernels of the default method are loaded before a service is ready; those of `method="paper"` follow. All of them
come from the cache on the disk if they have been compiled before.
"""

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import compile_for
from urquhart.budget import Budget
from urquhart.config import Config
from urquhart.decide.rivals import find_rivals_at_once
from urquhart.features.describe import Features, describe
from urquhart.prior.prior import Prior
from urquhart.prior.superposition import Stems, superpose
from urquhart.propose.correlation import find_peaks_at_once
from urquhart.recognizer import Recognizer
from urquhart.se2 import SE2
from urquhart.verify.landmark_grid import LandmarkGrid, build_landmark_grid
from urquhart.verify.refinement import refine_rough_at_once


@functools.cache
def warm_up(config: Config) -> None:
    """Compile every kernel of the default method, or load it from the disk cache, so that no query waits for it. Done
    once per process.
    """
    recognizer, places = _collection(config)
    for xy in places:
        recognizer.locate(xy)
    # A survey that tries only a part of the collection takes the rotations from the votes of quads.
    partly, _ = _collection(dataclasses.replace(config, survey=len(places)))
    for xy in places[1:3]:
        partly.locate(xy)
    # A collection of one submap takes another path: the search asks whether the query reaches the submap's ends.
    alone = Recognizer(config)
    alone.add([(0, describe(places[0], config))])
    alone.locate(places[0])
    # A search within a prior scores poses by a kernel of its own, and compares diameters by another. The window is
    # small, because every start waits for it.
    for diameters in (None, np.linspace(10.0, 50.0, len(places[0]))):
        observed = describe(places[0], config, diameters)
        recognizer.recognize_within(observed, Prior.with_sigma(0.0, 0.0, 0.1, 0.0), {0: SE2.identity()})
    # Large observations are processed in portions, by kernels that small ones do not use.
    for xy in (places[0], *places[2:]):
        recognizer.locate(xy, budget=Budget(steps=1_000.0))


@functools.cache
def warm_up_paper(config: Config) -> None:
    """The same for `method="paper"`."""
    recognizer, places = _collection(config)
    for xy in places:
        recognizer.locate(xy, method="paper")
    alone = Recognizer(config)
    alone.add([(0, describe(places[0], config))])
    alone.locate(places[0], method="paper")


def compile_largest() -> None:
    """Compile the largest kernels, in the order in which `warm_up` comes to them.

    Nothing is called, so none has to wait for another: a second process that does this halves the time until all are
    cached.
    """
    points, numbers, pose = np.empty((1, 2)), np.empty(1), np.empty(3)
    diameters, outer, places = np.empty(1, np.float32), np.empty(1, np.int32), np.empty(1, np.int64)
    compile_for(build_landmark_grid, points, diameters, outer, diameters, 1.0)
    cover = np.empty((1, 1), np.uint8)
    grid = LandmarkGrid(points, numbers, points, cover, numbers, places, places, numbers, 1.0, 1.0, numbers, 1.0)
    compile_for(refine_rough_at_once, grid, grid, np.empty((1, 3)), 1.0, 1)
    compile_for(find_rivals_at_once, grid, grid, pose, 1.0, 1.0, 1)
    stems = Stems(points, points, 1.0, 1.0, points, numbers)
    compile_for(superpose, stems, points, numbers, 1.0, points, points)
    compile_for(find_peaks_at_once, points, points, 1.0, 1, 1.0, 1.0)


def _collection(config: Config) -> tuple[Recognizer, list[NDArray[np.float64]]]:
    """A collection, and landmarks (N, 2) to look up in it: two that are stored, one that is not, and rows of trees."""
    rng = np.random.default_rng(0)
    recognizer = Recognizer(config)
    here, elsewhere, unknown = (rng.uniform(-20.0, 20.0, (60, 2)) for _ in range(3))
    # Only rows of trees have rivals.
    rows = 3.0 * np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), axis=-1).reshape(-1, 2)
    features = [describe(here, config), Features.unpack(describe(here, config).pack()), describe(elsewhere, config)]
    # The second segment is merged with the first.
    recognizer.add(enumerate(features))
    recognizer.add([(len(features), describe(rows, config))])
    return recognizer, [here, elsewhere, unknown, rows]


if __name__ == "__main__":
    compile_largest()
    warm_up_paper(Config())
