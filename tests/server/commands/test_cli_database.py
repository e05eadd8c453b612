"""`db`, and what every verb does with a database that it cannot use, or an address."""

import shutil
import socket
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from server.store.sqlite import database as store_database
from tests.server.commands.cli_helpers import LONGLEAF, STEM_MAPS, Urquhart, refused

# --------------------------------------------------------------- database


def test_upgrade_makes_a_database_once(urquhart: Urquhart, tmp_path: Path) -> None:
    said = urquhart("db", "upgrade", "--database", "new.db")
    assert said.code == 0
    assert "nothing to do" not in said.out
    assert "nothing to do" in urquhart("db", "upgrade", "--database", "new.db").out
    assert urquhart("db", "check", "--database", "new.db").out.endswith("new.db: clean\n")


def copy(source: Path, target: Path) -> Path:
    with closing(sqlite3.connect(source)) as old, closing(sqlite3.connect(target)) as new:
        old.backup(new)
    return target


@pytest.mark.parametrize(
    ("damage", "where", "what"),
    [
        ("UPDATE submaps SET features = zeroblob(100) WHERE id = 'longleaf-2-2'", "stand/longleaf-2-2", "features"),
        (
            "UPDATE submaps SET landmarks_hash = '0' WHERE id = 'longleaf-2-2'",
            "stand/longleaf-2-2",
            "landmarks",
        ),
        ("DELETE FROM submaps WHERE id = 'longleaf-2-2'", "stand", "submaps"),
        ("UPDATE collections SET config = '{\"bogus\": 1}'", "stand", "configuration"),
        ("DROP INDEX ix_submaps_footprint", "", "schema"),
    ],
)
def test_check_tells_where_and_what(
    urquhart: Urquhart, indexed: Path, tmp_path: Path, damage: str, where: str, what: str
) -> None:
    path = copy(indexed, tmp_path / "damaged.db")
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(damage)
    said = urquhart("db", "check", "--database", path)
    *lines, last = said.out.splitlines()
    assert said.code == 1
    assert any(line.startswith(where) and what in line for line in lines), lines
    assert last == f"{path}: {len(lines)} findings"


def test_check_is_clean_after_indexing_and_changes_nothing(urquhart: Urquhart, indexed: Path) -> None:
    before = indexed.read_bytes()
    said = urquhart("db", "check", "--database", indexed)
    assert (said.code, said.out) == (0, f"{indexed}: clean\n")
    assert indexed.read_bytes() == before


VERBS = (
    ["index", str(LONGLEAF), "--collection", "stand", "--radius", "30", "--spacing", "40"],
    ["locate", str(LONGLEAF), "--collection", "stand"],
    ["db", "upgrade"],
    ["db", "check"],
    ["db", "reindex"],
    ["serve", "--port", "0"],
)


@pytest.mark.parametrize("arguments", VERBS, ids=lambda arguments: "-".join(arguments[:2])[:12])
def test_a_file_that_is_no_database_of_ours_is_left_alone(
    urquhart: Urquhart, indexed: Path, tmp_path: Path, arguments: list[str]
) -> None:
    text = tmp_path / "notes.db"
    text.write_text("these are my notes, not a database\n" * 200)
    refused(urquhart(*arguments, "--database", text), "not a SQLite database")
    assert text.read_text().startswith("these are my notes")

    stranger = tmp_path / "photos.db"
    with closing(sqlite3.connect(stranger)) as connection, connection:
        connection.execute("CREATE TABLE photos (id INTEGER)")
    refused(urquhart(*arguments, "--database", stranger), "'photos'")

    newer = copy(indexed, tmp_path / "newer.db")
    with closing(sqlite3.connect(newer)) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
    refused(urquhart(*arguments, "--database", newer), "9999", "newer version")

    if arguments[0] not in ("locate",) and arguments[-1] not in ("check", "reindex"):
        refused(urquhart(*arguments, "--database", tmp_path / "no" / "folder.db"), "cannot be opened")


