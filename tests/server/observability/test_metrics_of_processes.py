"""Metrics of several processes, told as one; names that are documented; labels that do not explode."""

import os
import re
import signal
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from server.app import create_app
from server.collections.crud import ensure
from server.config.settings import Settings
from server.errors import StorageBusy
from server.observability import database_gauges
from server.observability.metric_samples import cumulative, from_json, merged, to_json
from server.observability.metrics import Metrics
from server.observability.metrics_exchange import MetricsExchange
from server.schemas.collections import CollectionPut
from server.store.sqlite.database import Database
from tests.server.factories import TestClient, forest, points, put_submap
from tests.server.served import Served, wait_until

ROOT = Path(__file__).parents[3]
Samples = dict[tuple[str, tuple[tuple[str, str], ...]], float]


def parsed(text: str) -> Samples:
    """Every sample by name and labels; none is there twice."""
    found: Samples = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            key = (sample.name, tuple(sorted(sample.labels.items())))
            assert key not in found
            found[key] = sample.value
    return found


def named(samples: Samples, name: str) -> dict[str, float]:
    """By the value of the only label."""
    return {dict(labels).get("collection", ""): value for (one, labels), value in samples.items() if one == name}


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    """Two processes."""
    started = Served(tmp_path, "--workers", "2")
    yield started
    started.close()


def scrape(served: Served) -> Samples:
    """Of whichever process answers."""
    return parsed(httpx.get(f"{served.url}/metrics", timeout=60.0).text)


def limits_asked(samples: Samples) -> float:
    """How often /v1/limits was answered."""
    labels = (("method", "GET"), ("route", "/v1/limits"), ("status", "200"))
    return samples.get(("urquhart_requests_total", labels), 0.0)


def test_all_processes_are_told_by_each_and_nothing_goes_back(served: Served) -> None:
    for _ in range(30):
        assert httpx.get(f"{served.url}/v1/limits").status_code == 200
    wait_until(lambda: limits_asked(scrape(served)) == 30.0, served)
    wait_until(lambda: {limits_asked(scrape(served)) for _ in range(10)} == {30.0}, served)
    assert scrape(served)[("urquhart_processes", ())] == 2.0
    victim = served.workers()[0]
    os.kill(victim, signal.SIGKILL)
    wait_until(lambda: victim not in served.workers() and len(served.workers()) == 2, served)
    wait_until(served.ready, served)
    # What the dead one counted is still there, what it was is not.
    assert {limits_asked(scrape(served)) for _ in range(10)} == {30.0}
    wait_until(lambda: scrape(served)[("urquhart_processes", ())] == 2.0, served)
    for _ in range(10):
        assert httpx.get(f"{served.url}/v1/limits").status_code == 200
    wait_until(lambda: limits_asked(scrape(served)) == 40.0, served)
    assert list(served.temporary.glob("urquhart-metrics-*"))
    served.signal()
    assert served.wait() == 0
    assert list(served.temporary.iterdir()) == []


def test_rows_and_lag_of_the_index(served: Served) -> None:
    client = served.client
    client.put("/v1/collections/plots", json={}).raise_for_status()
    put_submap(client, "plots", "a", 1).raise_for_status()
    client.post("/v1/collections/plots/queries", json={"xy": points(forest(1))}).raise_for_status()
    for number in range(3):
        put_submap(client, "plots", f"b{number}", number).raise_for_status()
    wait_until(lambda: named(scrape(served), "urquhart_index_lag_revisions").get("plots", 0.0) >= 3.0, served)
    samples = scrape(served)
    assert named(samples, "urquhart_submaps") == {"plots": 4.0}
    assert named(samples, "urquhart_landmarks") == {"plots": 240.0}


def test_words_are_read_as_they_were_written() -> None:
    metrics = Metrics()
    metrics.requests.labels("/v1", "GET", "200").inc(3)
    metrics.request_seconds.labels("/v1", "GET").observe(0.003)
    metrics.observe_index('a"b\\c\n', revision=5, submaps=7)
    told = metrics.families()
    assert from_json(to_json(told)) == told
    assert {family.kind for family in cumulative(told)} == {"counter", "histogram"}


def test_several_are_merged_as_their_kind_wants_it() -> None:
    one, two = Metrics(), Metrics()
    for metrics, revision, seconds in ((one, 5, 0.003), (two, 3, 30.0)):
        metrics.verdicts.labels("matched").inc(revision)
        metrics.request_seconds.labels("/v1", "GET").observe(seconds)
        metrics.observe_index("plots", revision=revision, submaps=revision)
        metrics.in_flight.set(revision)
    samples = {
        key: value for family in merged([one.families(), two.families()]) for key, value in family.samples.items()
    }
    assert samples[("urquhart_query_verdicts_total", (("verdict", "matched"),))] == 8.0
    assert samples[("urquhart_requests_in_flight", ())] == 8.0
    assert samples[("urquhart_index_revision", (("collection", "plots"),))] == 3.0
    assert samples[("urquhart_index_submaps", (("collection", "plots"),))] == 5.0
    route = (("route", "/v1"), ("method", "GET"))
    assert samples[("urquhart_request_seconds_count", route)] == 2.0
    assert samples[("urquhart_request_seconds_bucket", (*route, ("le", "0.005")))] == 1.0
    assert samples[("urquhart_request_seconds_bucket", (*route, ("le", "+Inf")))] == 2.0
    assert samples[("urquhart_request_seconds_sum", route)] == pytest.approx(30.003)


