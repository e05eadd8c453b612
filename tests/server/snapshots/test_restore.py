"""A snapshot put back: the old database or the new one, never none, never a mixture; and queries are right after it."""

import errno
import os
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from datetime import datetime
from pathlib import Path

import pytest

from server.checks.all_checks import inspect
from server.collections import crud
from server.config.settings import Limits
from server.errors import Conflict, DatabaseTooNew, DomainError, NotADatabase, NotFound, StorageDamaged, StorageFull
from server.index.live_indexes import LiveIndexes
from server.observability.metrics import Metrics
from server.resources.preconditions import Preconditions
from server.schemas.collections import CollectionPatch, CollectionPut
from server.schemas.submaps import SubmapInput
from server.security import api_keys
from server.security.principal import Scope
from server.snapshots import restoring, snapshots
from server.snapshots.restoring import RestoreSource, find, restore, verify
from server.snapshots.snapshot_folder import SnapshotFolder
from server.store.sqlite import database_lock
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps import writes
from tests.server.factories import forest, points, put_submap
from tests.server.index.index_helpers import Process, trees
from tests.server.processes import Server
from tests.server.steps import killed_at_every_step


@pytest.fixture
def process(tmp_path: Path) -> Iterator[Process]:
    """A database with the collection `plots` and an index with small segments."""
    made = Process(tmp_path / "stand.db")
    migrations_runner.upgrade(made.database)
    crud.ensure(made.database, "plots", CollectionPut())
    yield made
    made.close()


def snapshot(process: Process, name: str = "s") -> RestoreSource:
    """One made now."""
    path = process.database.path
    snapshots.make(process.database, SnapshotFolder(path), name, 0)
    return find(path, name)


def ids(path: Path) -> list[str]:
    """Ids of the submaps that are stored."""
    with closing(sqlite3.connect(path)) as connection:
        return [name for (name,) in connection.execute("SELECT id FROM submaps ORDER BY id")]


def beside(path: Path) -> list[str]:
    """What lies beside a database, locks and folders of the service left out."""
    known = {f"{path.name}{ending}" for ending in (".lock", ".snapshots", ".index", ".jobs")}
    return sorted(p.name for p in path.parent.iterdir() if p.name.startswith(path.name) and p.name not in known)


def agreed(path: Path) -> None:
    """Everything agrees in a database, segments that are not there apart."""
    store = Database(path)
    migrations_runner.claim(store)
    restoring.forget_unusable(store)
    assert list(inspect(store)) == []
    store.dispose()


# ------------------------------------------------------------- what is put back


def test_what_was_there_then_is_there_again(process: Process) -> None:
    process.put_many(range(5))
    source = snapshot(process)
    process.put("late", 7)
    process.delete("p0")
    process.close()
    path = process.database.path
    with pytest.raises(Conflict, match="--force"):
        restore(source, path)
    assert ids(path) == ["late", "p1", "p2", "p3", "p4"]
    restored = restore(source, path, force=True)
    assert restored.aside is not None
    assert ids(path) == [f"p{seed}" for seed in range(5)]
    assert ids(restored.aside) == ["late", "p1", "p2", "p3", "p4"]
    assert beside(path) == [path.name, restored.aside.name]
    agreed(path)
    agreed(restored.aside)
    again = Process(path)
    assert [again.found(seed) for seed in (0, 4, 7)] == ["p0", "p4", None]
    again.close()


def test_the_old_database_need_not_be_kept(process: Process) -> None:
    source = snapshot(process)
    process.put("late", 7)
    process.close()
    restored = restore(source, process.database.path, force=True, discard=True)
    assert restored.aside is None
    assert beside(process.database.path) == ["stand.db"]
    assert ids(process.database.path) == []


def test_on_a_fresh_machine(process: Process, tmp_path: Path) -> None:
    process.put_many(range(6), batch=2)
    process.maintenance.flush_and_merge("plots")
    assert len(process.chain())
    source = snapshot(process)
    fresh = tmp_path / "fresh"
    fresh.mkdir()
    for path in (source.file, source.file.with_suffix(".json")):
        shutil.copy(path, fresh / f"carried{path.suffix}")
    restore(find(fresh / "there.db", str(fresh / "carried.db")), fresh / "there.db")
    agreed(fresh / "there.db")
    there = Process(fresh / "there.db")
    assert [there.found(seed) for seed in range(7)] == [f"p{seed}" for seed in range(6)] + [None]
    assert there.held() == {f"p{seed}" for seed in range(6)}
    there.close()


