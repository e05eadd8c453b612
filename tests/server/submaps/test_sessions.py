"""A session as a whole: all submaps of a drive are deleted at once."""

import httpx
import pytest

from server.checks.all_checks import inspect
from tests.server.factories import forest, observed

URL = "/v1/collections/drives"


@pytest.fixture
def drives(client: httpx.Client) -> httpx.Client:
    client.put(URL, json={}).raise_for_status()
    for number, (name, session) in enumerate([("a", "mon day/1"), ("b", "mon day/1"), ("c", "tue"), ("d", None)]):
        body = {"xy": observed(forest(number), number)[0], "session": session}
        client.put(f"{URL}/submaps/{name}", json=body).raise_for_status()
    return client


def test_all_submaps_of_a_session_are_deleted_under_one_revision(drives: httpx.Client) -> None:
    before = drives.get(URL).json()
    key = {"Idempotency-Key": "once"}
    for _ in range(2):
        assert drives.delete(f"{URL}/sessions/mon%20day%2F1", headers=key).status_code == 204
    after = drives.get(URL).json()
    assert after["revision"] == before["revision"] + 1
    assert [one["id"] for one in drives.get(f"{URL}/submaps").json()["submaps"]] == ["c", "d"]
    assert [one["session"] for one in drives.get(f"{URL}/sessions").json()["sessions"]] == ["tue"]
    seen = observed(forest(0), 9)[0]
    assert drives.post(f"{URL}/queries", json={"xy": seen}).json()["verdict"] == "no_match"
    again = drives.delete(f"{URL}/sessions/mon%20day%2F1")
    assert again.status_code == 404 and "session" in again.json()["detail"]
    assert drives.delete("/v1/collections/none/sessions/tue").status_code == 404
    assert list(inspect(drives.app.state.service.database)) == []  # type: ignore[attr-defined]
