"""SQLite refuses rows that the service can never have written, whoever writes them."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from server.checks.all_checks import inspect
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from tests.server.store import older

TYPE, NULL, FOREIGN = "cannot store", "NOT NULL constraint failed", "FOREIGN KEY constraint failed"


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with rows in every table."""
    made = older.make(
        tmp_path_factory.mktemp("rules") / "rules.db",
        "0011",
        "INSERT INTO api_keys VALUES (3, 'abc', 'robot', zeroblob(32), '[\"read\"]', '[\"*\"]', 5, NULL, 6)",
        "INSERT INTO segments VALUES (9, 1, 'gone', 0, 3, 3, 4096, 7)",
    )
    database = Database(made)
    migrations_runner.upgrade(database)
    database.dispose()
    with closing(sqlite3.connect(made)) as opened:
        opened.execute(
            "INSERT INTO constraints VALUES (1, 1, 'match', 'abc', 'rich', 'moved', 1, 2, 'job', "
            "NULL, NULL, NULL, 5, '{}')"
        )
        opened.execute("INSERT INTO searched_submaps VALUES (1, 'abc', 1, 1)")
        opened.commit()
    return made


@pytest.fixture
def connection(path: Path) -> Iterator[sqlite3.Connection]:
    """A connection whose changes are not kept."""
    with closing(sqlite3.connect(path)) as opened:
        opened.execute("PRAGMA foreign_keys = ON")
        yield opened


def test_every_table_has_rows(path: Path) -> None:
    assert all(older.rows(path).values())


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ("collections SET id = x'00'", TYPE),
        ("collections SET revision = 'many'", TYPE),
        ("collections SET origin_x = 'east'", TYPE),
        ("collections SET created = NULL", NULL),
        ("collections SET updated = 253402300800000000", "moments_in_range"),
        ("collections SET submap_count = -1", "counts_from_zero"),
        ("collections SET query_sequence = -1", "counts_from_zero"),
        ("collections SET pruned_revision = revision + 1", "pruned_up_to_its_revision"),
        ("collections SET origin_x = 1.0, origin_y = NULL", "whole_origin"),
        ("collections SET config = '{'", "config_is_json"),
        ("collections SET config = '[]'", "config_is_json"),
        ("submaps SET landmarks = 'text'", TYPE),
        ("submaps SET features = 'text'", TYPE),
        ("submaps SET landmark_ids = '[]'", TYPE),
        ("submaps SET session = x'00'", TYPE),
        ("submaps SET stamp = 'noon'", TYPE),
        ("submaps SET stamp = -62135596800000001", "moments_in_range"),
        ("submaps SET map_yaw = NULL WHERE map_yaw IS NOT NULL", "whole_map_pose"),
        ("submaps SET map_frame_id = 'map' WHERE map_frame_id IS NULL", "whole_map_pose"),
        ("submaps SET map_covariance = '[]' WHERE map_frame_id IS NULL", "whole_map_pose"),
        ("submaps SET map_max_x = map_min_x - 1", "map_box_in_order"),
        ("submaps SET polygon_count = -1", "counts_from_zero"),
        ("submaps SET landmark_count = landmark_count + 1", "positions_of_every_landmark"),
        ("submaps SET landmarks = x'00'", "positions_of_every_landmark"),
        ("submaps SET content_revision = 0", "revisions_in_order"),
        ("submaps SET content_revision = revision + 1", "revisions_in_order"),
        ("submaps SET counts = 'null'", "counts_is_json"),
        ("submaps SET map_covariance = '{}' WHERE map_frame_id IS NOT NULL", "map_covariance_is_json"),
        ("submaps SET properties = '[1]'", "properties_is_json"),
        ("submaps SET landmark_ids = x'5b'", "landmark_ids_is_json"),
        ("submaps SET attributes = x'5b'", "attributes_is_json"),
        ("submaps SET collection_key = 99 WHERE stand_key IS NULL", FOREIGN),
        ("submaps SET stand_key = 99", FOREIGN),
        ("constraints SET kind = 'guess'", "known_kind"),
        ("constraints SET source = 'nobody'", "known_source"),
        ("constraints SET search = ''", "search_of_a_match"),
        ("constraints SET kind = 'odometry'", "search_of_a_match"),
        ("constraints SET to_id = from_id", "two_submaps"),
        ("constraints SET from_revision = 0", "revisions_from_one"),
        ("constraints SET refused = 'because', refused_by = 'map'", "known_refusal"),
        ("constraints SET refused = 'unconfirmed'", "refused_by_a_map"),
        ("constraints SET content = '[]'", "content_is_json"),
        ("constraints SET collection_key = 99", FOREIGN),
        ("searched_submaps SET content_revision = 0", "revision_from_one"),
        ("searched_submaps SET submap_key = 99", FOREIGN),
        ("submaps SET collection_key = 2 WHERE stand_key IS NOT NULL", FOREIGN),
        ("stands SET radius = 0", "sizes_of_a_grid"),
        ("stands SET tree_count = -1", "sizes_of_a_grid"),
        ("stands SET key = 99", FOREIGN),
        ("map_frames SET origin_y = NULL", "whole_origin"),
        ("deletions SET revision = 0", "revision_from_one"),
        ("deletions SET revision = 'x'", TYPE),
        ("segments SET since = revision", "revisions_in_order"),
        ("segments SET bytes = -1", "counts_from_zero"),
        ("queries SET number = 0", "number_from_one"),
        ("queries SET landmarks = x'00'", "whole_positions"),
        ("queries SET candidates = '{}'", "candidates_is_json"),
        ("queries SET answer = x'7b'", "answer_is_json"),
        ("queries SET landmark_ids = x'7b'", "landmark_ids_is_json"),
        ("api_keys SET digest = x'00'", "whole_digest"),
        ("api_keys SET scopes = '[]'", "scopes_and_patterns"),
        ("api_keys SET patterns = '[]'", "scopes_and_patterns"),
        ("api_keys SET patterns = '{}'", "patterns_is_json"),
        ("api_keys SET revoked = 253402300800000000", "moments_in_range"),
        ("jobs SET state = 'lost'", "known_state"),
        ("jobs SET finished = NULL", "time_of_its_end"),
        ("jobs SET state = 'accepted'", "time_of_its_end"),
        ("jobs SET state = 'running', started = NULL, finished = NULL", "time_of_its_start"),
        ("jobs SET done = -1", "counts_from_zero"),
        ("jobs SET total = -1", "counts_from_zero"),
        ("jobs SET dismissed = 2", "dismissed_or_not"),
        ("jobs SET parameters = '[]'", "parameters_is_json"),
        ("jobs SET progress = 'x'", "progress_is_json"),
        ("jobs SET problem = '1'", "problem_is_json"),
        ("idempotency SET status = 99", "status_of_an_answer"),
        ("idempotency SET digest = 'x'", "whole_digest"),
        ("idempotency SET name = ''", "length_of_its_name"),
        ("idempotency SET headers = '[]'", "headers_is_json"),
        ("idempotency SET body = 'text'", TYPE),
    ],
)
def test_a_row_that_cannot_be_is_refused(connection: sqlite3.Connection, change: str, rule: str) -> None:
    with pytest.raises(sqlite3.IntegrityError, match=rule):
        connection.execute(f"UPDATE {change}")


