"""Many refused lines make no large results: the first are told in full, others in short, the rest is counted."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app import create_app
from server.config.settings import Limits, Settings
from server.submaps import bulk_ingest
from tests.server.factories import TestClient
from tests.server.jobs.test_jobs import finished, line, results, upload

MOST = 20_000
SLACK = 4_096


@pytest.fixture
def client(tmp_path: Path) -> Iterator[httpx.Client]:
    """A service that tells of refused lines in 20 kB."""
    settings = Settings(database=str(tmp_path / "a.db"), limits=Limits(import_refusal_bytes=MOST))
    with TestClient(create_app(settings)) as started:
        started.put("/v1/collections/plots", json={}).raise_for_status()
        yield started


def told(client: httpx.Client, job: dict[str, Any], what: str) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Lines of results for single lines, and those for several."""
    lines = results(client, job, what)
    return [one for one in lines if "lines" not in one], [one for one in lines if "lines" in one]


@pytest.mark.parametrize("mode", ["continue", "all"])
def test_results_are_bounded_and_every_line_is_accounted_for(client: httpx.Client, mode: str) -> None:
    sent = [b"{}", b"[", b'{"id": "x"}', b'{"id": "y", "xy": 7}'] * 500
    job = finished(client, upload(client, sent, mode=mode))
    assert job["counts"] == {"refused": len(sent)}
    size = len(client.get(job["links"]["results"]).content)
    assert size < MOST + SLACK
    for what in ("results", "errors"):
        single, several = told(client, job, what)
        assert [one["line"] for one in single] == list(range(1, len(single) + 1)), "the first are told one by one"
        assert len(single) + sum(one["lines"] for one in several) == len(sent)
        assert "detail" in single[0]["problem"]
        assert set(single[-1]["problem"]) == {"type", "status", "code"}
        for one in several:
            assert one["outcome"] == "refused"
            assert len(single) < one["line"] <= one["last_line"] <= len(sent)
    kinds = Counter((one["problem"]["type"], one["problem"]["code"]) for one in several)
    assert max(kinds.values()) == 1, "each kind once"
    assert {code for _, code in kinds} >= {"missing", "malformed-json"}


def test_lines_that_are_stored_are_all_told(client: httpx.Client) -> None:
    sent = [b"{}"] * 600 + [line("a", 1)] + [b"{}"] * 600 + [line("b", 2)]
    job = finished(client, upload(client, sent))
    assert job["counts"] == {"created": 2, "refused": 1200}
    single, _ = told(client, job, "results")
    assert [(one["line"], one["id"]) for one in single if one["outcome"] == "created"] == [(601, "a"), (1202, "b")]


def test_few_refusals_are_told_in_full(client: httpx.Client) -> None:
    job = finished(client, upload(client, [b"{}"] * 10))
    single, several = told(client, job, "results")
    assert len(single) == 10
    assert not several
    assert all(one["problem"]["errors"][0]["code"] == "missing" for one in single)


def test_the_count_goes_on_after_a_stop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was told and counted is part of what the job knows when it goes on."""
    settings = Settings(database=str(tmp_path / "a.db"), limits=Limits(import_refusal_bytes=MOST))
    sent = [b"{}"] * 2_000
    stopping = create_app(settings)
    describe, batches = bulk_ingest.describe_lines, 0

    def stop_in_the_middle(database: Any, name: str, lines: Any, options: bulk_ingest.LineOptions) -> Iterator[Any]:
        nonlocal batches
        for batch in describe(database, name, lines, replace(options, batch_size=100)):
            batches += 1
            if batches == 10:
                stopping.state.service.jobs.runner._stopping.set()
            yield batch

    monkeypatch.setattr(bulk_ingest, "describe_lines", stop_in_the_middle)
    with TestClient(stopping) as first:
        first.put("/v1/collections/plots", json={}).raise_for_status()
        accepted = upload(first, sent)
        stopping.state.service.jobs.runner._thread.join(60.0)
        assert first.get(accepted.headers["Location"]).json()["finished"] is None
    with TestClient(create_app(settings)) as second:
        job = finished(second, accepted)
        single, several = told(second, job, "results")
        assert job["counts"] == {"refused": len(sent)}
        assert len(single) + sum(one["lines"] for one in several) == len(sent)
        assert [one["line"] for one in single] == list(range(1, len(single) + 1))
        assert [(one["line"], one["last_line"]) for one in several] == [(len(single) + 1, len(sent))]
