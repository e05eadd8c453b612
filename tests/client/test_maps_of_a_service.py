"""The client's calls about constraints and maps, against a service."""

import pytest

from tests.server.factories import forest, observed
from urquhart_client import Client, ProblemError

EDGE = {"from": "a", "to": "b", "x": 1.0, "y": 2.0, "yaw": 0.1, "covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, 1e-4]}


def test_a_frame_is_laid_onto_another(client: Client) -> None:
    client.put_collection("drives")
    for number, name in enumerate("abcdvwxy"):
        seen, pose = observed(forest(1), number)
        frame = "first" if name < "m" else "second"
        at = {"frame_id": frame, "x": pose.x, "y": pose.y + 50.0 * (frame == "second"), "yaw": pose.yaw}
        client.put_submap("drives", name, xy=seen, map_pose=at)
    job = client.wait_for_job(client.merge_frames("drives", "second", "first", apply=True).id)
    told = client.get_merge("drives", job.id)
    assert told["summary"]["verdict"] == "joined"
    assert told["summary"]["transform"]["y"] == pytest.approx(-50.0, abs=0.2)
    assert client.get_submap("drives", "v").map_pose.frame_id == "first"  # type: ignore[union-attr]


def test_constraints_are_found_posted_listed_and_deleted(client: Client) -> None:
    client.put_collection("drives")
    for number, name in enumerate("abc"):
        client.put_submap("drives", name, xy=observed(forest(1), number)[0])
    client.wait_for_job(client.constraints("drives", {"per_submap": 5}).id)
    assert {one.kind for one in client.kept_constraints("drives", page_size=2)} == {"match"}
    assert client.post_odometry("drives", [EDGE]) == 1
    (edge,) = client.kept_constraints("drives", kind="odometry")
    assert (edge.from_id, edge.to_id, edge.state, edge.transform.x) == ("a", "b", "active", 1.0)
    assert client.constraints_as("drives", "g2o").count("EDGE_SE2") == 4
    client.delete_constraint("drives", edge.id)
    with pytest.raises(ProblemError) as refused:
        client.delete_constraint("drives", edge.id)
    assert refused.value.status == 404
    assert len(list(client.kept_constraints("drives", state="active"))) == 3
