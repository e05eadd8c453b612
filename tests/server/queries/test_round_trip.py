"""The smallest round trip, over a real socket, and each acknowledged write found at once."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.server.factories import forest, observed, points
from tests.server.processes import Server


def test_put_collection_put_submap_query(serve: Callable[[Path], Server], tmp_path: Path) -> None:
    client = serve(tmp_path / "urquhart.db").client
    trees = forest(7)
    seen, submap_T_query = observed(trees, 8)

    assert client.put("/v1/collections/plots", json={}).status_code == 201
    assert client.put("/v1/collections/plots/submaps/p7", json={"xy": points(trees)}).status_code == 201
    response = client.post("/v1/collections/plots/queries", json={"xy": seen, "limit": 5})

    assert response.status_code == 200
    answer = response.json()
    assert answer["verdict"] == "matched"
    assert answer["reason"] == "verified"
    best = answer["candidates"][0]
    assert best["submap_id"] == "p7"
    transform = best["transform"]
    assert (transform["x"], transform["y"]) == pytest.approx((submap_T_query.x, submap_T_query.y), abs=0.1)
    assert transform["yaw"] == pytest.approx(submap_T_query.yaw, abs=0.01)
    assert np.shape(transform["covariance"]) == (9,)
    assert len(best["inliers"]) == best["inlier_count"] >= 50
    moved = submap_T_query.apply(np.array(seen))
    for pair in best["inliers"]:
        assert np.hypot(*(moved[int(pair["query"])] - trees[int(pair["submap"])])) < 0.5
