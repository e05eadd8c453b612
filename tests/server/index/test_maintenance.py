"""Maintenance beside the requests: full disks, back-off, stopping, files left over, several processes."""

import errno
import itertools
import os
import resource
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi import FastAPI
from sqlalchemy import event

from server.app import create_app
from server.collections import crud
from server.config.settings import Settings
from server.config.settings_groups import IndexSettings
from server.index import flushing, maintenance
from server.index.flushing import Stopped
from server.schemas.collections import CollectionPut
from server.service_parts import Service
from tests.server.factories import TestClient, forest, points, put_submap
from tests.server.forked import LoadedProcess
from tests.server.index.index_helpers import Process
from urquhart.index.segment import merge_segments


def value(process: Process, name: str, **labels: str) -> float:
    return process.metrics.registry.get_sample_value(name, labels) or 0.0


def wait_for(condition: Callable[[], bool]) -> None:
    """For something that a thread does."""
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_look_at_many_collections_is_one_look(process: Process) -> None:
    process.put_many(range(5))
    for number in range(40):
        crud.ensure(process.database, f"empty{number}", CollectionPut())
    process.maintenance.run()
    assert process.maintenance.run()
    statements: list[str] = []

    def note(_connection: object, _cursor: object, statement: str, *_: object) -> None:
        statements.append(statement)

    event.listen(process.database.engine, "before_cursor_execute", note)
    try:
        assert process.maintenance.run()
    finally:
        event.remove(process.database.engine, "before_cursor_execute", note)
    assert 0 < len(statements) < 10
    assert process.indexes.live("empty7") is None
    with process.database.read() as tx:
        assert list(tx.all_segments.chains().values()) == [process.chain()]


def test_what_is_in_memory_is_written_when_it_is_much(process: Process) -> None:
    process.put_many(range(3))
    assert process.held() == {"p0", "p1", "p2"}
    process.maintenance.run()
    assert process.chain() == ()
    process.put_many(range(3, 5))
    assert len(process.held()) == 5
    process.maintenance.run()
    assert [(s.since, s.revision, s.submaps) for s in process.chain()] == [(0, 2, 5)]
    live = process.indexes.live("plots")
    assert live is not None and live.state is not None
    assert (live.state.opened, live.state.delta) == (1, ())
    assert value(process, "urquhart_maintenance_runs_total", task="flush") == 1.0
    assert value(process, "urquhart_index_segments", collection="plots") == 1.0
    assert value(process, "urquhart_index_bytes", collection="plots") == process.chain()[0].size
    # In a process that is not asked anything, from the rows.
    silent = Process(process.database.path)
    silent.put_many(range(5, 9))
    silent.maintenance.run()
    assert [s.submaps for s in silent.chain()] == [5, 4]
    process.maintenance.run()
    assert [s.submaps for s in process.chain()] == [9]
    process.agreed()
    silent.close()


def test_the_service_looks_after_its_segments(tmp_path: Path) -> None:
    few = IndexSettings(flush_submaps=2, maintenance_seconds=0.02)
    app = create_app(Settings(database=str(tmp_path / "plots.db"), index=few))
    service: Service = app.state.service
    with TestClient(app) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        for i in range(7):
            put_submap(client, "plots", f"p{i}", i).raise_for_status()
            answer = client.post("/v1/collections/plots/queries", json={"xy": points(forest(i))}).json()
            assert answer["candidates"][0]["submap_id"] == f"p{i}"

        def written() -> bool:
            return 'urquhart_maintenance_runs_total{task="check"}' in client.get("/metrics").text

        wait_for(written)
    assert service.maintenance._thread is not None
    assert not service.maintenance._thread.is_alive()
    with TestClient(create_app(Settings(database=str(tmp_path / "plots.db"), index=few))) as client:
        answer = client.post("/v1/collections/plots/queries", json={"xy": points(forest(3))}).json()
        assert (answer["verdict"], answer["candidates"][0]["submap_id"]) == ("matched", "p3")
    assert not (tmp_path / "plots.db-wal").exists()