def test_without_manifest_by_its_checksum(process: Process, tmp_path: Path) -> None:
    process.put("p", 1)
    source = snapshot(process)
    assert source.manifest is not None
    alone = tmp_path / "alone.db"
    shutil.copy(source.file, alone)
    right = source.manifest.sha256.upper()
    for checksum in (None, right):
        restored = restore(find(tmp_path / "new.db", str(alone), checksum), tmp_path / "new.db", force=True)
        assert ids(tmp_path / "new.db") == ["p"]
        assert restored.jobs_ended == 0
    with pytest.raises(StorageDamaged, match="SHA-256"):
        restore(find(tmp_path / "newer.db", str(alone), "0" * 64), tmp_path / "newer.db")
    assert beside(tmp_path / "newer.db") == []


@pytest.mark.parametrize("flushed_after", [False, True])
def test_the_same_revision_with_other_submaps(process: Process, flushed_after: bool) -> None:
    """Segments of the time after the snapshot hold the same keys and revisions, and must not be searched."""
    process.put_many(range(4), batch=1)
    process.maintenance.flush_and_merge("plots")
    source = snapshot(process)
    process.put_many(range(10, 16), batch=1)
    process.maintenance.flush_and_merge("plots")
    before, listed = process.files(), {segment.name for segment in process.chain()}
    assert process.found(12) == "p12"
    process.close()
    restore(source, process.database.path, force=True)
    again = Process(process.database.path)
    assert set(again.files()) == set(before)  # the later segments still lie there
    again.put_many(range(20, 26), batch=1)  # comes to the same revision, with the same keys
    if flushed_after:
        again.maintenance.flush_and_merge("plots")
        assert not listed <= {segment.name for segment in again.chain()}
    assert [again.found(seed) for seed in (0, 3, 20, 25)] == ["p0", "p3", "p20", "p25"]
    assert [again.found(seed) for seed in range(10, 16)] == [None] * 6
    assert again.held() == {f"p{seed}" for seed in (*range(4), *range(20, 26))}
    restoring.forget_unusable(again.database)
    again.agreed()
    again.close()


def test_an_entity_tag_of_later_is_not_one_of_now(process: Process) -> None:
    source = snapshot(process)
    crud.patch(process.database, "plots", CollectionPatch(title="later"))
    _, tag = crud.read(process.database, "plots")
    process.close()
    restore(source, process.database.path, force=True)
    store = Database(process.database.path)
    now, own = crud.patch(store, "plots", CollectionPatch(title="now"))
    assert now.revision == 1
    assert own != tag
    with pytest.raises(DomainError, match="If-Match"):
        crud.patch(store, "plots", CollectionPatch(title="lost"), Preconditions(if_match=(tag,)))
    store.dispose()


def test_jobs_do_not_go_on(process: Process) -> None:
    with process.database.write() as tx:
        jobs = tx.jobs
        plots = tx.collections.get("plots")
        assert plots is not None
        for name in ("waiting", "running"):
            jobs.add(
                job_id=name,
                kind="reindex",
                collection=plots,
                caller="",
                parameters={},
                total=None,
            )
        jobs.change("running", state="running", started=process_time(process))
    source = snapshot(process)
    process.close()
    restored = restore(source, process.database.path, force=True)
    assert restored.jobs_ended == 2
    store = Database(process.database.path)
    with store.read() as tx:
        for name in ("waiting", "running"):
            row = tx.jobs.get(name)
            assert row is not None
            assert (row.state, row.problem and row.problem["status"]) == ("failed", 409)
    assert list(inspect(store)) == []
    store.dispose()


def process_time(process: Process) -> datetime:
    """A moment that the database knows."""
    with process.database.read() as tx:
        return crud.get_collection(tx, "plots").created


def test_keys_are_those_of_then(process: Process) -> None:
    _, info = api_keys.make(process.database, "robot", [Scope.READ], ["*"])
    source = snapshot(process)
    api_keys.revoke(process.database, info.id)
    process.close()
    restore(source, process.database.path, force=True)
    store = Database(process.database.path)
    assert [key.revoked for key in api_keys.listed(store)] == [None]
    store.dispose()


# ---------------------------------------------------------------- what is refused


def flipped(path: Path, place: int = 5_000) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)


def shortened(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-4096])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def without_its_manifest(damage: Callable[[Path], None]) -> Callable[[Path], None]:
    def done(path: Path) -> None:
        damage(path)
        path.with_suffix(".json").unlink()

    return done


def something_else(path: Path) -> None:
    path.unlink()
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("CREATE TABLE photos (id INTEGER)")


