"""Uploads, jobs, sessions and constraints against the real service; and the command."""

import asyncio
import gzip
import json
from pathlib import Path

import pytest

from tests.server.factories import forest, observed, points
from urquhart_client import AsyncClient, Client, Job, ProblemError, Progress
from urquhart_client.cli import run


@pytest.fixture
def season(tmp_path: Path) -> Path:
    lines = [json.dumps({"id": f"p{i}", "xy": points(forest(i)), "session": "a" if i < 2 else "b"}) for i in range(4)]
    path = tmp_path / "season.ndjson"
    path.write_text("\n".join([*lines, "{"]) + "\n")
    return path


def test_a_season_goes_in_and_is_accounted_for(client: Client, season: Path) -> None:
    client.put_collection("plots")
    told: list[Progress] = []
    job = client.import_file("plots", season, progress=told.append)
    assert (job.state, dict(job.counts)) == ("successful", {"created": 4, "refused": 1})
    assert {progress.phase for progress in told} == {"sending", "storing"}
    assert [line.outcome for line in client.job_results(job.id)] == ["created"] * 4 + ["refused"]
    (refused,) = client.job_errors(job.id)
    assert (refused.line, (refused.problem or {})["status"]) == (5, 400)
    packed = season.with_name("season.ndjson.gz")
    packed.write_bytes(gzip.compress(season.read_bytes()))
    again = client.import_file("plots", packed, on_conflict="skip")
    assert dict(again.counts) == {"unchanged": 4, "refused": 1}
    assert [one.id for one in client.jobs(collection="plots")] == [again.id, job.id]
    assert [(one.session, one.submaps) for one in client.sessions("plots", page_size=1)] == [("a", 2), ("b", 2)]
    assert client.delete_job(again.id) is None
    with pytest.raises(ProblemError):
        client.get_job(again.id)
    assert client.wait_for_job(client.reindex("plots").id, timeout=60).is_successful


def test_one_call_stores_and_asks(client: Client) -> None:
    client.put_collection("plots")
    first = client.post_submap("plots", xy=forest(1), session="monday", query={})
    assert first.query is not None and first.query.verdict == "no_match"
    seen, truth = observed(forest(1), 3)
    second = client.post_submap("plots", xy=seen, session="tuesday", query={"limit": 1}, idempotency_key="k")
    assert second.query is not None and second.query.best is not None
    assert (second.query.verdict, second.query.best.submap_id) == ("matched", first.id)
    assert second.query.best.transform.x == pytest.approx(truth.x, abs=0.1)
    assert client.post_submap("plots", xy=seen, session="tuesday", query={"limit": 1}, idempotency_key="k") == second
    answers = client.query_batch("plots", [{"xy": seen}, {"xy": "no"}])
    assert getattr(answers[0], "verdict", None) == "matched"
    assert isinstance(answers[1], ProblemError)
    visits = client.query("plots", xy=seen, per_session=True)
    assert {one.session for one in visits.candidates} == {"monday", "tuesday"}
    job = client.wait_for_job(client.constraints("plots").id)
    (found,) = json.loads(client.constraints_of(job.id))["constraints"]
    assert {found["from"], found["to"]} == {first.id, second.id}
    assert "EDGE_SE2" in client.constraints_of(job.id, "g2o")
    middle = client.constraints_of(job.id, "g2o_middle")
    assert "EDGE_SE2" in middle
    assert all(len(line.split()) == 5 for line in middle.splitlines() if line.startswith("# "))


def test_the_command(client: Client, season: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    url = client.base_url
    if "127.0.0.1" not in url:
        pytest.skip("the command talks over a socket")

    def said(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        code = run(["--url", url, *map(str, arguments)])
        return code, *capsys.readouterr()

    def refused(*arguments: object) -> str:
        """The one line of a command that fails, without what the service in this process logs at the same time."""
        code, out, err = said(*arguments)
        lines = [line for line in err.splitlines() if line.startswith("urquhart-client: ")]
        assert (code, out, len(lines)) == (2, "", 1), err
        return lines[0]

    code, out, err = said("import", "plots", season)
    assert (code, "4 created, 1 refused" in out, "line 5" in err) == (1, True, True)
    trees = tmp_path / "seen.csv"
    trees.write_text("x,y\n" + "".join(f"{x},{y}\n" for x, y in forest(2)))
    code, out, _ = said("query", "plots", trees)
    assert (code, out.startswith("matched"), "p2" in out) == (0, True, True)
    assert said("put", "plots", "new", trees)[1] == "new: created, revision 2\n"
    code, out, _ = said("--json", "collections")
    assert json.loads(out)["counts"]["submaps"] == 5
    assert "successful" in said("jobs")[1]
    trees.write_text("x,y\n1,two\n")
    for arguments in (("query", "plots", trees), ("query", "nope", season), ("import", "plots", "none.ndjson")):
        refused(*arguments)
    assert "http://127.0.0.1:1/v1/jobs" in refused("--url", "http://127.0.0.1:1", "jobs")


@pytest.mark.parametrize("url", ["http://[::", "http://a:b", "nonsense", "ftp://a", "http://a\nb"])
def test_an_address_that_is_none_is_one_line(capsys: pytest.CaptureFixture[str], url: str) -> None:
    assert run(["--url", url, "jobs"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), err.startswith("urquhart-client: ")) == ("", 1, True)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b'{"xy": ', "Expecting value"),
        (b'{"xy": [[1, "a"]]}', "'a'"),
        (b"[]", "not a JSON object"),
    ],
)
def test_a_file_that_cannot_be_is_one_line_with_its_name(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, content: bytes, told: str
) -> None:
    file = tmp_path / "seen.json"
    file.write_bytes(content)
    assert run(["--url", "http://127.0.0.1:1", "query", "plots", str(file)]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), err.startswith(f"urquhart-client: {file}")) == ("", 1, True), err
    assert told in err


@pytest.mark.parametrize("arguments", [[], ["nope"], ["jobs", "--state", "x"], ["query", "plots"], ["jobs", "--x"]])
def test_arguments_that_cannot_be_are_one_line(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run(arguments)
    out, err = capsys.readouterr()
    assert (ended.value.code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("urquhart-client: ")


def test_the_awaiting_client_sends_a_file(service_url: str, season: Path) -> None:
    async def stored() -> Job:
        async with AsyncClient(service_url) as client:
            await client.put_collection("plots")
            return await client.import_file("plots", season)

    assert dict(asyncio.run(stored()).counts) == {"created": 4, "refused": 1}
