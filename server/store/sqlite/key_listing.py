"""API keys read by the driver alone, for commands that need nothing else of the database.

SQLAlchemy and the tables take longer to load than everything else that a list of keys needs.
"""

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from datetime import timedelta
from pathlib import Path
from typing import Any

import orjson

from server.store.instants import EPOCH, read_instant
from server.store.schema_version import expected_revision
from server.store.service_records import ApiKeyRecord


def stored_keys(path: Path, *, read_only: bool) -> list[ApiKeyRecord] | None:
    """The keys in the order they were made. None if the file has to be opened in the usual way: it is not there, has
    another schema, or cannot be read, which is told there.
    """
    log = path.with_name(f"{path.name}-wal")
    # The last connection that may write folds the log into the file, which is left to those who guard both.
    only = read_only or path.is_symlink() or (log.exists() and log.stat().st_size > 0)
    try:
        address = f"{path.absolute().as_uri()}?mode={'ro' if only else 'rw'}"
        with closing(sqlite3.connect(address, uri=True)) as connection:
            if connection.execute("SELECT version_num FROM alembic_version").fetchall() != [(expected_revision(),)]:
                return None
            rows = connection.execute(
                "SELECT id, name, digest, scopes, patterns, created, expires, revoked FROM api_keys ORDER BY key"
            ).fetchall()
    except (sqlite3.Error, OSError):
        return None
    return [_record(row) for row in rows]


def _record(row: Sequence[Any]) -> ApiKeyRecord:
    key_id, name, digest, scopes, patterns, created, *later = row
    expires, revoked = map(read_instant, later)
    return ApiKeyRecord(
        key_id,
        name,
        digest,
        scopes=tuple(orjson.loads(scopes)),
        patterns=tuple(orjson.loads(patterns)),
        created=EPOCH + timedelta(microseconds=created),
        expires=expires,
        revoked=revoked,
    )
