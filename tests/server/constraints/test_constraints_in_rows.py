"""Constraints in a plantation, where most submaps fit most others one row or many rows off."""

import httpx
import numpy as np
import orjson

from tests.server.jobs.test_jobs import finished
from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, observe, plantation

URL = "/v1/collections/plots"


def test_no_constraint_in_a_plantation_is_off_by_rows(client: httpx.Client) -> None:
    rng = np.random.default_rng(3)
    trees, poses = plantation(90.0, 90.0, rng, jitter=0.3, survival=0.9), {}
    for number, (x, y) in enumerate((x, y) for x in (20.0, 70.0) for y in (20.0, 34.0, 52.0, 66.0)):
        name, pose = f"s{number}", SE2(x, y, float(rng.uniform(-3.0, 3.0)))
        seen = observe(trees, pose, Sensor(20.0, sigma=0.05, detection=0.95), rng)
        client.put(f"{URL}/submaps/{name}", json={"xy": seen.xy.tolist()}).raise_for_status()
        poses[name] = seen.pose
    job = finished(client, client.post(f"{URL}/constraints", json={}))
    found = [orjson.loads(line) for line in client.get(job["links"]["results"]).content.splitlines()]
    assert len(found) >= 4
    for one in found:
        given = one["transform"]
        truth = poses[one["from"]].inverse() @ poses[one["to"]]
        assert truth.distance(SE2(given["x"], given["y"], given["yaw"]))[0] < 1.0, one
