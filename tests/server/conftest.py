"""Fixtures: an app over a fresh database, servers, and the command."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from server.app import create_app
from server.cli import run
from server.config.settings import Limits, Settings
from server.platform import worker_process
from server.service_parts import Service
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from tests.server.commands.cli_helpers import Said, Urquhart
from tests.server.factories import TestClient
from tests.server.forked import ForkedWorkers
from tests.server.processes import Server
from urquhart import Config, warm_up


@pytest.fixture(scope="session", autouse=True)
def loaded_kernels() -> None:
    """Kernels are loaded before the first app starts: each app that starts meanwhile would begin to load them again,
    and wait a second for that when it stops.
    """
    warm_up(Config())


def settings_in(folder: Path) -> Settings:
    """Settings over a database that is not there yet, with small pages, and time enough on a machine that is busy."""
    limits = Limits(page_default=50, page_max=50, query_seconds=600, batch_seconds=600)
    return Settings(database=str(folder / "urquhart.db"), limits=limits)


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    """The settings of the app of one test."""
    return settings_in(tmp_path)


@pytest.fixture
def app(settings: Settings) -> FastAPI:
    """An app that is not started."""
    return create_app(settings)


@pytest.fixture
def client(app: FastAPI) -> Iterator[httpx.Client]:
    """A client of the started app, with the empty collection `plots`."""
    with TestClient(app) as started:
        started.put("/v1/collections/plots", json={}).raise_for_status()
        yield started


@pytest.fixture(scope="module")
def shared_client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """The same for all tests of a module of which every request is refused or reads: none finds what another left."""
    with TestClient(create_app(settings_in(tmp_path_factory.mktemp("shared")))) as started:
        started.put("/v1/collections/plots", json={}).raise_for_status()
        yield started


@pytest.fixture(scope="session")
def document(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The OpenAPI document, which takes half a second to make; not to be changed."""
    app = create_app(settings_in(tmp_path_factory.mktemp("document")))
    made: dict[str, Any] = app.openapi()
    app.state.service.database.dispose()
    return made


@pytest.fixture
def service(app: FastAPI) -> Service:
    """The parts of the app."""
    parts: Service = app.state.service
    return parts


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    """An upgraded, empty database without a service."""
    made = Database(tmp_path / "bare.db", busy_timeout=2.0)
    migrations_runner.upgrade(made)
    yield made
    made.dispose()


@pytest.fixture
def forked_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers of a service in this process are forked from a process that has loaded everything."""
    monkeypatch.setattr(worker_process, "_SPAWN", ForkedWorkers)


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Server]]:
    """Starts real servers, each in a process of its own, and ends them after the test."""
    started: list[Server] = []

    def start(database: Path, **settings: str) -> Server:
        started.append(Server(database, tmp_path / f"server-{len(started)}.log", **settings))
        return started[-1]

    yield start
    for server in started:
        server.close()


@pytest.fixture
def urquhart(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Urquhart:
    """Runs the command in a directory of its own, on a wide terminal."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def call(*arguments: object) -> Said:
        capfd.readouterr()
        code = run([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        return Said(code, out, err)

    return call
