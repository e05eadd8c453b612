"""The database that a command works on."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from server.commands.support.failure import CommandError
from server.config import settings_loading
from server.config.settings import Settings
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date


def settings_with(**given: Any) -> Settings:
    """The settings. Those that are `given` (not None) take precedence over file and environment.

    Raises:
        Misconfigured: says in one sentence which setting cannot be used and why.
    """
    return settings_loading.load(**given)


def open_database(settings: Settings) -> Database:
    """The database of `settings`, upgraded to this version's schema and features.

    Raises:
        DomainError: it is not a database of this service, is of a newer version, or cannot be read or written.
    """
    database = Database(
        settings.database_path, busy_timeout=settings.busy_timeout_seconds, read_only=settings.database_read_only
    )
    try:
        bring_up_to_date(database)
    except BaseException:
        database.dispose()
        raise
    return database


@contextmanager
def upgraded_database(path: Path | None) -> Iterator[Database]:
    """The database of the settings, or at `path`, as `open_database` opens it, for the length of a block.

    Raises:
        CommandError: there is no such file.
        DomainError: as `open_database`.
    """
    settings = settings_with(database=path)
    check_there(settings)
    database = open_database(settings)
    try:
        yield database
    finally:
        database.dispose()


def existing_database(settings: Settings) -> Database:
    """The database of `settings`, as it is.

    Raises:
        Failure: there is no such file.
    """
    check_there(settings)
    return _database(settings)


def unchanged_database(settings: Settings) -> Database:
    """The database of `settings` for inspection: a log beside it is read, but not written into it.

    Raises:
        Failure: there is no such file.
    """
    check_there(settings)
    file = settings.database_path.resolve()
    log = file.with_name(f"{file.name}-wal")
    # Read-only connections are only needed if there is a log to keep.
    left = log.exists() and log.stat().st_size > 0
    return _database(settings, read_only=left)


def check_there(settings: Settings) -> None:
    """Raise CommandError unless the file exists, so that a mistyped path does not create an empty database."""
    if not settings.database_path.is_file():
        raise CommandError(
            f"{settings.database_path}: no such database; create one with urquhart index or urquhart serve"
        )


def _database(settings: Settings, *, read_only: bool = False) -> Database:
    return Database(
        settings.database_path,
        busy_timeout=settings.busy_timeout_seconds,
        read_only=read_only or settings.database_read_only,
    )