def full(*_: Any) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("call", ["os.posix_fallocate", "os.fsync", "pathlib.Path.replace"])
def test_a_full_disk(
    process: Process, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, call: str
) -> None:
    """While segments cannot be written, everything is found; once they can, they are."""
    process.put_many(range(8))
    process.maintenance.flush_and_merge("plots")
    before, files = process.chain(), process.files()
    with monkeypatch.context() as patched:
        patched.setattr(call, full)
        process.put_many(range(8, 13))
        for _ in range(3):
            process.maintenance.run()
        assert process.held() == {f"p{i}" for i in range(13)}
        process.put_many(range(13, 30))  # more than is taken into memory otherwise
        assert process.held() == {f"p{i}" for i in range(30)}
        assert [process.found(i) for i in (3, 10, 20)] == ["p3", "p10", "p20"]
        assert (process.chain(), process.files()) == (before, files)
    assert caplog.text.count("trying again later") == 1
    assert value(process, "urquhart_maintenance_failures_total", task="flush") >= 2.0
    process.maintenance._failures.clear()  # that it waits is another test
    process.maintenance.run()
    assert sum(s.submaps for s in process.chain()) == 30
    assert process.held() == {f"p{i}" for i in range(30)}
    process.agreed()


def test_a_full_disk_while_merging(process: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    process.put_many(range(4))
    process.maintenance.flush_and_merge("plots")
    with monkeypatch.context() as patched:
        patched.setattr(maintenance, "merge", full)
        process.put_many(range(4, 8))
        process.held()
        process.maintenance.run()
        assert [s.submaps for s in process.chain()] == [4, 4]
        assert process.found(5) == "p5"
    assert value(process, "urquhart_maintenance_failures_total", task="merge") == 1.0
    process.maintenance._failures.clear()
    process.maintenance.run()
    assert [s.submaps for s in process.chain()] == [8]
    process.agreed()


def test_a_full_disk_when_the_list_is_to_be_written(process: Process) -> None:
    """The database has no page left for the row: the file goes again."""
    process.put_many(range(8))
    process.held()
    with process.database.read_connection() as connection:
        pages = connection.exec_driver_sql("PRAGMA page_count").scalar()
    process.close()  # all connections take the limit again
    connect = process.database._connect

    def limited() -> Any:
        connection = connect()
        connection.execute(f"PRAGMA max_page_count = {pages}")
        return connection

    process.database._connect = limited  # type: ignore[method-assign,assignment]
    process.database.engine = process.database._make_engine()
    process.maintenance.run()
    assert process.held() == {f"p{i}" for i in range(8)}
    assert len(process.files()) == len(process.chain())
    process.agreed()


def _in_files_that_may_not_grow(path: Path) -> None:
    """Maintain an index, first where no file may become half as large as the database, then where it may."""
    process = Process(path)
    size = max(one.stat().st_size for one in path.parent.glob("bare.db*") if one.is_file())
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size // 2, resource.RLIM_INFINITY))
    process.maintenance.run()
    assert process.held() == {f"p{i}" for i in range(40)}, process.held()
    assert process.found(17) == "p17"
    assert process.chain() == () and process.files() == [], process.files()
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    process.maintenance._failures.clear()
    process.maintenance.flush_and_merge("plots")
    assert sum(s.submaps for s in process.chain()) == 40
    process.agreed()


def test_files_may_not_grow(process: Process) -> None:
    """The kernel refuses, as it does on a full disk, whatever way the file is written."""
    process.put_many(range(40))
    with process.database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE submaps SET properties = NULL")
    process.close()
    limited = LoadedProcess(target=_in_files_that_may_not_grow, args=(process.database.path,))
    limited.start()
    limited.join(120.0)
    assert limited.exitcode == 0


def test_what_fails_is_tried_again_later_and_later(
    process: Process, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    now = [1000.0]
    monkeypatch.setattr("server.index.maintenance.time", SimpleNamespace(monotonic=lambda: now[0]))
    tried: list[float] = []

    def fail(*_: object, **__: object) -> int:
        tried.append(now[0])
        raise PermissionError(errno.EACCES, "Permission denied")

    process.put_many(range(5))
    with monkeypatch.context() as patched:
        patched.setattr(maintenance, "flush", fail)
        for _ in range(2000):
            process.maintenance.run()
            now[0] += 1.0
    waits = [b - a for a, b in itertools.pairwise(tried)]
    assert waits[:4] == [2.0, 4.0, 8.0, 16.0]
    assert max(waits) == 300.0
    assert caplog.text.count("trying again later") == 1
    now[0] += 300.0
    process.maintenance.run()
    assert [s.submaps for s in process.chain()] == [5]


def test_stopping_gives_up_what_is_being_written(process: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    process.put_many(range(8))
    begun, go_on = threading.Event(), threading.Event()

    def slowly(*arguments: Any, **about: Any) -> Any:
        begun.set()
        go_on.wait(30)
        return merge_segments(*arguments, **about)

    monkeypatch.setattr(flushing, "merge_segments", slowly)
    ready = threading.Event()
    process.maintenance.start(ready)
    ready.set()
    assert begun.wait(30)
    began = time.monotonic()
    process.maintenance.stop(0.1)
    assert time.monotonic() - began < 20.0
    go_on.set()
    assert process.maintenance._thread is not None
    process.maintenance._thread.join(30)
    assert (process.chain(), process.files()) == ((), [])
    with pytest.raises(Stopped):
        process.maintenance.flush_and_merge("plots")
    process.indexes.stopping.clear()
    process.maintenance.flush_and_merge("plots")
    process.agreed()


def test_files_left_over_are_removed(process: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    process.put_many(range(5))
    process.maintenance.flush_and_merge("plots")
    folder = process.indexes.folder.path
    for name in ("a.segment", "b.segment.77.tmp", "notes.txt"):
        (folder / name).write_bytes(b"left over")
        os.utime(folder / name, (0, 0))
    (folder / "young.segment").write_bytes(b"about to be listed")
    with process.indexes.folder.lock("merge") as held:
        assert held
        assert process.indexes.folder.clean_up() == 0  # another is at work
    process.maintenance.run()
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        ["flush.lock", "merge.lock", "notes.txt", "young.segment", f"{process.chain()[0].name}.segment"]
    )
    assert process.found(3) == "p3"


def test_one_process_works_and_the_others_take_it_over(process: Process) -> None:
    other = Process(process.database.path)
    process.put_many(range(9))
    assert process.held() == other.held()
    with other.indexes.folder.lock("flush") as held:
        assert held
        process.maintenance.run()
        assert process.chain() == ()
        assert process.found(2) == "p2"
    process.maintenance.run()
    (segment,) = process.chain()
    other.maintenance.run()
    for one in (process, other):
        live = one.indexes.live("plots")
        assert live is not None and live.state is not None
        assert (live.state.chain, live.state.delta) == ((segment,), ())
    other.put_many(range(9, 14))
    other.held()
    with process.indexes.folder.lock("merge"):
        other.maintenance.run()
        assert [s.submaps for s in other.chain()] == [9, 5]
    other.maintenance.run()
    assert [s.submaps for s in process.chain()] == [14]
    assert process.found(10) == "p10"
    process.agreed()
    other.close()


def test_an_app_can_be_started_again(app: FastAPI, service: Service) -> None:
    for _ in range(2):
        with TestClient(app) as client:
            client.put("/v1/collections/plots", json={}).raise_for_status()
            assert not service.indexes.stopping.is_set()
        assert service.indexes.stopping.is_set()
