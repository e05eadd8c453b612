"""Bulk ingest: the same whatever process describes, durable batch by batch, refusals that say where."""

import gc
import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson
import pytest
from pydantic import ValidationError
from sqlalchemy import select

from server.checks.database import discrepancies
from server.collections import crud
from server.config.settings import Limits
from server.errors import InvalidBody, InvalidLandmarks, MalformedBody, NotFound, TooLarge
from server.platform import worker_process
from server.platform.process_pool import ProcessPool
from server.schemas.collections import CollectionPut
from server.schemas.submaps import NamedSubmap, SubmapInput
from server.store.sqlite.database import Database
from server.store.tables import CollectionRow, SubmapRow
from server.submaps import writes
from server.submaps.bulk_ingest import BatchResult, LineOptions, ingest_lines, ingest_many
from server.submaps.described_batches import Batch, BlankLines, cut, describers, line_of, read_line
from server.submaps.preparation import Prepared, reconcile
from tests.server.factories import forest, points
from tests.server.forked import ForkedWorkers
from tests.server.platform import job_helpers
from urquhart import Config

ROOT = Path(__file__).parents[3]
POSE = {"x": 1.5, "y": -2.25, "yaw": 0.1, "covariance": [0.1, 0, 0, 0, 0.1, 0, 0, 0, 1e-3]}


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPool]:
    """Two processes beside this one, that describe."""
    with pytest.MonkeyPatch.context() as patched, describers(3, patience=0.0) as workers:
        patched.setattr(worker_process, "_SPAWN", ForkedWorkers)
        job_helpers.start(workers)
        yield workers


@pytest.fixture
def plots(database: Database) -> Database:
    """A database with the empty collections `plots` and `other`."""
    for name in ("plots", "other"):
        crud.ensure(database, name, CollectionPut())
    return database


def body(name: str, seed: int, **fields: Any) -> dict[str, Any]:
    return {"id": name, "xy": points(forest(seed, 30)), **fields}


def varied() -> list[NamedSubmap]:
    """All that a submap can have, in both forms."""
    trees = [
        {"x": x, "y": y, "id": f"t{i}", "species": "Picea abies", **({"dbh_cm": 10.0 + i} if i % 3 else {})}
        for i, (x, y) in enumerate(points(forest(1, 30)))
    ]
    bodies: list[dict[str, Any]] = [
        body("plain", 0),
        {"id": "trees", "landmarks": trees, "map_pose": POSE, "session": "s"},
        body("offset", 2, stamp="2026-05-04T11:30:00.25+02:00", frame_id="f"),
        body("utc", 3, stamp="2026-05-04T09:30:00Z", properties={"a": [1, 2.0, None, {"b": "ü"}], "c": None}),
        body("names", 4, ids=[f"n{i}" for i in range(30)], map_pose=None, properties={}),
        body("default-names", 5, ids=[str(i) for i in range(30)]),
        body("integers", 6) | {"xy": [[0, 0], [10, 0], [0, 10], [7, 9], [20, 21]]},
        {"id": "bare", "landmarks": [{"x": x, "y": y} for x, y in points(forest(7, 30))]},
    ]
    return [NamedSubmap.model_validate(one) for one in bodies]


def rows(database: Database, collection: str) -> list[dict[str, Any]]:
    """All that is stored of a collection's submaps but keys and times of writing."""
    names = {column.name for column in SubmapRow.__table__.columns} - {"key", "collection_key", "created", "updated"}
    every = select(*(SubmapRow.__table__.c[name] for name in sorted(names))).order_by(SubmapRow.key)
    mine = SubmapRow.collection_key == select(CollectionRow.key).where(CollectionRow.id == collection).scalar_subquery()
    with database.read_connection() as connection:
        return [dict(row) for row in connection.execute(every.where(mine)).mappings()]


def sums(results: Iterable[BatchResult]) -> tuple[int, int, int, int, int]:
    every = list(results)
    return (
        sum(one.created for one in every),
        sum(one.replaced for one in every),
        sum(one.unchanged for one in every),
        sum(len(one.refused) for one in every),
        sum(one.landmarks for one in every),
    )


def test_a_line_is_read_as_the_submap_that_it_was_made_of() -> None:
    for submap in varied():
        again = read_line(line_of(submap), Limits())
        assert Prepared(submap.id, again, Limits()).etag == Prepared(submap.id, submap, Limits()).etag
        assert again == submap