def test_what_earlier_versions_wrote_is_kept(connection: sqlite3.Connection) -> None:
    """They counted what others stored during a job in `done` only."""
    assert connection.execute("UPDATE jobs SET done = total + 1").rowcount == 1


def test_a_collection_goes_with_all_that_is_in_it(connection: sqlite3.Connection) -> None:
    connection.execute("DELETE FROM collections WHERE key = 1")
    for table in ("submaps", "stands", "map_frames", "deletions", "segments", "queries"):
        assert connection.execute(f"SELECT count(*) FROM {table}").fetchone() == (0,), table  # noqa: S608


def test_a_stand_goes_only_after_its_submaps(connection: sqlite3.Connection) -> None:
    with pytest.raises(sqlite3.IntegrityError, match=FOREIGN):
        connection.execute("DELETE FROM stands")
    connection.execute("DELETE FROM submaps WHERE stand_key IS NOT NULL")
    assert connection.execute("DELETE FROM stands").rowcount == 1


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("collections SET revision = 'many'", "collections"),
        ("submaps SET stamp = x'00'", "submaps"),
        ("submaps SET counts = '{' WHERE key = 1", "submaps"),
        ("submaps SET created = 4611686018427387904", "submaps"),
        ("jobs SET state = 7", "jobs"),
        ("queries SET answer = 'no bytes'", "queries"),
    ],
)
def test_the_check_finds_such_rows_in_a_changed_file(path: Path, tmp_path: Path, change: str, told: str) -> None:
    """A file can hold anything: here its tables forget for a moment that they are strict."""
    copy = tmp_path / "copy.db"
    copy.write_bytes(path.read_bytes())
    with closing(sqlite3.connect(copy, isolation_level=None)) as connection:
        connection.execute("PRAGMA writable_schema = ON")
        connection.execute("PRAGMA ignore_check_constraints = ON")
        connection.execute("UPDATE sqlite_master SET sql = replace(sql, ') STRICT', ')')")
        connection.execute("PRAGMA writable_schema = RESET")
        connection.execute(f"UPDATE {change}")
        connection.execute("PRAGMA writable_schema = ON")
        connection.execute(
            "UPDATE sqlite_master SET sql = sql || ' STRICT' "
            "WHERE type = 'table' AND name <> 'alembic_version' AND name NOT LIKE 'sqlite%'"
        )
        connection.execute("PRAGMA writable_schema = RESET")
    database = Database(copy)
    found = [finding.what for finding in inspect(database)]
    database.dispose()
    assert found
    assert all(told in what for what in found), found
