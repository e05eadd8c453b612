"""Forests for what is stored and asked here: small, quickly made, each of its own seed, none like another."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_TREES: Final = 60
_RADIUS: Final = 40.0
_APART: Final = 2.0


def forest(*seed: int) -> NDArray[np.float64]:
    """(60, 2) float64, metres: trees in a disc of 40 m, none closer than 2 m to another; no row, no pattern."""
    rng = np.random.default_rng(seed)
    drawn = rng.uniform(-_RADIUS, _RADIUS, (4 * _TREES, 2))
    drawn = drawn[np.hypot(drawn[:, 0], drawn[:, 1]) < _RADIUS]
    apart = np.hypot(*(drawn[:, None] - drawn[None]).transpose(2, 0, 1)) > _APART
    kept: list[int] = []
    for tree in range(len(drawn)):
        if apart[tree, kept].all():
            kept.append(tree)
        if len(kept) == _TREES:
            break
    return drawn[kept]


def body(*seed: int, **members: Any) -> dict[str, Any]:
    """The body of a PUT with a forest, to the millimetre."""
    return {"xy": np.round(forest(*seed), 3).tolist(), **members}