@pytest.mark.parametrize("batch_size", [1, 3, 500])
def test_it_is_the_same_whatever_process_describes(plots: Database, pool: ProcessPool, batch_size: int) -> None:
    here = list(ingest_many(plots, "plots", varied(), batch_size=batch_size, workers=describers(1)))
    there = list(ingest_many(plots, "other", varied(), batch_size=batch_size, workers=pool))
    assert here == there
    assert sums(here) == (8, 0, 0, 0, 6 * 30 + 5 + 30)
    assert rows(plots, "plots") == rows(plots, "other")
    lines = [line_of(submap) for submap in varied()]
    for workers in (describers(1), pool):
        assert sums(ingest_lines(plots, "other", lines, LineOptions(batch_size=batch_size, workers=workers)))[:3] == (
            0,
            0,
            8,
        )
    assert list(discrepancies(plots)) == []


def test_features_are_made_only_for_other_trees(plots: Database, pool: ProcessPool) -> None:
    list(ingest_many(plots, "plots", varied(), workers=pool))
    before = {row["id"]: row for row in rows(plots, "plots")}
    moved = [submap.model_copy(update={"session": "later"}) for submap in varied()]
    (result,) = ingest_many(plots, "plots", moved, workers=pool)
    assert (result.replaced, result.revision) == (8, 2)
    for row in rows(plots, "plots"):
        assert (row["session"], row["revision"], row["content_revision"]) == ("later", 2, 1)
        assert row["features"] == before[row["id"]]["features"]


def test_of_an_id_that_comes_again_the_last_stands(plots: Database, pool: ProcessPool) -> None:
    seeds = [0, 1, 1, 0, 2, 0]
    for workers in (describers(1), pool):
        writes.put(plots, "plots", "a", SubmapInput.model_validate({"xy": points(forest(0, 30))}), Limits())
        again = [NamedSubmap.model_validate(body("a", seed)) for seed in seeds]
        results = list(ingest_many(plots, "plots", again, batch_size=1, workers=workers))
        assert [one.replaced for one in results] == [0, 1, 0, 1, 1, 1]
        assert [one.unchanged for one in results] == [1, 0, 1, 0, 0, 0]
        (result,) = ingest_many(plots, "plots", [*again, NamedSubmap.model_validate(body("a", 3))], workers=workers)
        assert (result.replaced, result.unchanged, result.landmarks) == (5, 2, 7 * 30)
        assert list(discrepancies(plots)) == []


def test_what_was_described_early_is_made_to_fit_what_is_there_by_now(plots: Database) -> None:
    config = Config()

    def prepared(seed: int, **fields: Any) -> Prepared:
        return Prepared("a", SubmapInput.model_validate({"xy": points(forest(seed, 30)), **fields}), Limits())

    def stored(seed: int) -> Any:
        writes.put(plots, "plots", "a", SubmapInput.model_validate({"xy": points(forest(seed, 30))}), Limits())
        with plots.read() as tx:
            key = crud.get_collection(tx, "plots").key
            return tx.submaps(key).identities(["a"])["a"]

    whole = prepared(0).record(None, config)
    known = stored(0)
    bare = prepared(0, session="s").record(known, config)
    assert (bare.features, bare.counts) == (None, whole.counts)
    assert reconcile(bare, known, config) == bare
    # Other trees took its place, or it is gone: the features have to be made after all.
    for now in (stored(1), None):
        settled = reconcile(bare, now, config)
        assert settled == replace(bare, features=whole.features)
    # Somebody else stored the same trees: the features are there.
    assert reconcile(whole, stored(0), config).features is None


def test_a_refused_line_says_which_and_why(plots: Database, pool: ProcessPool) -> None:
    good = orjson.dumps(body("good", 0))
    lines = [
        good,
        b"",
        b"{]",
        orjson.dumps({"id": "no trees"}),
        b"  \n",
        orjson.dumps({"id": "flat", "xy": [[0, 0], [1, 1], [2, 2]]}),
        orjson.dumps(body("typo", 1, colour="red", sesion="s")),
        b"[1, 2]",
        orjson.dumps(body("much", 2, properties={"a": "x" * 20_000})),
        orjson.dumps({"xy": points(forest(0))}),
        b'{"id": "nan", "xy": [[NaN, 1], [2, 3], [4, 5]]}',
        orjson.dumps(body("last", 3)),
    ]
    for workers in (describers(1), pool):
        for batch_size in (2, 500):
            results = list(ingest_lines(plots, "plots", lines, LineOptions(batch_size=batch_size, workers=workers)))
            refused = [one for result in results for one in result.refused]
            assert sum(result.submaps for result in results) == 10
            assert [(one.position, one.submap_id, type(one.error)) for one in refused] == [
                (2, None, MalformedBody),
                (3, "no trees", InvalidBody),
                (5, "flat", InvalidLandmarks),
                (6, "typo", InvalidBody),
                (7, None, InvalidBody),
                (8, "much", TooLarge),
                (9, None, InvalidBody),
                (10, None, MalformedBody),
            ]
            typo, unnamed = refused[3].error, refused[6].error
            assert isinstance(typo, InvalidBody) and isinstance(unnamed, InvalidBody)
            assert (typo.entries[0]["pointer"], typo.entries[0]["code"]) == ("/colour", "extra_forbidden")
            assert str(typo) == "2 values are wrong; `errors` lists each with its place."
            assert str(unnamed) == "/id: is required"
    assert [row["id"] for row in rows(plots, "plots")] == ["good", "last"]


