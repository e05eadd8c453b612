"""Files that the client's command sends: JSON bodies whole, and files of trees to be read by the service."""

import json
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.client.fake import RECEIPT, RESULT
from urquhart_client import Client, cli
from urquhart_client._protocol.landmark_files import FileError, read_body

TREES = [{"id": "t7", "x": 1.5, "y": 2.5, "dbh_cm": 30.0, "species": "oak"}, {"id": "t8", "x": 3.5, "y": 4.5}]


def stem_map(plots: list[dict[str, Any]]) -> dict[str, Any]:
    """What the service answers for a file."""
    rows = {"read": 2, "skipped": 0, "further_stems": 0, "merged": 0}
    told = {"name": "seen", "understood": "read it all", "rows": rows}
    return {**told, "crs": None, "own_frames": False, "plots": plots}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"xy": [], "xy": [[1, 2]]}', "twice"),
        ('{"landmarks": [{"x": 1, "x": 2}]}', "twice"),
        ('{"xy": [[NaN, 1]]}', "NaN"),
        ('{"xy": [[1, 2]], "sesion": "a"}', "'sesion'"),
        ("[]", "JSON object"),
    ],
)
def test_no_member_of_a_body_is_passed_over(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "seen.json").write_text(text)
    with pytest.raises(FileError, match=told):
        read_body(tmp_path / "seen.json", {"xy", "landmarks", "session"})


class Sent:
    """A service that keeps what it is sent."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.bodies: list[Any] = []
        self.files: list[tuple[dict[str, str], bytes]] = []
        self.answer = stem_map([{"name": None, "landmarks": TREES}])
        monkeypatch.setattr(cli, "Client", lambda url, **_: Client(url, transport=httpx.MockTransport(self)))

    def read(self, request: httpx.Request) -> httpx.Response:
        self.files.append((dict(request.url.params), request.content))
        return httpx.Response(200, json=self.answer)

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if request.url.path == "/v1/stem-maps":
            return self.read(request)
        if request.content:
            self.bodies.append(json.loads(request.content))
        if "queries" in request.url.path:
            return httpx.Response(200, json=RESULT)
        known = {"id": "plots", "fingerprint": "f", "revision": 0}
        return httpx.Response(200, json=RECEIPT if "submaps" in request.url.path else known)


def test_all_that_a_file_holds_is_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sent = Sent(monkeypatch)
    body = {
        "landmarks": [{"id": "a", "x": 1.5, "y": 2.5, "dbh_cm": 30.0, "height_m": 12.0, "species": "oak"}],
        "frame_id": "plot",
        "stamp": "2026-05-04T09:30:00Z",
        "session": "monday",
        "map_pose": {"x": 1.0, "y": 2.0, "yaw": 0.5},
        "properties": {"n": 1},
        "query": {"limit": 1},
    }
    file = tmp_path / "seen.json"
    file.write_text(json.dumps(body))
    assert cli.run(["put", "plots", "p7", str(file)]) == 0
    assert sent.bodies[-1] == body
    assert cli.run(["put", "plots", "p7", str(file), "--session", "other"]) == 2
    table = tmp_path / "seen.xlsx"
    table.write_bytes(b"a workbook")
    assert cli.run(["put", "plots", "p7", str(table), "--session", "monday", "--dbh-unit", "mm", "--skip-bad"]) == 0
    assert sent.files == [({"file": "seen.xlsx", "dbh_unit": "mm", "skip_bad": "true"}, b"a workbook")]
    assert sent.bodies[-1] == {"landmarks": TREES, "session": "monday"}
    assert capsys.readouterr().err.endswith("seen.xlsx: read it all\n")
    assert cli.run(["query", "plots", str(table)]) == 0
    out = capsys.readouterr().out
    assert "in its frame x" in out and "yaw 90.00 deg; in the map 'stand' x 5.000 m" in out
    before = len(sent.bodies)
    sent.answer = stem_map([{"name": name, "landmarks": TREES} for name in "AB"])
    assert cli.run(["put", "plots", "p7", str(table), "--plot", "plot"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), len(sent.bodies)) == ("", 1, before)  # no collection is made for it
    assert "2 plots: choose one with --only, such as 'A'" in err
