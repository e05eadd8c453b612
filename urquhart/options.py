"""The options of one search."""

from collections.abc import Collection
from typing import Literal, TypedDict

import numpy as np

from urquhart.budget import Budget

Method = Literal["robust", "paper"]
"""`robust` is this project's search, `paper` the matching of Nardari et al. 2020."""


class SearchOptions(TypedDict, total=False):
    """The keyword arguments of `Recognizer.recognize`; its docstring explains each."""

    limit: int
    method: Method
    exclude: Collection[int]
    only: Collection[int] | None
    rng: np.random.Generator | None
    budget: Budget | None