def test_a_collection_that_is_not_there_is_an_error_from_any_process(plots: Database, pool: ProcessPool) -> None:
    for workers in (describers(1), pool):
        with pytest.raises(NotFound, match="'nope'"):
            list(ingest_lines(plots, "nope", [orjson.dumps(body("a", 0))], LineOptions(workers=workers)))


def test_batches_end_by_number_and_by_weight() -> None:
    numbered = list(enumerate(range(10)))
    batches = list(cut(range(10), 4, lambda _: 1))
    assert batches == [Batch(numbered[:4], 4), Batch(numbered[4:8], 8), Batch(numbered[8:], 10)]
    heavy = list(cut(range(5), 4, lambda item: 3 * 1024 * 1024 if item > 1 else 1))
    assert heavy == [Batch(numbered[:4], 4), Batch(numbered[4:5], 5)]
    assert list(cut([], 4, len)) == []
    blanks: list[str | BlankLines] = [BlankLines(3), "a", BlankLines(10**9), "b", "c", BlankLines(7)]
    assert list(cut(blanks, 2, lambda _: 1, first=5)) == [
        Batch([(8, "a"), (10**9 + 9, "b")], 10**9 + 10),
        Batch([(10**9 + 10, "c")], 10**9 + 18),
    ]


SCRIPT = """
import sys
from pathlib import Path
from server.submaps.described_batches import describers, line_of
from server.submaps.bulk_ingest import LineOptions, ingest_lines
from server.store.sqlite.database import Database
from tests.server.forked import ForkedWorkers
from tests.server.platform import job_helpers
from tests.server.submaps.test_bulk_ingest import body
import itertools, orjson
if __name__ == "__main__":
    workers = describers(3, patience=0.0)
    job_helpers.start(workers)
    print(*workers.pids, flush=True)
    lines = (orjson.dumps(body(f"s{i}", i % 7)) for i in itertools.count())
    total = 0
    for batch in ingest_lines(Database(Path(sys.argv[1])), "plots", lines, LineOptions(batch_size=20, workers=workers)):
        total += batch.created
        print(total, flush=True)
"""


def test_kill_loses_nothing_that_was_told_and_leaves_no_process(plots: Database, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    with subprocess.Popen(
        [sys.executable, script, plots.path],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    ) as process:
        assert process.stdout is not None
        pids = [int(pid) for pid in process.stdout.readline().split()]
        told = [int(process.stdout.readline()) for _ in range(5)]
        process.send_signal(signal.SIGKILL)
        told += [int(line) for line in process.stdout.read().split("\n")[:-1]]
    assert told[:5] == [20, 40, 60, 80, 100]
    job_helpers.until(lambda: all(map(job_helpers.gone, pids)))
    stored = {row["id"] for row in rows(plots, "plots")}
    assert stored == {f"s{i}" for i in range(len(stored))}
    assert told[-1] <= len(stored) <= told[-1] + 20
    assert list(discrepancies(plots)) == []


def test_lines_that_are_refused_leave_nothing_in_memory(database: Database) -> None:
    crud.ensure(database, "plots", CollectionPut())
    # Of each kind: what no field allows, what a check of ours refuses, what is no JSON, what is no forest.
    kinds = [b'{"id": "a", "xy": 5}', b'{"id": "a b", "xy": []}', b'{"id": 1', b'{"id": "a", "xy": [[1, 2]]}']

    def refusals() -> int:
        gc.collect()
        return sum(isinstance(one, ValidationError) for one in gc.get_objects())

    before = refusals()  # of tests that went before
    results = list(ingest_lines(database, "plots", kinds * 50, LineOptions(workers=describers(1))))
    assert sum(len(result.refused) for result in results) == 200
    del results
    assert refusals() <= before


def test_refused_lines_hold_no_functions_that_hold_them(plots: Database) -> None:
    """Such cycles are left to the garbage collector, and while it looks through thousands nobody is answered."""
    kinds = [b'{"id": "a", "xy": 5}', b'{"id": "a b", "xy": []}', b'{"id": 1', b'{"id": "a", "xy": [[1, 2]]}']
    results = list(ingest_lines(plots, "plots", kinds * 20, LineOptions(workers=describers(1))))
    errors = [refusal.error for result in results for refusal in result.refused]
    assert len(errors) == 80
    assert [error.__traceback__ for error in errors] == [None] * 80
