"""Compilation of all kernels before the first query."""

import functools

import numpy as np

from urquhart.budget import Budget
from urquhart.config import Config
from urquhart.features.describe import Features, describe
from urquhart.recognizer import Recognizer


@functools.cache
def warm_up(config: Config) -> None:
    """Compile every kernel, or load it from the disk cache, so that no query waits for it. Done once per process."""
    rng = np.random.default_rng(0)
    recognizer = Recognizer(config)
    here, elsewhere, unknown = (rng.uniform(-20.0, 20.0, (60, 2)) for _ in range(3))
    # Only rows of trees have rivals.
    rows = 3.0 * np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), axis=-1).reshape(-1, 2)
    features = [describe(here, config), Features.unpack(describe(here, config).pack()), describe(elsewhere, config)]
    # The second segment is merged with the first.
    recognizer.add(enumerate(features))
    recognizer.add([(len(features), describe(rows, config))])
    for xy in (here, elsewhere, unknown, rows):
        recognizer.locate(xy)
        recognizer.locate(xy, method="paper")
    # A collection of one submap takes another path: the search asks whether the query reaches the submap's ends.
    alone = Recognizer(config)
    alone.add([(0, features[0])])
    alone.locate(here)
    alone.locate(here, method="paper")
    # Large observations are processed in portions, by kernels that small ones do not use.
    portions = Budget(steps=1_000.0)
    for xy in (here, unknown, rows):
        recognizer.locate(xy, budget=portions)
