"""More connections than files that may be open: the service goes on, and says so in a line."""

import resource
import socket
from pathlib import Path

import httpx
import pytest

from server.config.settings import Limits
from server.errors import Conflict
from server.http.serving import file_descriptors
from server.http.serving.file_descriptors import reserve_files
from tests.server.factories import put_submap
from tests.server.served import PATIENCE, Served


class Files:
    """The limits of the system, without changing those of the tests."""

    def __init__(self, soft: int, hard: int) -> None:
        self.soft, self.hard = soft, hard

    def getrlimit(self, _: int) -> tuple[int, int]:
        """As in `resource`."""
        return self.soft, self.hard

    def setrlimit(self, _: int, limits: tuple[int, int]) -> None:
        """As in `resource`."""
        assert limits[0] <= self.hard
        assert limits[1] == self.hard
        self.soft = limits[0]

    RLIMIT_NOFILE, RLIM_INFINITY = resource.RLIMIT_NOFILE, resource.RLIM_INFINITY


@pytest.mark.parametrize(
    ("soft", "hard", "raised", "connections"),
    [(1024, 100_000, 2256, 1000), (1024, 1024, 1024, 384), (1024, 2000, 2000, 872), (5000, 5000, 5000, 1000)],
)
def test_the_limit_is_raised_or_respected(
    monkeypatch: pytest.MonkeyPatch, soft: int, hard: int, raised: int, connections: int
) -> None:
    files = Files(soft, hard)
    monkeypatch.setattr(file_descriptors, "resource", files)
    assert reserve_files(Limits(connections=1000)).connections == connections
    assert files.soft == raised


def test_too_few_files_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_descriptors, "resource", Files(100, 100))
    with pytest.raises(Conflict, match="LimitNOFILE"):
        reserve_files(Limits())


def test_more_connections_than_files(tmp_path: Path) -> None:
    served = Served(tmp_path, files=300)
    try:
        served.client.put("/v1/collections/plots", json={}).raise_for_status()
        idle = [socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE) for _ in range(400)]
        for number in range(5):
            with httpx.Client(base_url=served.url, timeout=PATIENCE) as client:
                put_submap(client, "plots", f"p{number}", number).raise_for_status()
        for connection in idle:
            connection.close()
        assert served.client.get("/v1/collections/plots").json()["counts"]["submaps"] == 5
        said = served.log.read_text()
        assert "the process may open only 300 files, so it accepts 22 connections instead of 1000" in said
        assert "Traceback" not in said
        assert len(said) < 100_000
    finally:
        served.close()
