"""Attacks by connections: many at a time, answers that nobody reads, callers who hang up."""

import os
import resource
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import orjson

from benchmarks.reliability.exhaustion.attack_outcome import AttackOutcome, at_once
from benchmarks.reliability.exhaustion.attacked_service import ATTACKER, AttackedService
from benchmarks.reliability.exhaustion.requests import BASE, slow_query

_READERS: Final = 150
_CONNECTIONS: Final = 1_100
_WAITS: Final = 4_000
_BATCH: Final = 200


def unread(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """Answers are asked for and left where they are."""
    one = {"submap_id": "large0", "limit": 10}
    asked = _post(attacked, f"{BASE}/queries/batch", orjson.dumps({"queries": [one] * 20}))
    return _hold(attacked, [asked] * (30 if quick else _READERS), least)


def waits(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """For a job that goes on; each connection waits for its end."""
    job = attacked.client(ATTACKER).get("/v1/jobs").json()["jobs"][0]["id"]
    asked = _head(attacked, "GET", f"/v1/jobs/{job}?wait=60") + b"\r\n"
    return _hold(attacked, [asked] * (200 if quick else _WAITS), least)


def many(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """Connections that are opened and say nothing; who is sent away comes again."""
    return _hold(attacked, [b""] * _CONNECTIONS, least)


def abandoned(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """How busy the service is half a second after the last caller has gone counts; the robot is busy with it, too."""
    outcome, until = AttackOutcome(), time.monotonic() + least
    raw = orjson.dumps({"queries": [slow_query(number) for number in range(_BATCH)]})
    client = attacked.client(ATTACKER)

    def ask(_: int) -> None:
        outcome.send(
            lambda: client.post(
                f"{BASE}/queries/batch", content=raw, headers={"Content-Type": "application/json"}, timeout=0.5
            )
        )

    at_once(4, until, ask)
    time.sleep(0.5)
    outcome.more["cores_busy_afterwards"] = _busy(attacked)
    return outcome


def _hold(attacked: AttackedService, asked: list[bytes], least: float) -> AttackOutcome:
    """Open a connection for each request, send it, and read nothing; one that is closed is opened again, in turn."""
    outcome = AttackOutcome()
    address = urlsplit(attacked.server.url)
    with _descriptors(len(asked) + 200):
        until, refused = time.monotonic() + least, 0
        there: list[socket.socket | None] = [None] * len(asked)
        while time.monotonic() < until:
            for number, content in enumerate(asked):
                if there[number] is None:
                    there[number] = _open(address.hostname or "", address.port or 80, content)
                    outcome.statuses["opened" if there[number] is not None else "not opened"] += 1
                elif _is_closed(there[number]):
                    there[number] = None
                    refused += 1
            time.sleep(0.05)
        outcome.more |= {"held": sum(one is not None for one in there), "sent_away": refused}
        for one in there:
            if one is not None:
                one.close()
    return outcome


def _open(host: str, port: int, content: bytes) -> socket.socket | None:
    try:
        connection = socket.create_connection((host, port), timeout=5.0)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.sendall(content)
    except OSError:
        return None
    return connection


def _is_closed(connection: socket.socket | None) -> bool:
    """Whether the service closed it; what it sent stays unread."""
    if connection is None:
        return True
    try:
        return connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def _head(attacked: AttackedService, method: str, path: str) -> bytes:
    key = attacked.keys[ATTACKER]
    host = urlsplit(attacked.server.url).netloc
    return f"{method} {path} HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer {key}\r\n".encode()


def _post(attacked: AttackedService, path: str, raw: bytes) -> bytes:
    fields = f"Content-Type: application/json\r\nContent-Length: {len(raw)}\r\n\r\n".encode()
    return _head(attacked, "POST", path) + fields + raw


def _busy(attacked: AttackedService) -> float:
    """Cores that the service keeps busy for the next two seconds."""
    stat = Path(f"/proc/{attacked.server.process.pid}/stat")
    ticks = []
    for pause in (2.0, 0.0):
        fields = stat.read_text(encoding="utf-8").rpartition(")")[2].split()
        ticks.append(int(fields[11]) + int(fields[12]))
        time.sleep(pause)
    return (ticks[1] - ticks[0]) / os.sysconf("SC_CLK_TCK") / 2.0


@contextmanager
def _descriptors(count: int) -> Iterator[None]:
    """Let this process open so many files."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(max(soft, count), hard), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
