"""A job that is killed at each kind of point at which something of it reaches the disk.

`Forked("tests.server.jobs.kill_points", [FOLDER, MODE, LINES.ndjson, EACH])` runs an import in processes of its own.
The first is not killed: it notes the kind of each point that it passes. Then one is killed at the last point of each
kind, and if EACH is 2 at the first one, too, each on another copy of the database. After each, another process goes on,
and is killed, too, and a third one. Printed are the kind of each point, and what the job came to in the end: a line of
JSON for each.
"""

import os
import shutil
import signal
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import orjson
from sqlalchemy.engine.default import DefaultDialect

from server.collections import crud
from server.config.settings import Limits, Settings
from server.config.settings_groups import JobSettings
from server.index.live_indexes import LiveIndexes
from server.jobs import folder as job_folder
from server.jobs import queue
from server.jobs.folder import JobFolder
from server.jobs.runner import Runner
from server.jobs.running_job import JobContext
from server.jobs.types import import_submaps
from server.jobs.types.job_types import JOB_TYPES
from server.observability.metrics import Metrics
from server.platform import worker_process
from server.schemas.collections import CollectionPut
from server.security.principal import UNRESTRICTED
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps import bulk_ingest
from tests.server.forked import ForkedWorkers
from tests.server.killed_process import KillPoints, in_a_process

_JOB = "job"
_POINTS = 12
"""Of a process that goes on, those at which it is killed."""


def main(folder: Path, mode: str, lines: Path, each: int) -> None:
    """Kill at `each` (1 or 2) points of each kind."""
    folder.mkdir()
    base = folder / "base"
    in_a_process(partial(_prepare, base / "killed.db", mode, lines.read_bytes()))
    copy, passed = shutil.copytree(base, folder / "whole"), folder / "passed"
    in_a_process(partial(_work, copy / "killed.db", 0, passed))
    kinds = passed.read_text().splitlines()
    numbers = {
        kind: [number for number, one in enumerate(kinds, start=1) if one == kind] for kind in sorted(set(kinds))
    }
    for kind, found in numbers.items():
        for point in {found[-1], found[0]} if each == 2 else {found[-1]}:
            copy = shutil.copytree(base, folder / f"point-{point}")
            assert in_a_process(partial(_work, copy / "killed.db", point)) == -signal.SIGKILL
            # Who goes on is killed as well, now here, now there: a restart has its own points.
            in_a_process(partial(_work, copy / "killed.db", point * 7 % _POINTS + 1))
            in_a_process(partial(_work, copy / "killed.db", 0))
            in_a_process(partial(_tell, copy / "killed.db", kind))


def _prepare(path: Path, mode: str, content: bytes) -> None:
    path.parent.mkdir()
    database = Database(path)
    migrations_runner.upgrade(database)
    crud.ensure(database, "plots", CollectionPut())
    folder = JobFolder(database)
    folder.make()
    folder.input(_JOB).write_bytes(content)
    queue.accept(
        database,
        "plots",
        UNRESTRICTED,
        queue.NewJob("import", {"mode": mode, "on_conflict": "replace"}, _JOB, content.count(b"\n")),
        None,
        Limits(),
    )
    database.dispose()


def _runner(path: Path) -> Runner:
    settings = Settings(database=str(path), jobs=JobSettings(processes=1))
    database, metrics = Database(path), Metrics()
    indexes = LiveIndexes(database, metrics, settings.index)
    return Runner(JobContext(settings, database, indexes, metrics, JobFolder(database)), JOB_TYPES)


def _work(path: Path, point: int, passed: Path | None = None) -> None:
    """Do the job in batches of two lines, as far as to the point of that number; 0: to its end.

    `passed`: where to write the kind of each point.
    """

    def note(kind: str) -> None:
        if passed is not None:
            with passed.open("a") as kinds:
                kinds.write(f"{kind}\n")

    points = KillPoints(point, note)

    def write_half(results: BinaryIO, lines: list[bytes]) -> None:
        before = results.seek(0, os.SEEK_END)
        results.write(b'{"line": 7, "outco')
        results.flush()
        points.reached("half a line")
        results.truncate(before)
        write(results, lines)

    write, describe = import_submaps._write_results, bulk_ingest.describe_lines
    import_submaps._write_results = write_half

    def describe_two(database: Any, name: str, lines: Any, options: Any = bulk_ingest.USUAL) -> Any:
        return describe(database, name, lines, replace(options, batch_size=2))

    bulk_ingest.describe_lines = describe_two  # type: ignore[assignment]
    worker_process._SPAWN = ForkedWorkers  # type: ignore[assignment,misc]
    os.fsync, os.unlink = points.around(os.fsync), points.around(os.unlink)
    DefaultDialect.do_commit = points.around(DefaultDialect.do_commit)  # type: ignore[method-assign]
    runner = _runner(path)
    while runner.run_once():
        pass


def _tell(path: Path, kind: str) -> None:
    job_folder._GRACE = -1.0  # type: ignore[misc]
    runner = _runner(path)
    runner.clean_up()
    context = runner._context
    found = queue.results(context.database, context.folder, UNRESTRICTED, _JOB)
    with found.file as file:
        results = [orjson.loads(line) for line in file.read(found.size).splitlines()]
    job = queue.read(context.database, UNRESTRICTED, _JOB)
    collection, _ = crud.read(context.database, "plots")
    told = {
        "state": job.state,
        "done": job.done,
        "counts": job.counts,
        "results": [(line["line"], line["outcome"]) for line in results],
        "submaps": collection.counts.submaps,
        "files": sorted(file.name for file in context.folder.path.iterdir() if file.suffix != ".lock"),
    }
    print(orjson.dumps([kind, told]).decode())


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]), int(sys.argv[4]))