def newer(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")


def no_manifest(path: Path) -> None:
    path.with_suffix(".json").write_text("{")


@pytest.mark.parametrize(
    ("damage", "error"),
    [
        (flipped, StorageDamaged),
        (shortened, StorageDamaged),
        (emptied, StorageDamaged),
        (no_manifest, StorageDamaged),
        (newer, StorageDamaged),
        (without_its_manifest(shortened), StorageDamaged),
        (without_its_manifest(emptied), NotADatabase),
        (without_its_manifest(something_else), NotADatabase),
        (without_its_manifest(newer), DatabaseTooNew),
    ],
)
def test_what_is_not_sound_is_not_put_anywhere(
    process: Process, damage: Callable[[Path], None], error: type[DomainError]
) -> None:
    process.put_many(range(3))
    source = snapshot(process)
    process.put("late", 7)
    process.close()
    path = process.database.path
    damage(source.file)
    with pytest.raises(error):
        verify(find(path, str(source.file)))
    with pytest.raises(error):
        restore(find(path, str(source.file)), path, force=True)
    assert beside(path) == ["stand.db"]
    assert ids(path) == ["late", "p0", "p1", "p2"]
    agreed(path)


def test_a_manifest_of_another_content(process: Process) -> None:
    process.put("p", 1)
    source = snapshot(process)
    process.close()
    assert source.manifest is not None
    told = source.manifest.collections[0].model_copy(update={"submaps": 2})
    other = RestoreSource(source.file, source.manifest.model_copy(update={"collections": [told]}), source.checksum)
    with pytest.raises(StorageDamaged, match="manifest"):
        verify(other)
    assert verify(source) == source.manifest.sha256


def test_a_database_in_use_is_no_snapshot(process: Process, tmp_path: Path) -> None:
    process.put("p", 1)
    with pytest.raises(Conflict, match="in use"):
        restore(find(tmp_path / "new.db", str(process.database.path)), tmp_path / "new.db")
    with pytest.raises(NotFound):
        find(process.database.path, "nothing")
    with pytest.raises(NotFound):
        find(process.database.path, "../stand")


def test_nobody_may_have_the_database_open(process: Process) -> None:
    process.put("p", 1)
    source = snapshot(process)
    path = process.database.path
    process.database.hold_file()
    with pytest.raises(Conflict, match="stop the service"):
        restore(source, path, force=True)
    process.close()
    with closing(sqlite3.connect(path)) as other:  # a program that knows nothing of the lock
        other.execute("SELECT count(*) FROM submaps").fetchone()
        other.execute("PRAGMA journal_mode = WAL")
        with pytest.raises(Conflict, match="another program"):
            restore(source, path, force=True)
    assert beside(path) == ["stand.db"]
    restore(source, path, force=True)


def test_who_comes_meanwhile_waits(process: Process) -> None:
    path = process.database.path
    process.close()
    with database_lock.exclusive(path):
        impatient = Database(path, busy_timeout=0.05)
        with pytest.raises(DomainError, match="is being restored or upgraded"):
            migrations_runner.upgrade(impatient)
        impatient.dispose()


def test_a_running_service_is_not_disturbed(serve: Callable[..., Server], tmp_path: Path) -> None:
    path = tmp_path / "urquhart.db"
    server = serve(path)
    server.client.put("/v1/collections/plots", json={}).raise_for_status()
    put_submap(server.client, "plots", "p0", 0).raise_for_status()
    server.client.post("/v1/snapshots", json={"name": "s"}).raise_for_status()
    put_submap(server.client, "plots", "late", 1).raise_for_status()
    with pytest.raises(Conflict, match="stop the service"):
        restore(find(path, "s"), path, force=True)
    put_submap(server.client, "plots", "later", 2).raise_for_status()
    server.kill()  # leaves a log that is not folded in
    assert path.with_name("urquhart.db-wal").stat().st_size > 0
    restored = restore(find(path, "s"), path, force=True)
    assert restored.aside is not None
    assert ids(restored.aside) == ["late", "later", "p0"]
    assert ids(path) == ["p0"]
    again = serve(path).client
    answers = [
        again.post("/v1/collections/plots/queries", json={"xy": points(forest(seed))}).json()["verdict"]
        for seed in (0, 1, 2)
    ]
    assert answers == ["matched", "no_match", "no_match"]


@pytest.mark.parametrize(("place", "damage"), [(0, b"not a database at all"), (18, b"\1\1"), (18, b"\7\7")])
def test_a_damaged_database_is_put_aside_with_its_log(process: Process, place: int, damage: bytes) -> None:
    process.put("p", 1)
    source = snapshot(process)
    path = process.database.path
    process.put("late", 2)
    log = path.with_name(f"{path.name}-wal")
    logged = log.read_bytes()
    assert logged
    process.close()
    content = bytearray(path.read_bytes())
    content[place : place + len(damage)] = damage
    path.write_bytes(content)
    for ending in ("-wal", "-shm"):
        path.with_name(path.name + ending).write_bytes(logged)
    restored = restore(source, path, force=True)
    assert restored.aside is not None
    assert restored.aside.read_bytes() == content
    assert restored.aside.with_name(f"{restored.aside.name}-wal").read_bytes() == logged
    assert not log.exists()
    assert ids(path) == ["p"]
    agreed(path)


def test_a_log_without_its_database_is_not_applied_to_the_new_one(process: Process) -> None:
    process.put("p", 1)
    source = snapshot(process)
    path = process.database.path
    process.put("late", 2)
    log = path.with_name(f"{path.name}-wal")
    content = log.read_bytes()
    assert content
    process.close()
    path.unlink()
    log.write_bytes(content)
    restore(source, path)
    assert ids(path) == ["p"]
    agreed(path)


# ------------------------------------------------------------------ interruption


def test_killed_at_any_step(process: Process) -> None:
    process.put_many(range(3))
    source = snapshot(process)
    process.put("late", 7)
    process.close()
    path = process.database.path
    old, new, seen = ["late", "p0", "p1", "p2"], ["p0", "p1", "p2"], set()
    original = path.read_bytes()
    for _ in killed_at_every_step(lambda: restore(find(path, "s"), path, force=True)):
        there = ids(path)
        assert there in (old, new)
        seen.add(len(there))
        agreed(path)
        # Tried again, it comes through, and one name is left of what was begun.
        restored = restore(source, path, force=True)
        assert restored.aside is not None
        assert ids(path) == new
        for left in list(path.parent.iterdir()):
            if left.name.startswith(f"{path.name}.before-restore"):
                assert ids(left) in (old, new)
                assert left.stat().st_nlink == 1
                left.unlink()
        assert beside(path) == ["stand.db"]
        path.write_bytes(original)
    assert seen == {3, 4}


@pytest.mark.parametrize("delay", [0.15, 0.45, 0.9])
def test_killed_at_any_moment(process: Process, delay: float) -> None:
    process.put_many(range(3))
    snapshot(process)
    process.put("late", 7)
    process.close()
    path = process.database.path
    command = [sys.executable, "-m", "server.cli", "snapshot", "restore", "s", "--force", "--database", str(path)]
    with subprocess.Popen(command, cwd=Path(__file__).parents[3], stdout=subprocess.DEVNULL) as running:
        try:
            running.wait(1.0 + delay)
        except subprocess.TimeoutExpired:
            running.kill()
    assert ids(path) in (["late", "p0", "p1", "p2"], ["p0", "p1", "p2"])
    agreed(path)


@pytest.mark.parametrize("place", ["fsync", "link", "replace"])
def test_a_full_disk_leaves_the_old_database(process: Process, monkeypatch: pytest.MonkeyPatch, place: str) -> None:
    process.put("p", 1)
    source = snapshot(process)
    process.put("late", 2)
    process.close()
    path = process.database.path

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, place, full)
        with pytest.raises(StorageFull):
            restore(source, path, force=True)
    assert ids(path) == ["late", "p"]
    restore(source, path, force=True)
    assert ids(path) == ["p"]
    agreed(path)