def test_a_database_that_cannot_be_written_is_one_line(
    urquhart: Urquhart, indexed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = copy(indexed, tmp_path / "kept.db")
    monkeypatch.setenv("URQUHART_DATABASE", f"sqlite:///{path}?mode=ro")
    refused(urquhart("index", LONGLEAF, "--collection", "new", "--radius", 30, "--spacing", 40), "cannot be written")
    assert urquhart("db", "check").code == 0


def test_a_full_disk_is_one_line_and_keeps_what_was_stored(
    urquhart: Urquhart, indexed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = copy(indexed, tmp_path / "small.db")
    configure = store_database._configure

    def small(connection: sqlite3.Connection) -> None:
        configure(connection)
        connection.execute("PRAGMA max_page_count = 1")  # SQLite raises it to what is in use: not one page more

    monkeypatch.setattr(store_database, "_configure", small)
    said = urquhart(
        "index", STEM_MAPS / "lansing.csv", "--collection", "stand", "--radius", 30, "--spacing", 20, "--database", path
    )
    refused(said, "The disk is full")
    assert urquhart("db", "check", "--database", path).code == 0


def test_a_snapshot_that_is_not_there_is_told_with_where_it_was_looked_for(urquhart: Urquhart, tmp_path: Path) -> None:
    urquhart("db", "upgrade")
    folder = str(tmp_path / "urquhart.db.snapshots")
    for verb in ("restore", "verify"):
        refused(urquhart("snapshot", verb, "spring"), f"'spring' in {folder}", f"no file {tmp_path / 'spring'};")
    refused(urquhart("snapshot", "delete", "spring"), f"no snapshot 'spring' in {folder}; urquhart snapshot list")


def test_names_of_snapshots_are_told_as_a_whole(urquhart: Urquhart, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a terminal of the usual width, too: a name that is cut is none that can be restored."""
    monkeypatch.setenv("COLUMNS", "80")
    urquhart("db", "upgrade")
    name = urquhart("snapshot", "create").out.partition(":")[0]
    assert name in urquhart("snapshot", "list").out


def test_the_index_is_written_checked_and_made_again(
    urquhart: Urquhart, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "stand.db"
    monkeypatch.setenv("URQUHART_DATABASE", str(path))
    monkeypatch.setenv("URQUHART_INDEX__FLUSH_SUBMAPS", "4")
    assert urquhart("index", LONGLEAF, "--collection", "stand", "--radius", 40, "--spacing", 40).code == 0
    (segment,) = (tmp_path / "stand.db.index").glob("*.segment")
    assert urquhart("db", "check").out == f"{path}: clean\n"
    content = bytearray(segment.read_bytes())
    content[65_536] ^= 1
    segment.unlink()
    segment.write_bytes(content)
    said = urquhart("db", "check")
    assert (said.code, said.out.splitlines()[-1]) == (1, f"{path}: 1 findings")
    assert said.out.startswith(f"stand: segment {segment.stem} cannot be used: ")
    said = urquhart("db", "reindex")
    assert (said.code, said.err) == (0, "")
    assert said.out == f"stand: {submaps_in(path)} submaps reindexed\n"
    assert segment not in set((tmp_path / "stand.db.index").glob("*.segment"))
    assert urquhart("db", "check").out == f"{path}: clean\n"
    assert urquhart("db", "reindex", "stand").code == 0
    refused(urquhart("db", "reindex", "nowhere"), "nowhere")
    refused(urquhart("db", "reindex", "--database", tmp_path / "no.db"), "no such database")


def test_a_check_leaves_a_log_where_it_lies(urquhart: Urquhart, tmp_path: Path) -> None:
    """It may belong to another file that lay there, and what it holds is seen without that."""
    path, left = tmp_path / "used.db", tmp_path / "left.db"
    assert urquhart("db", "upgrade", "--database", path).code == 0
    log = left.with_name("left.db-wal")
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("UPDATE alembic_version SET version_num = version_num")
        connection.commit()
        shutil.copy(path, left)
        shutil.copy(path.with_name("used.db-wal"), log)
    content, kept = left.read_bytes(), log.read_bytes()
    assert kept
    assert urquhart("db", "check", "--database", left).out == f"{left}: clean\n"
    assert (left.read_bytes(), log.read_bytes()) == (content, kept)


@pytest.mark.parametrize("begin", [100, 4096 * 3])
def test_a_check_finds_damage(urquhart: Urquhart, indexed: Path, tmp_path: Path, begin: int) -> None:
    path = copy(indexed, tmp_path / "damaged.db")
    content = bytearray(path.read_bytes())
    content[begin:] = b"\x5a" * (len(content) - begin)
    path.write_bytes(content)
    said = urquhart("db", "check", "--database", path)
    assert (said.code, said.err) == (1, "")
    assert said.out.endswith(" findings\n")
    assert "db check" not in said.out
    assert path.read_bytes() == content


def test_everything_is_stored_where_the_index_cannot_be_written(
    urquhart: Urquhart, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "stand.db"
    monkeypatch.setenv("URQUHART_INDEX__FLUSH_SUBMAPS", "4")
    (tmp_path / "stand.db.index").write_text("a file in the place of the folder")
    said = urquhart("index", LONGLEAF, "--collection", "stand", "--radius", 40, "--spacing", 40, "--database", path)
    assert said.code == 0
    assert "all submaps are stored, but the index is not written" in said.err
    assert urquhart("db", "check", "--database", path).out == f"{path}: clean\n"


def submaps_in(path: Path) -> int:
    with closing(sqlite3.connect(path)) as connection:
        count: int = connection.execute("SELECT count(*) FROM submaps").fetchone()[0]
    return count


# ------------------------------------------------------------------ serve


def test_serve_refuses_an_address_that_others_can_reach(urquhart: Urquhart) -> None:
    refused(urquhart("serve", "--host", "0.0.0.0"), "0.0.0.0", "--insecure")


def test_serve_refuses_a_port_in_use_and_an_unknown_address(urquhart: Urquhart, tmp_path: Path) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        refused(urquhart("serve", "--port", port), f"port {port} of 127.0.0.1 is in use", "--port")
    refused(urquhart("serve", "--host", "192.0.2.1", "--insecure"), "cannot listen on 192.0.2.1")
    refused(urquhart("serve", "--host", "no such host", "--insecure"), "not known on this machine")
