"""Pages of submaps: what a filter chooses, in order, by the index that has it."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from sqlalchemy import event

from server.store.repositories import submaps as store
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.store.submap_records import Place, SubmapFilter, SubmapMetadata, SubmapRecord
from tests.server.factories import put_submap

PLOTS = "/v1/collections/plots"
START = datetime(2026, 5, 1, tzinfo=UTC)


def record(i: int, rng: np.random.Generator) -> SubmapRecord:
    """A submap of 3 to 9 trees somewhere at some time, or nowhere and never; one in a hundred is very wide."""
    x, y = rng.uniform(-500.0, 500.0, 2)
    width = 900.0 if i % 100 == 7 else float(rng.uniform(10.0, 60.0))
    frame = str(rng.choice(["map", "other"]))
    place = Place(frame, x, y, 0.0, None, x - width / 2, y - 20.0, x + width / 2, y + 20.0)
    trees = int(rng.integers(3, 10))
    return SubmapRecord(
        id=f"s{i}",
        frame_id=None,
        session=None if rng.random() < 0.2 else f"d{rng.integers(5)}",
        stamp=None if rng.random() < 0.2 else START + timedelta(hours=float(rng.uniform(0, 100))),
        landmark_count=trees,
        polygon_count=0,
        counts={},
        place=None if rng.random() < 0.2 else place,
        properties=None,
        landmarks_hash="h",
        etag=f"e{i}",
        landmarks=bytes(16 * trees),
        landmark_ids=None,
        attributes=None,
        features=b"",
    )


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Database, list[SubmapRecord]]]:
    """400 submaps of one collection among those of another; the records are by key, less one."""
    database = Database(tmp_path_factory.mktemp("pages") / "pages.db")
    migrations_runner.upgrade(database)
    rng = np.random.default_rng(5)
    records = [record(i, rng) for i in range(400)]
    with database.write() as tx:
        for name in ("plots", "others"):
            tx.collections.create(name, title=None, config={}, fingerprint="f", crs=None, origin=None)
        for i in range(0, 400, 20):
            tx.submaps(1).insert(records[i : i + 20], 1)
            tx.submaps(2).insert([record(1000 + i, rng)], 1)
    yield database, records
    database.dispose()


def chosen(one: SubmapRecord, by: SubmapFilter) -> bool:
    """Whether a submap is chosen, said without SQL."""
    place, stamp = one.place, one.stamp
    if by.bbox is not None:
        min_x, min_y, max_x, max_y = by.bbox
        if place is None or not (place.map_min_x <= max_x and place.map_max_x >= min_x):
            return False
        if not (place.map_min_y <= max_y and place.map_max_y >= min_y):
            return False
    return (
        (by.session is None or one.session == by.session)
        and (by.map_frame_id is None or (place is not None and place.map_frame_id == by.map_frame_id))
        and (by.since is None or (stamp is not None and stamp >= by.since))
        and (by.until is None or (stamp is not None and stamp <= by.until))
    )


def a_filter(rng: np.random.Generator, records: list[SubmapRecord]) -> SubmapFilter:
    bbox = None
    if rng.random() < 0.5:
        (x, y), (w, h) = rng.uniform(-600, 600, 2), rng.uniform(0, 400, 2) * (rng.random() < 0.8)
        bbox = (float(x), float(y), float(x + w), float(y + h))
        edge = records[int(rng.integers(len(records)))].place
        if edge is not None and rng.random() < 0.5:  # touched by a footprint's very edge
            bbox = (edge.map_max_x, edge.map_max_y, edge.map_max_x + float(w), edge.map_max_y + float(h))
    since, until = (
        START + timedelta(hours=float(rng.uniform(-10, 110))) if rng.random() < 0.3 else None for _ in range(2)
    )
    return SubmapFilter(
        session=f"d{rng.integers(6)}" if rng.random() < 0.3 else None,
        bbox=bbox,
        map_frame_id=str(rng.choice(["map", "other", "none"])) if rng.random() < 0.5 else None,
        since=since,
        until=until,
    )


@pytest.mark.parametrize("stretch", [3, 1000])
def test_pages_hold_what_is_chosen_in_order(
    filled: tuple[Database, list[SubmapRecord]], stretch: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "_STRETCH", stretch)
    database, records = filled
    rng = np.random.default_rng(stretch)
    sizes = set()
    with database.read() as tx:
        submaps = tx.submaps(1)
        keys = submaps.keys([one.id for one in records])
        for _ in range(150):
            by, limit = a_filter(rng, records), int(rng.integers(1, 60))
            expected = [one.id for one in records if chosen(one, by)]
            seen, after = list[str](), 0
            while rows := submaps.page(by, SubmapMetadata, after_key=after, limit=limit):
                assert len(rows) <= limit
                seen += [row.id for row in rows]
                after = rows[-1].key
            assert seen == expected, by
            assert submaps.matching(by) == {keys[name] for name in expected}
            sizes.add(len(expected))
    assert 0 in sizes and len(sizes) > 30


@pytest.mark.parametrize(
    ("by", "index"),
    [
        (SubmapFilter(), "ix_submaps_collection_key "),
        (SubmapFilter(session="d1"), "ix_submaps_collection_key_session"),
        (SubmapFilter(since=START, until=START + timedelta(hours=1)), "ix_submaps_collection_key_stamp"),
        (SubmapFilter(bbox=(0.0, 0.0, 9.0, 9.0), map_frame_id="map"), "map_min_x>? AND map_min_x<?"),
        (SubmapFilter(bbox=(0.0, 0.0, 9.0, 9.0)), "COVERING INDEX ix_submaps_footprint"),
        (SubmapFilter(map_frame_id="map"), "map_frame_id=?"),
    ],
)
def test_filters_are_answered_by_their_index(tmp_path: Path, by: SubmapFilter, index: str) -> None:
    database = Database(tmp_path / "plans.db")
    migrations_runner.upgrade(database)
    database.dispose()
    said: list[str] = []
    event.listen(database.engine, "connect", lambda connection, _: connection.set_trace_callback(said.append))
    with database.read() as tx:
        tx.submaps(1).page(by, SubmapMetadata, limit=10)
    last = [statement for statement in said if " submaps" in statement][-1]
    with database.read_connection() as connection:
        plan = [row[-1] for row in connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {last}").all()]
    assert index in plan[0]
    assert all("SCAN" not in step for step in plan)
    database.dispose()


def test_pages_lose_nothing_while_others_write(client: httpx.Client) -> None:
    for i in range(6):
        put_submap(client, "plots", f"p{i}", i).raise_for_status()
    seen: list[str] = []
    url = f"{PLOTS}/submaps?limit=2"
    for step in range(4):
        page = client.get(url)
        seen += [one["id"] for one in page.json()["submaps"]]
        if step == 0:
            client.delete(f"{PLOTS}/submaps/p1").raise_for_status()  # the one that the cursor stands at
            client.delete(f"{PLOTS}/submaps/p2").raise_for_status()
            put_submap(client, "plots", "p0", 9).raise_for_status()
            put_submap(client, "plots", "late", 7).raise_for_status()
        if "next" not in page.links:
            break
        url = page.links["next"]["url"]
    assert seen == ["p0", "p1", "p3", "p4", "p5", "late"]


def test_a_page_that_is_just_full_is_the_last(client: httpx.Client) -> None:
    for i in range(4):
        put_submap(client, "plots", f"p{i}", i, session="a" if i < 2 else "b").raise_for_status()
    for url, rows in (("submaps?limit=4", 4), ("submaps?limit=2&session=b", 2), ("sessions?limit=2", 2)):
        page = client.get(f"{PLOTS}/{url}")
        body: dict[str, Any] = page.json()
        assert len(body[url.split("?")[0]]) == rows
        assert "next" not in body
        assert "Link" not in page.headers


def test_sessions_count_what_they_saw(filled: tuple[Database, list[SubmapRecord]]) -> None:
    database, records = filled
    with database.read() as tx:
        found = tx.sessions(1).page("", 10)
        later = tx.sessions(1).page("d2", 1)
    assert [one.session for one in found] == ["d0", "d1", "d2", "d3", "d4"]
    for one in found:
        own = [record for record in records if record.session == one.session]
        stamps = [record.stamp for record in own if record.stamp is not None]
        assert (one.submaps, one.landmarks) == (len(own), sum(record.landmark_count for record in own))
        # Stored to the microsecond.
        assert abs(one.first - min(stamps)) < timedelta(microseconds=2) if one.first else not stamps
        assert abs(one.last - max(stamps)) < timedelta(microseconds=2) if one.last else not stamps
    assert [one.session for one in later] == ["d3"]
