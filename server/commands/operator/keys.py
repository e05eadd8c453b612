"""`urquhart keys`: create, list and revoke API keys. This is only possible on the host."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from server.commands.support.console import wide_console
from server.commands.support.failure import CommandError
from server.commands.support.options import DatabaseOption
from server.config import settings_loading
from server.security.principal import Scope
from server.store.service_records import ApiKeyRecord
from server.store.sqlite.key_listing import stored_keys

app = typer.Typer(help="Create, list and revoke API keys.")
_UNITS = {"h": 1, "d": 24, "w": 24 * 7}


@app.command(
    "create",
    epilog="Example: `urquhart keys create robot-2 --scope read --scope write --collections 'north*' --expires 90d`",
)
def create(
    name: Annotated[str, typer.Argument(help="Name of the key: who or what will use it.")],
    scope: Annotated[
        list[Scope],
        typer.Option(help="A scope that the key has. Repeat the option for several: no scope includes another."),
    ],
    collections: Annotated[
        list[str],
        typer.Option(
            help="Pattern of collections that the key may see, such as 'plots-*'. Repeat the option for several.",
            show_default="all",
        ),
    ] = ["*"],  # noqa: B006  as the library wants it
    expires: Annotated[
        str | None,
        typer.Option(help="When the key expires: after 12h, 90d or 52w, or at a date.", show_default="never"),
    ] = None,
    database: DatabaseOption = None,
) -> None:
    """Create a key and print it. It is printed only once: the service stores only its hash.

    As soon as one key exists, every request needs a key.
    """
    from server.commands.support.database import open_database, settings_with
    from server.security import api_keys

    if not name.strip() or len(name) > 128 or not name.isprintable():
        raise CommandError("the name of a key must have 1 to 128 printable characters")
    store = open_database(settings_with(database=database))
    try:
        secret, info = api_keys.make(store, name.strip(), scope, collections, _moment(expires))
    finally:
        store.dispose()
    typer.echo(secret)
    typer.echo(f"key {info.id} created; it is not shown again", err=True)


@app.command("list")
def list_keys(database: DatabaseOption = None) -> None:
    """List all keys, without their secrets."""
    found = _listed(database)
    if not found:
        typer.echo("no keys: the service needs none, and accepts callers on this machine only")
        return
    table = Table("id", "name", "scopes", "collections", "created", "expires", "state", box=None)
    now = datetime.now(UTC)
    for key in found:
        expires = "never" if key.expires is None else f"{key.expires:%Y-%m-%d %H:%M}"
        scopes, patterns = ", ".join(key.scopes), ", ".join(key.patterns)
        table.add_row(key.id, key.name, scopes, patterns, f"{key.created:%Y-%m-%d}", expires, key.state(now))
    wide_console().print(table)


@app.command("revoke")
def revoke(
    key: Annotated[str, typer.Argument(metavar="ID", help="Id of the key, as in the list.")],
    database: DatabaseOption = None,
) -> None:
    """Revoke a key. Running services refuse it within a second."""
    from server.commands.support.database import upgraded_database
    from server.security import api_keys

    with upgraded_database(database) as store:
        api_keys.revoke(store, key)
    typer.echo(f"key {key} revoked")


def _listed(path: Path | None) -> Sequence[ApiKeyRecord]:
    """The keys, in the shortest way that there is. Raises CommandError and DomainError."""
    settings = settings_loading.load(database=path)
    found = stored_keys(settings.database_path, read_only=settings.database_read_only)
    if found is not None:
        return found
    # Loads half a second of packages.
    from server.commands.support.database import upgraded_database
    from server.security import api_keys

    with upgraded_database(path) as store:
        return api_keys.listed(store)


def _moment(text: str | None) -> datetime | None:
    if text is None:
        return None
    now = datetime.now(UTC)
    match = re.fullmatch(r"([0-9]{1,5})([hdw])", text)
    try:
        if match is not None:
            moment = now + timedelta(hours=int(match[1]) * _UNITS[match[2]])
        else:
            moment = datetime.fromisoformat(text)
            moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment
    except (ValueError, OverflowError) as error:
        raise CommandError(
            f"--expires {text!r} is neither a duration (12h, 90d, 52w) nor a date (2027-01-31)"
        ) from error
    if moment <= now:
        raise CommandError(f"--expires {text} is in the past: give a later date")
    return moment
