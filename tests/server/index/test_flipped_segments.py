"""Bytes of segment files that change in place, under a service that has them mapped."""

import contextlib
import os
import random
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from server.app import create_app
from server.checks.index import index_discrepancies
from server.config.settings import Settings
from server.config.settings_groups import IndexSettings
from server.index import maintenance
from server.service_parts import Service
from tests.server.factories import TestClient, forest, observed, points
from urquhart.index.segment_file import SegmentDamaged, SegmentFile

COUNT = 12
TREES = [forest(seed, 30, 25.0) for seed in range(COUNT + 4)]


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    index = IndexSettings(flush_submaps=5, memory_submaps=8, block_submaps=5, maintenance_seconds=0.02)
    return Settings(database=str(tmp_path / "urquhart.db"), index=index)


@pytest.fixture
def running(settings: Settings) -> Iterator[tuple[httpx.Client, Service]]:
    """A service with a dozen submaps, in segments."""
    app = create_app(settings)
    with TestClient(app) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        for i in range(COUNT):
            client.put(f"/v1/collections/plots/submaps/p{i}", json={"xy": points(TREES[i])}).raise_for_status()
        service: Service = app.state.service
        settled(client, service)
        yield client, service


def settled(client: httpx.Client, service: Service) -> None:
    """Wait until maintenance has written most of the submaps to segments, and this process searches these."""
    deadline = time.monotonic() + 60.0
    while True:
        ask(client, 0)
        live = service.indexes.live("plots")
        state = live.state if live is not None else None
        if state is not None and sum(part.living for part in state.files) >= COUNT - 5:
            return
        assert time.monotonic() < deadline
        time.sleep(0.02)


def ask(client: httpx.Client, seed: int, view: int = 0) -> tuple[str, str | None]:
    """Verdict and submap for what is seen of a forest."""
    seen, _ = observed(TREES[seed], 100 * seed + view, sigma=0.02)
    response = client.post("/v1/collections/plots/queries", json={"xy": seen})
    assert response.status_code == 200, response.text
    answer = response.json()
    return answer["verdict"], answer["candidates"][0]["submap_id"] if answer["candidates"] else None


def files(service: Service) -> list[Path]:
    return sorted(service.indexes.folder.path.glob("*.segment"))


def flip(path: Path, rng: random.Random, count: int, *, silently: bool, part: str | None = None) -> None:
    """Change bytes anywhere in a file, or in one of its arrays; `silently` as a disk does, which sets no time."""
    # Merged away in the meantime, or damaged before and waiting to be removed.
    with contextlib.suppress(FileNotFoundError, SegmentDamaged):
        before, content = path.stat(), path.read_bytes()
        places = range(len(content))
        if part is not None:
            arrays = SegmentFile.open(path).arrays
            name = max((one for one in arrays if one.endswith(part)), key=lambda one: arrays[one].nbytes)
            offset = content.index(arrays[name].tobytes(), 65_536)
            places = range(offset, offset + arrays[name].nbytes)
        with path.open("r+b") as file:
            for at in rng.choices(places, k=count):
                [old] = os.pread(file.fileno(), 1, at)
                os.pwrite(file.fileno(), bytes([old ^ 1 << rng.randrange(8)]), at)
        if silently:
            os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.mark.parametrize("silently", [False, True])
@pytest.mark.parametrize("count", [1, 300])
def test_bytes_that_flip_anywhere(running: tuple[httpx.Client, Service], count: int, silently: bool) -> None:
    """No look-up fails, none finds a place where there is none, and the segments are rebuilt."""
    client, service = running
    rng = random.Random(count)
    for turn in range(12):
        if not (there := files(service)):
            settled(client, service)
            continue
        flip(rng.choice(there), rng, count, silently=silently)
        for seed in (turn % COUNT, COUNT + turn % 4):
            verdict, found = ask(client, seed, turn)
            if silently:  # a place may be hidden until the next check
                assert verdict != "matched" or found == f"p{seed}"
            elif seed < COUNT:
                assert (verdict, found) == ("matched", f"p{seed}")
            else:
                assert verdict != "matched"
    if silently:
        for name in service.maintenance._checked:
            service.maintenance._checked[name] = -maintenance._AGAIN
        until_sound(client, service)
    settled(client, service)
    for seed in range(COUNT):
        assert ask(client, seed, 77) == ("matched", f"p{seed}")
    assert service.indexes.find_damage("plots") is False


def until_sound(client: httpx.Client, service: Service) -> None:
    """Wait until maintenance has found what is damaged."""
    deadline = time.monotonic() + 60.0
    while list(index_discrepancies(service.database)):
        for name in service.maintenance._checked:
            service.maintenance._checked[name] = -maintenance._AGAIN
        ask(client, 0)
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_each_array_wholly_wrong(running: tuple[httpx.Client, Service]) -> None:
    """One after the other, each in segments that were rebuilt after the one before."""
    client, service = running
    for part in ("keys", "scales", "units", "codes", "starts", "words", "owners", "outlines", "descriptors", "lists"):
        settled(client, service)
        for path in files(service):
            flip(path, random.Random(part), 4_000, silently=True, part=part)
        for seed in range(COUNT):
            verdict, found = ask(client, seed, 5)
            assert verdict != "matched" or found == f"p{seed}", part
        until_sound(client, service)
        for seed in range(0, COUNT, 3):
            assert ask(client, seed, 6) == ("matched", f"p{seed}"), part


def test_a_file_that_is_cut_off_between_two_looks(running: tuple[httpx.Client, Service]) -> None:
    """Nobody reads what is not there any more, which would end the process."""
    client, service = running
    # A thread that reads a file while it is cut off ends the process: maintenance must neither check nor merge.
    service.maintenance.stop(60.0)
    assert not any(thread.name == "maintenance" for thread in threading.enumerate())
    for path in files(service):
        os.truncate(path, 70_000)
    ready = threading.Event()
    ready.set()
    service.maintenance.start(ready)
    for seed in range(COUNT):
        assert ask(client, seed, 5) == ("matched", f"p{seed}")
    until_sound(client, service)