def test_the_dead_are_added_to_what_is_past_once(tmp_path: Path) -> None:
    exchange, metrics = MetricsExchange(tmp_path), Metrics()
    metrics.verdicts.labels("matched").inc(4)
    key = ("urquhart_query_verdicts_total", (("verdict", "matched"),))
    for pid in (1, 2):
        exchange.publish(metrics)
        (tmp_path / f"{os.getpid()}.json").rename(tmp_path / f"{pid}.json")
        for _ in range(2):
            exchange.fold_exited({999})
            total = sum(family.samples.get(key, 0.0) for told in exchange.others() for family in told)
            assert total == 4.0 * pid
    assert {path.name for path in tmp_path.iterdir()} == {"past.json", "lock"}
    assert all(family.kind != "gauge" for told in exchange.others() for family in told)


def test_many_collections_are_few_labels(database: Database) -> None:
    for number in range(30):
        ensure(database, f"c{number:02}", CollectionPut())
        with database.write() as tx:
            row = tx.collections.get(f"c{number:02}")
            assert row is not None
            tx.collections.advance(row.key, submaps=number, landmarks=10 * number)
    # One that is called as the rest is told with it.
    ensure(database, "other", CollectionPut())
    with database.write() as tx:
        row = tx.collections.get("other")
        assert row is not None
        tx.collections.advance(row.key, submaps=1000, landmarks=5)
    metrics = Metrics(collections=3)
    for number in range(30):
        metrics.observe_index(f"c{number:02}", revision=1, submaps=number)
    metrics.observe_index("other", revision=1, submaps=1000)
    samples = parsed(database_gauges.exposition(database, metrics, None).decode())
    rest = sum(range(27))
    assert named(samples, "urquhart_submaps") == {"c29": 29, "c28": 28, "c27": 27, "other": rest + 1000}
    assert named(samples, "urquhart_landmarks") == {"c29": 290, "c28": 280, "c27": 270, "other": 10 * rest + 5}
    assert set(named(samples, "urquhart_index_revision")) == {"c29", "c28", "c27"}
    assert samples[("urquhart_collections", ())] == 31.0
    none = parsed(database_gauges.exposition(database, Metrics(collections=0), None).decode())
    assert set(named(none, "urquhart_submaps")) == {"other"}


def test_jobs_are_told_by_state(database: Database) -> None:
    ensure(database, "plots", CollectionPut())
    with database.write() as tx:
        row = tx.collections.get("plots")
        assert row is not None
        jobs = tx.jobs
        made = [
            jobs.add(
                job_id=f"j{number}",
                kind="reindex",
                collection=row,
                caller="",
                parameters={},
                total=None,
            )
            for number in range(4)
        ]
        jobs.change(made[0].id, state="running", started=datetime.now(UTC))
        jobs.change(made[1].id, state="failed", finished=datetime.now(UTC))
    samples = parsed(database_gauges.exposition(database, Metrics(), None).decode())
    told = {labels: value for (name, labels), value in samples.items() if name == "urquhart_jobs"}
    assert told == {(("state", "accepted"),): 2.0, (("state", "running"),): 1.0}


def test_metrics_are_told_without_the_database(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    samples = parsed(database_gauges.exposition(database, Metrics(), None).decode())
    assert samples[("urquhart_database_readable", ())] == 1.0

    def busy(*arguments: object) -> None:
        raise StorageBusy("busy")

    monkeypatch.setattr(database_gauges, "read_sizes", busy)
    samples = parsed(database_gauges.exposition(database, Metrics(), None).decode())
    assert samples[("urquhart_database_readable", ())] == 0.0
    assert ("urquhart_processes", ()) in samples


def test_every_metric_is_documented_and_every_documented_one_is_there(tmp_path: Path) -> None:
    with TestClient(create_app(Settings(database=str(tmp_path / "urquhart.db")))) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        put_submap(client, "plots", "p", 1).raise_for_status()
        client.post("/v1/collections/plots/queries", json={"xy": points(forest(1))}).raise_for_status()
        text = client.get("/metrics").text
    told = dict(re.findall(r"^# TYPE (urquhart_\w+) (\w+)$", text, re.MULTILINE))
    page = (ROOT / "docs/operations.md").read_text(encoding="utf-8")
    documented = dict(re.findall(r"^\| `(urquhart_\w+)` \| (\w+) \|", page, re.MULTILINE))
    assert documented == told
