"""`urquhart serve`: the service on one address, in one process or several."""

import errno
import socket
from pathlib import Path
from typing import Annotated

import typer

from server.app import create_app
from server.commands.support.database import open_database, settings_with
from server.commands.support.failure import CommandError
from server.commands.support.options import ConfigOption
from server.commands.support.supervisor import supervise
from server.config.settings import Settings
from server.http.serving.file_descriptors import reserve_files
from server.http.serving.lifecycle import BACKLOG, serve_app
from server.observability import logs
from server.security.authenticator import check_exposure


def serve(
    host: Annotated[
        str | None, typer.Option(help="Address to listen on. (default: URQUHART_HOST or 127.0.0.1)", show_default=False)
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Port to listen on; 0: any free one. (default: URQUHART_PORT or 8420)",
            show_default=False,
        ),
    ] = None,
    database: Annotated[
        Path | None,
        typer.Option(
            help="The SQLite file. It is created if it does not exist. (default: URQUHART_DATABASE or urquhart.db)",
            show_default=False,
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=64,
            help="Processes that answer requests; one for each core is best. (default: URQUHART_WORKERS or 1)",
            show_default=False,
        ),
    ] = None,
    insecure: Annotated[
        bool,
        typer.Option(
            "--insecure",
            help="Listen on an address that other machines can reach although there is no API key.",
        ),
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Serve the REST API.

    Settings come from a file (urquhart.toml) and from the environment (URQUHART_...). The environment takes precedence
    over the file, and options over both; urquhart config lists all of them. The documentation of the API is at /docs.

    On SIGTERM or Ctrl-C the service finishes the requests in progress and stops. A second signal stops it at once.
    """
    settings = settings_with(
        host=host, port=port, database=database, workers=workers, insecure=insecure or None, config=config
    )
    logs.configure(settings.log)
    settings = settings.model_copy(update={"limits": reserve_files(settings.limits)})
    # What would stop every worker process is refused here, in one line.
    store = open_database(settings)
    try:
        check_exposure(settings, store)
    finally:
        store.dispose()
    listener = bind(settings.host, settings.port)
    address = f"[{settings.host}]" if ":" in settings.host else settings.host
    typer.echo(f"urquhart: serving on http://{address}:{listener.getsockname()[1]} ; API at /docs, stop with Ctrl-C")
    _answer(settings, listener)


def _answer(settings: Settings, listener: socket.socket) -> None:
    """Answer requests until a signal says to stop. Raises typer.Exit if that fails."""
    with listener:
        if settings.workers == 1:
            serve_app(create_app(settings, create_database=False), listener, single_process=True)
        else:
            code = supervise(settings.workers, settings, listener)
            if code:
                raise typer.Exit(code)


def bind(host: str, port: int) -> socket.socket:
    """A socket bound to the address. It is bound before anything starts, so that a port in use is reported in one line.

    Raises:
        Failure: the address cannot be bound.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except socket.gaierror as error:
        raise CommandError(f"address {host!r} is not known on this machine: {error.strerror}") from error
    listener = socket.socket(family, kind, protocol)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(address)
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            raise CommandError(
                f"port {port} of {host} is in use: stop what listens there, or choose another --port"
            ) from error
        raise CommandError(f"cannot listen on {host}, port {port}: {error.strerror}") from error
    return listener
