"""Compiling ahead of the first query."""

import functools

import numpy as np

from urquhart.budget import Budget
from urquhart.config import Config
from urquhart.features.describe import Features, describe
from urquhart.recognizer import Recognizer


@functools.cache
def warm_up(config: Config) -> None:
    """Compile every kernel, or load it from the cache, so that no query has to wait for that; once in a process."""
    rng = np.random.default_rng(0)
    recognizer = Recognizer(config)
    here, elsewhere, unknown = (rng.uniform(-20.0, 20.0, (60, 2)) for _ in range(3))
    # Only rows of trees have rivals to be looked at.
    rows = 3.0 * np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), axis=-1).reshape(-1, 2)
    features = [describe(here, config), Features.unpack(describe(here, config).pack()), describe(elsewhere, config)]
    # The second segment is merged with the first.
    recognizer.add(enumerate(features))
    recognizer.add([(len(features), describe(rows, config))])
    for xy in (here, elsewhere, unknown, rows):
        recognizer.locate(xy)
        recognizer.locate(xy, method="paper")
    # Of a collection with a single submap it is asked first whether the query reaches to its ends.
    alone = Recognizer(config)
    alone.add([(0, features[0])])
    alone.locate(here)
    alone.locate(here, method="paper")
    # What large observations take is cut into portions, which smaller ones are done without.
    portions = Budget(steps=1_000.0)
    for xy in (here, unknown, rows):
        recognizer.locate(xy, budget=portions)
