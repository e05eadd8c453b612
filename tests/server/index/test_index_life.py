"""A random life of an index, beside a model that cannot be wrong: a dictionary."""

import random
import shutil
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from server.collections import crud
from server.schemas.collections import CollectionPut
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from tests.server.index.index_helpers import Process, damage

NAMES = st.sampled_from([f"s{i}" for i in range(4)])
WHO = st.integers(0, 1)
KINDS = st.sampled_from(["missing", "empty", "truncated", "header", "flipped", "arrays"])


class Life(RuleBasedStateMachine):
    """Two processes over one database, written, queried, looked after, killed, damaged and put back."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.path = self.folder / "plots.db"
        self.model: dict[str, int] = {}
        self.gone: list[int] = []
        self.seed = 0
        self.backups: list[tuple[Path, dict[str, int]]] = []
        self.processes: list[Process] = []

    @initialize()
    def begin(self) -> None:
        database = Database(self.path)
        migrations_runner.upgrade(database)
        crud.ensure(database, "plots", CollectionPut())
        database.dispose()
        self.processes = [Process(self.path), Process(self.path)]

    @rule(who=WHO, name=NAMES)
    def put(self, who: int, name: str) -> None:
        self.seed += 1
        self.processes[who].put(name, self.seed)
        if name in self.model:
            self.gone.append(self.model[name])
        self.model[name] = self.seed

    @rule(who=WHO, count=st.integers(2, 9))
    def put_many(self, who: int, count: int) -> None:
        seeds = range(self.seed + 1, self.seed + count + 1)
        self.seed += count
        self.processes[who].put_many(seeds, batch=4)
        self.model |= {f"p{seed}": seed for seed in seeds}

    @precondition(lambda self: self.model)
    @rule(who=WHO, data=st.data(), asked_before=st.booleans())
    def replace(self, who: int, data: st.DataObject, asked_before: bool) -> None:
        name = data.draw(st.sampled_from(sorted(self.model)))
        if asked_before:
            assert self.processes[1 - who].found(self.model[name]) == name
        self.put(who, name)
        assert self.processes[1 - who].found(self.model[name]) == name

    @precondition(lambda self: self.model)
    @rule(who=WHO, data=st.data())
    def delete(self, who: int, data: st.DataObject) -> None:
        name = data.draw(st.sampled_from(sorted(self.model)))
        self.processes[who].delete(name)
        self.gone.append(self.model.pop(name))

    @precondition(lambda self: self.model)
    @rule(who=WHO, data=st.data())
    def query(self, who: int, data: st.DataObject) -> None:
        name = data.draw(st.sampled_from(sorted(self.model)))
        assert self.processes[who].found(self.model[name]) == name

    @precondition(lambda self: self.gone)
    @rule(who=WHO, data=st.data())
    def query_what_is_gone(self, who: int, data: st.DataObject) -> None:
        assert self.processes[who].found(data.draw(st.sampled_from(self.gone))) is None

    @rule(who=WHO)
    def count(self, who: int) -> None:
        assert self.processes[who].held() == set(self.model)

    @rule(who=WHO)
    def look_after(self, who: int) -> None:
        self.processes[who].maintenance.run()

    @rule(who=WHO)
    def flush(self, who: int) -> None:
        self.processes[who].maintenance.flush_and_merge("plots")
        for process in self.processes:
            assert process.held() == set(self.model)

    @rule(who=WHO)
    def kill(self, who: int) -> None:
        self.processes[who].close()
        self.processes[who] = Process(self.path)
        assert self.processes[who].held() == set(self.model)

    @rule(kind=KINDS, which=st.integers(0, 9), where=st.integers(0, 2**16))
    def damage_a_file(self, kind: str, which: int, where: int) -> None:
        files = self.files()
        if files:
            damage(files[which % len(files)], kind, random.Random(where))

    @rule(which=st.integers(0, 9), step=st.integers(1, 3))
    def put_one_file_in_the_place_of_another(self, which: int, step: int) -> None:
        files = self.files()
        if files:
            one, other = files[which % len(files)], files[(which + step) % len(files)]
            copy = other.with_suffix(".copy")
            shutil.copy(one, copy)
            copy.replace(other)

    @rule()
    def back_up(self) -> None:
        path = self.folder / f"backup-{len(self.backups)}.db"
        with closing(sqlite3.connect(self.path)) as live, closing(sqlite3.connect(path)) as copy:
            live.backup(copy)
        self.backups.append((path, dict(self.model)))

    @precondition(lambda self: self.backups)
    @rule(data=st.data(), restarted=st.booleans())
    def put_back(self, data: st.DataObject, restarted: bool) -> None:
        path, model = data.draw(st.sampled_from(self.backups))
        for process in self.processes:
            process.close()
        for name in ("plots.db-wal", "plots.db-shm"):
            (self.folder / name).unlink(missing_ok=True)
        shutil.copy(path, self.path)
        self.gone = [seed for seed in range(1, self.seed + 1) if seed not in model.values()]
        self.model = dict(model)
        with closing(sqlite3.connect(path)) as copy:
            (revision,) = copy.execute("SELECT revision FROM collections").fetchone()
        # What still runs finds out at its next query, if the database comes before what it knows.
        known = [process.indexes.live("plots") for process in self.processes]
        states = [live.state for live in known if live is not None and live.state is not None]
        if restarted or any(state.revision < revision for state in states):
            self.processes = [Process(self.path), Process(self.path)]
        for process in self.processes:
            assert process.held() == set(self.model)

    def files(self) -> list[Path]:
        """Segment files in the order in which they were made, listed or not."""
        found = (self.folder / "plots.db.index").glob("*.segment")
        return sorted(found, key=lambda path: path.stat().st_mtime_ns)

    @invariant()
    def files_are_not_piled_up(self) -> None:
        assert len(list((self.folder / "plots.db.index").glob("*.tmp"))) == 0

    def teardown(self) -> None:
        for process in self.processes:
            assert process.held() == set(self.model)
        for name, seed in self.model.items():
            assert self.processes[0].found(seed) == name
        if self.processes:
            # Damage that no query came across is found when all is checked, and mended.
            process = Process(self.path)
            process.maintenance.run()
            process.maintenance.flush_and_merge("plots")
            process.maintenance.run()
            process.agreed()
            process.close()
        for process in self.processes:
            process.close()
        shutil.rmtree(self.folder)


TestLife = Life.TestCase
TestLife.settings = settings(
    max_examples=5, stateful_step_count=50, deadline=None, suppress_health_check=list(HealthCheck)
)
