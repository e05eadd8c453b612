"""A database whose process is ended again and again, at any point: is everything there that was acknowledged?

    python -m benchmarks.crashes --rounds 200

Each round a process stores, replaces and deletes submaps, writes and merges segments, until it is killed (SIGKILL): at
some moment, or at the n-th time that it opens, locks, renames or removes a file. Then the database is opened again:
what was acknowledged must be there and nothing else but the one write that was under way; database and index must
agree; and queries must be answered right.
"""

import argparse
import json
import logging
import multiprocessing
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from server.checks.database import discrepancies
from server.checks.index import index_discrepancies
from server.collections import crud
from server.config.settings_groups import IndexSettings
from server.errors import NotFound
from server.index.index_folder import IndexFolder
from server.index.live_indexes import LiveIndexes
from server.index.maintenance import Maintenance
from server.observability.metrics import Metrics
from server.schemas.collections import CollectionPut
from server.schemas.submaps import NamedSubmap
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps import bulk_ingest, writes
from urquhart import Recognizer

_FEW: Final = IndexSettings(flush_submaps=8, memory_submaps=30, block_submaps=12, cache_mb=1)
_EVENTS: Final = frozenset({"open", "os.rename", "os.remove", "fcntl.flock", "mmap.__new__", "os.mkdir"})
_COLLECTION: Final = "plots"
_NAMES: Final = 60
_SAMPLE: Final = 4


@dataclass
class Expected:
    """What the database has to hold: seeds of forests by submap id; and the write that may have come through or not."""

    submaps: dict[str, int] = field(default_factory=dict)
    under_way: dict[str, int | None] | None = None

    def read(self, journal: Path) -> None:
        """Take in what a process wrote down: each write before it was made, and once it was acknowledged."""
        self.under_way = None
        for line in journal.read_text().split("\n")[:-1]:
            kind, changes = json.loads(line)
            if kind == "begin":
                self.under_way = changes
            else:
                self.submaps, self.under_way = changed(self.submaps, changes), None


@dataclass
class Report:
    """What came of the rounds."""

    rounds: int = 0
    writes: int = 0
    interrupted_writes: int = 0
    left_over: int = 0
    problems: list[str] = field(default_factory=list)


def changed(submaps: dict[str, int], changes: dict[str, int | None]) -> dict[str, int]:
    """Submaps after a write: None is a deletion."""
    return {name: seed for name, seed in (submaps | changes).items() if seed is not None}


def forest(seed: int) -> NDArray[np.float64]:
    """(30, 2) float64, metres: trees of a small forest, none closer than 2 m to another."""
    rng = np.random.default_rng(seed)
    trees: list[NDArray[np.float64]] = []
    while len(trees) < 30:
        tree = rng.uniform(-25.0, 25.0, 2)
        if np.hypot(*tree) < 25.0 and all(np.hypot(*(tree - other)) > 2.0 for other in trees):
            trees.append(tree)
    return np.array(trees)


def run(folder: Path, rounds: int, seed: int = 0) -> Report:
    """Do so many rounds on a new database in `folder`."""
    path, rng, report, expected = folder / "crashes.db", random.Random(seed), Report(), Expected()
    database = Database(path)
    migrations_runner.upgrade(database)
    crud.ensure(database, _COLLECTION, CollectionPut())
    database.dispose()
    for number in range(rounds):
        journal = folder / f"{number}.journal"
        journal.touch()
        at_event = rng.randrange(1, 400) if rng.random() < 0.5 else None
        worker = multiprocessing.get_context("fork").Process(
            target=_work, args=(path, journal, rng.randrange(2**32), at_event), daemon=True
        )
        worker.start()
        worker.join(rng.uniform(0.0, 1.5) if at_event is None else 3.0)
        if worker.pid is not None and worker.is_alive():
            os.kill(worker.pid, signal.SIGKILL)
        worker.join()
        if worker.exitcode != -signal.SIGKILL:
            report.problems.append(f"round {number}: the process ended by itself with {worker.exitcode}")
        before = len(journal.read_text().splitlines())
        expected.read(journal)
        report.rounds += 1
        report.writes += before // 2
        report.interrupted_writes += expected.under_way is not None
        report.left_over += _left_over(path)
        report.problems.extend(f"round {number}: {what}" for what in _problems(path, expected, rng))
        journal.unlink()
    return report


