"""What the service's tests share: small forests, observations of them, and a client of the app in this process."""

import warnings
from typing import Any

import httpx
import numpy as np
from numpy.typing import NDArray

from urquhart import SE2

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # the test client announces a successor of httpx
    from fastapi.testclient import TestClient

__all__ = ["Client", "TestClient", "forest", "observed", "points", "put_submap"]

Client = httpx.Client
Points = NDArray[np.float64]


def forest(seed: int, count: int = 60, radius: float = 40.0, spacing: float = 2.0) -> Points:
    """(count, 2) float64, metres: random trees in a disc, none closer than `spacing` to another."""
    rng = np.random.default_rng(seed)
    trees: list[Points] = []
    while len(trees) < count:
        tree = rng.uniform(-radius, radius, 2)
        if np.hypot(*tree) < radius and all(np.hypot(*(tree - other)) > spacing for other in trees):
            trees.append(tree)
    return np.array(trees)


def observed(trees: Points, seed: int, *, sigma: float = 0.05) -> tuple[list[list[float]], SE2]:
    """The trees as seen from another pose with noise, in another order; and submap_T_query."""
    rng = np.random.default_rng(seed)
    submap_T_query = SE2(*(float(value) for value in (*rng.uniform(-20, 20, 2), rng.uniform(-3, 3))))
    seen = submap_T_query.inverse().apply(trees) + rng.normal(0.0, sigma, trees.shape)
    return points(rng.permutation(seen)), submap_T_query


def points(xy: Points) -> list[list[float]]:
    """As JSON."""
    listed: list[list[float]] = xy.tolist()
    return listed


def put_submap(client: httpx.Client, collection: str, submap: str, seed: int, **fields: Any) -> httpx.Response:
    """Store a forest."""
    body = {"xy": points(forest(seed)), **fields}
    return client.put(f"/v1/collections/{collection}/submaps/{submap}", json=body)