# ------------------------------------------------------------------------- parts


def test_links_lead_to_one_lock_and_one_folder(process: Process, tmp_path: Path) -> None:
    process.put("p", 1)
    link = tmp_path / "elsewhere" / "link.db"
    link.parent.mkdir()
    link.symlink_to(process.database.path)
    assert database_lock.lock_path(link) == database_lock.lock_path(process.database.path)
    source = snapshot(process)
    process.put("late", 2)
    process.close()
    restored = restore(find(link, "s"), link, force=True)
    assert link.is_symlink()
    assert restored.aside is not None
    assert restored.aside.parent == tmp_path
    assert ids(link) == ids(process.database.path) == ["p"]
    assert source.file.exists()


def test_the_new_file_has_the_permissions_of_the_old_one(process: Process) -> None:
    source = snapshot(process)
    process.close()
    process.database.path.chmod(0o640)
    restore(source, process.database.path, force=True)
    assert process.database.path.stat().st_mode & 0o777 == 0o640


def test_a_look_up_after_a_restore_has_the_rows_of_now(process: Process) -> None:
    process.put("p", 1)
    source = snapshot(process)
    body = SubmapInput.model_validate({"xy": points(trees(2))})
    writes.put(process.database, "plots", "p", body, Limits())
    process.close()
    restore(source, process.database.path, force=True)
    store = Database(process.database.path)
    indexes = LiveIndexes(store, Metrics())
    with indexes.view("plots") as view:
        assert view.recognizer.locate(trees(1)).verdict == "matched"
        assert view.recognizer.locate(trees(2)).verdict == "no_match"
    store.dispose()