def _work(path: Path, journal: Path, seed: int, at_event: int | None) -> None:
    """Write and look after the segments until killed."""
    logging.disable(logging.CRITICAL)
    rng, database, metrics = random.Random(seed), Database(path), Metrics()
    indexes = LiveIndexes(database, metrics, _FEW)
    maintenance = Maintenance(database, indexes, metrics)
    if at_event is not None:
        _kill_at(at_event)
    with journal.open("a", buffering=1) as file:
        while True:
            match rng.randrange(10):
                case 0 | 1 | 2:
                    changes = {f"s{rng.randrange(_NAMES)}": rng.randrange(2**40) for _ in range(rng.choice((1, 1, 9)))}
                    file.write(json.dumps(["begin", changes]) + "\n")
                    _put(database, changes)
                    file.write(json.dumps(["done", changes]) + "\n")
                case 3:
                    name = f"s{rng.randrange(_NAMES)}"
                    gone: dict[str, int | None] = {name: None}
                    file.write(json.dumps(["begin", gone]) + "\n")
                    with suppress(NotFound):
                        writes.delete(database, _COLLECTION, name)
                    file.write(json.dumps(["done", gone]) + "\n")
                case 4:
                    with indexes.view(_COLLECTION):
                        pass
                case 5:
                    maintenance.flush_and_merge(_COLLECTION)
                case 6:
                    with database.write_connection() as connection:
                        connection.exec_driver_sql("SELECT 1")
                    database.dispose()  # the last connection folds the log into the file
                case _:
                    maintenance.run()


def _put(database: Database, changes: dict[str, int]) -> None:
    named = [NamedSubmap.model_validate({"id": n, "xy": forest(s).tolist()}) for n, s in changes.items()]
    for _ in bulk_ingest.ingest_many(database, _COLLECTION, named):
        pass


def _kill_at(event: int) -> None:
    left = event

    def count(name: str, _: tuple[Any, ...]) -> None:
        nonlocal left
        if name in _EVENTS:
            left -= 1
            if left <= 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(count)


def _problems(path: Path, expected: Expected, rng: random.Random) -> list[str]:
    """Open the database again and look at everything; what was under way is settled in `expected`."""
    database, problems = Database(path), list[str]()
    try:
        problems += [f"{found.where}: {found.what}" for found in discrepancies(database)]
        indexes = LiveIndexes(database, Metrics(), _FEW)
        # Before anything is mended: what a process finds when it starts again.
        problems += [f"{found.where}: {found.what}" for found in index_discrepancies(database)]
        with indexes.view(_COLLECTION) as view:
            keys = view.tx.submaps(view.collection.key).keys({*expected.submaps, *(expected.under_way or ())})
            if len(view.recognizer) != len(keys) or set(view.recognizer.index) != set(keys.values()):
                problems.append(f"{len(view.recognizer)} submaps in the index, {len(keys)} in the database")
            if expected.under_way is not None:
                after = changed(expected.submaps, expected.under_way)
                name = next(iter(expected.under_way))
                came_through = _holds(view.recognizer, keys, name, after.get(name))
                expected.submaps = after if came_through else expected.submaps
            if set(keys) != set(expected.submaps):
                problems.append(
                    f"submaps {sorted(set(keys) ^ set(expected.submaps))} are there or not against all word"
                )
            for name in rng.sample(sorted(expected.submaps), min(_SAMPLE, len(expected.submaps))):
                if not _holds(view.recognizer, keys, name, expected.submaps[name]):
                    problems.append(f"{name} is not found")
            if view.recognizer.locate(forest(rng.randrange(2**41, 2**42))).verdict == "matched":
                problems.append("a forest that was never stored is matched")
    finally:
        database.dispose()
    return problems


def _left_over(path: Path) -> int:
    """Files of the index that no row lists, which are removed so that they are counted once."""
    database = Database(path)
    try:
        return IndexFolder(database).clean_up(grace=0.0)
    finally:
        database.dispose()


def _holds(recognizer: Recognizer, keys: dict[str, int], name: str, seed: int | None) -> bool:
    """Whether a submap is there with that forest; or is not there, for None."""
    if seed is None or name not in keys:
        return seed is None and name not in keys
    found = recognizer.locate(forest(seed))
    return found.verdict == "matched" and found.candidates[0].key == keys[name]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the rounds and print what came of them; 1 when something was wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        report = run(Path(folder), chosen.rounds, chosen.seed)
    for problem in report.problems:
        print(problem)
    print(
        f"{report.rounds} kills in {time.perf_counter() - began:.0f} s: {report.writes} writes acknowledged, "
        f"{report.interrupted_writes} cut short, {report.left_over} files left over, {len(report.problems)} problems"
    )
    return 1 if report.problems else 0


if __name__ == "__main__":
    sys.exit(main())
