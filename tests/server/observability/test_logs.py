"""The log: one line for each request, in either format, that nobody can forge and that tells no secret."""

import io
import json
import logging
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import pytest
from fastapi import FastAPI

from server.config.settings_groups import LogSettings
from server.observability import logs, request_notes
from server.security import api_keys
from server.security.authenticator import Authenticator
from server.security.principal import Scope
from server.service_parts import Service
from tests.server.factories import forest, points, put_submap
from tests.server.served import Served

LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z (DEBUG|INFO|WARNING|ERROR)\s+\S+: .*")


def written(format_: str, level: str = "info") -> io.StringIO:
    """Where the log goes from now on."""
    stream = io.StringIO()
    logs.configure(LogSettings.model_validate({"format": format_, "level": level}), stream)
    return stream


def requests(stream: io.StringIO) -> list[dict[str, Any]]:
    """The lines of requests."""
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    return [line for line in lines if line["logger"] == logs.ACCESS]


def test_a_request_is_a_line(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    stream = written("json")
    body = json.dumps({"xy": points(forest(1))})
    headers = {"Content-Type": "application/json", "X-Request-Id": "robot-7"}
    answer = client.post("/v1/collections/plots/queries", content=body, headers=headers)
    (line,) = requests(stream)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", line.pop("time"))
    assert line.pop("ms") >= 0
    stages = line.pop("stages")
    assert line == {
        "level": "info",
        "logger": "access",
        "request_id": "robot-7",
        "method": "POST",
        "route": "/v1/collections/{collection}/queries",
        "path": "/v1/collections/plots/queries",
        "status": 200,
        "address": "testclient",
        "bytes_in": len(body),
        "bytes_out": line["bytes_out"],
        "key": "",
        "collection": "plots",
        "verdict": "matched",
    }
    assert line["bytes_out"] > 0
    told = {stage["name"]: stage["milliseconds"] for stage in answer.json()["stages"]}
    assert stages == pytest.approx(told, abs=0.001)


def test_lines_are_the_requests_own(client: httpx.Client) -> None:
    stream = written("json")
    client.post("/v1/collections/plots/queries", json={"xy": [[0, 0]]}).raise_for_status()
    client.get("/v1/collections")
    client.head("/livez")
    client.get("/nope")
    query, listing, head, lost = requests(stream)
    assert (query["verdict"], "verdict" in listing) == ("no_match", False)
    assert (head["method"], head["bytes_out"]) == ("HEAD", 0)
    assert (lost["status"], lost["route"]) == (404, "unmatched")


def test_several_queries_of_a_request_are_summed() -> None:
    noted = request_notes.begin()
    assert noted.log_members() == {}
    request_notes.note_query("matched", [("vote", 1.0), ("verify", 2.0)])
    assert noted.log_members() == {"verdict": "matched", "stages": {"vote": 1.0, "verify": 2.0}}
    request_notes.note_query("no_match", [("vote", 0.5)])
    assert noted.log_members() == {"verdicts": {"matched": 1, "no_match": 1}, "stages": {"vote": 1.5, "verify": 2.0}}


def test_keys_are_told_by_id_and_secrets_not_at_all(client: httpx.Client, app: FastAPI, service: Service) -> None:
    secret, info = api_keys.make(service.database, "robot", [Scope.READ], ["*"])
    # What was known of keys a moment ago is forgotten.
    app.state.authenticator = Authenticator(service.settings, service.database)
    stream = written("json", "debug")
    key = {"Authorization": f"Bearer {secret}"}
    assert client.get("/v1/collections/plots", headers=key).status_code == 200
    assert client.delete("/v1/collections/plots", headers=key).status_code == 403
    forged = f"{secret[:-1]}{'a' if secret[-1] != 'a' else 'b'}"
    assert client.get("/v1/collections/plots", headers={"Authorization": f"Bearer {forged}"}).status_code == 401
    xy = points(forest(3))
    client.post("/v1/collections/plots/queries?key=hunter2", json={"xy": xy}, headers=key)
    assert [line["key"] for line in requests(stream)] == [info.id, info.id, "", info.id]
    text = stream.getvalue()
    for hidden in (secret.rsplit("_", 1)[1], forged.rsplit("_", 1)[1], "Bearer", "hunter2", str(xy[0][0])):
        assert hidden not in text


FORGED = "/v1/a%0a2026-01-01T00:00:00.000Z INFO    access: GET /%0d%1b[31m%e2%80%a8%c2%85"


def test_nobody_writes_lines_but_us(client: httpx.Client) -> None:
    for format_ in ("json", "text"):
        stream = written(format_)
        client.get(FORGED)
        text = stream.getvalue()
        assert len(text.splitlines()) == 1
        assert "\x1b" not in text
    assert LINE.fullmatch(text.rstrip("\n"))
    assert "\\n2026-01-01" in text


def test_tracebacks_are_indented_and_cannot_forge_a_line() -> None:
    stream = written("text")
    try:
        raise ValueError("one\n2026-01-01T00:00:00.000Z INFO    access: two\x1b[31m")
    except ValueError:
        logging.getLogger("server").exception("it failed\nbadly")
    first, *rest = stream.getvalue().splitlines()
    assert LINE.fullmatch(first)
    assert first.endswith("it failed\\nbadly")
    assert len(rest) >= 3
    assert all(line.startswith("    ") for line in rest)
    assert "\x1b" not in stream.getvalue()
    stream = written("json")
    try:
        raise ValueError("one\ntwo")
    except ValueError:
        logging.getLogger("server").exception("it failed")
    (line,) = stream.getvalue().splitlines()
    assert "ValueError: one\ntwo" in json.loads(line)["exception"]


def test_what_is_no_unicode_is_written_all_the_same() -> None:
    for format_ in ("json", "text"):
        stream = written(format_)
        logging.getLogger("server").info("half a pair: \ud800")
        assert "ud800" in stream.getvalue()
        stream.getvalue().encode()


def test_long_paths_are_cut(client: httpx.Client) -> None:
    stream = written("json")
    client.get("/" + "x" * 5000)
    (line,) = requests(stream)
    assert len(line["path"]) < 300


def test_levels(client: httpx.Client) -> None:
    stream = written("json", "warning")
    client.get("/livez")
    logging.getLogger("server.x").info("unheard")
    assert stream.getvalue() == ""
    logging.getLogger("uvicorn.error").warning("heard")
    assert json.loads(stream.getvalue())["logger"] == "uvicorn.error"
    assert not logging.getLogger("uvicorn.access").hasHandlers()


def test_errors_of_the_service_are_warnings(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = written("json", "warning")
    service.readiness.report("shutdown", "stopping")
    assert client.get("/readyz").status_code == 503
    (line,) = requests(stream)
    assert (line["level"], line["status"]) == ("warning", 503)


def test_every_line_of_every_process_is_json(tmp_path: Path) -> None:
    served = Served(tmp_path, "--workers", "2", URQUHART_LOG__FORMAT="json")
    try:
        for _ in range(20):
            httpx.get(f"{served.url}/v1/limits")
        served.signal()
        assert served.wait() == 0
    finally:
        served.close()
    lines = [json.loads(line) for line in served.log.read_text().splitlines()]
    assert sum(line.get("path") == "/v1/limits" for line in lines) == 20
    assert any(line["logger"] == "uvicorn.error" for line in lines)


def test_standard_error_is_where_it_goes_by_default(capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure(LogSettings())
    logging.getLogger("server").info("here")
    assert "here" in capsys.readouterr().err


def parsed(line: str) -> dict[str, Any]:
    """The fields of a text line, as a program would read them: parted by spaces, quoted as JSON where need be."""
    _, _, told = line.partition(f"{logs.ACCESS}: ")
    tokens = re.findall(r'(?:[^\s"]|"(?:[^"\\]|\\.)*")+', told)
    fields: dict[str, Any] = dict(zip(("method", "path", "status", "ms"), tokens, strict=False))
    fields |= dict(token.split("=", 1) for token in tokens[5:])
    return {name: json.loads(value) if value.startswith('"') else value for name, value in fields.items()}


@pytest.mark.parametrize(
    "path",
    [
        "/v1/collections/x key=abc status=200",
        '/v1/collections/x" key="abc',
        "/v1/collections/x\\",
        "/v1/collections/x\u00a0key=abc",
        "/v1/collections/x\u2028key=abc",
        "/a=b",
        "/nothing 200 3.1 ms request_id=forged",
        "/ü",
    ],
)
def test_a_value_is_no_two_fields(client: httpx.Client, path: str) -> None:
    stream = written("text")
    client.get(quote(path), headers={"X-Request-Id": "robot-7"})
    (line,) = stream.getvalue().splitlines()
    fields = parsed(line)
    assert fields["path"] == path
    assert (fields["method"], fields["request_id"]) == ("GET", "robot-7")
    assert fields["status"] in ("404", "422")
    assert set(fields) <= {
        "method",
        "path",
        "status",
        "ms",
        "request_id",
        "route",
        "bytes_out",
        "collection",
        "address",
    }
