"""The honest caller beside an attack: a process of its own, so that the attacker's threads do not slow it."""

import multiprocessing
import time
from collections import Counter
from multiprocessing.connection import Connection
from typing import Final

import httpx

from benchmarks.reliability.exhaustion.attacked_service import HONEST, AttackedService
from benchmarks.reliability.trees import body

_PAUSE: Final = 0.02
"""Seconds between an answer and the next query."""
_TIMEOUT: Final = 60.0
_PATIENCE: Final = 120.0


class Robot:
    """Asks one query again and again while the block runs.

    Attributes:
        errors: answers other than a right match, by what they were; 503 and 429 with Retry-After among them.
    """

    def __init__(self, attacked: AttackedService, seed: int) -> None:
        self.errors: Counter[str] = Counter()
        context = multiprocessing.get_context("spawn")
        self._ours, theirs = context.Pipe()
        key = attacked.keys[HONEST]
        attacked.client(HONEST).put(f"/v1/collections/{HONEST}", json={}).raise_for_status()
        attacked.client(HONEST).put(f"/v1/collections/{HONEST}/submaps/p", json=body(seed)).raise_for_status()
        self._process = context.Process(target=_ask_forever, args=(attacked.server.url, key, seed, theirs), daemon=True)

    def __enter__(self) -> "Robot":
        self._process.start()
        self.end()  # it is there
        return self

    def __exit__(self, *_: object) -> None:
        self._ours.send("stop")
        self._process.join(_PATIENCE)
        if self._process.is_alive():
            self._process.kill()

    def settle(self, seconds: float) -> None:
        """Ask for a while without keeping the times."""
        self.times(seconds)
        self.errors.clear()

    def times(self, seconds: float) -> list[float]:
        """Milliseconds of the answers of the next `seconds`."""
        self.begin()
        time.sleep(seconds)
        return self.end()

    def begin(self) -> None:
        """Keep times from now on."""
        self._ours.send("begin")

    def end(self) -> list[float]:
        """Milliseconds of the answers since `begin`. Raises RuntimeError: the robot is stuck or gone."""
        self._ours.send("end")
        if not self._ours.poll(_PATIENCE):
            raise RuntimeError("the robot has no answer for two minutes")
        times, errors = self._ours.recv()
        self.errors.update(errors)
        return list(times)


def _ask_forever(url: str, key: str, seed: int, orders: "Connection[object, object]") -> None:
    times, errors = list[float](), Counter[str]()
    headers = {"Authorization": f"Bearer {key}"}
    with httpx.Client(base_url=url, headers=headers, timeout=_TIMEOUT) as client:
        while True:
            while orders.poll():
                order = orders.recv()
                if order == "stop":
                    return
                if order == "end":
                    orders.send((times, errors))
                times, errors = [], Counter()
            began = time.perf_counter()
            try:
                response = client.post(f"/v1/collections/{HONEST}/queries", json=body(seed))
            except httpx.TransportError as error:
                errors[type(error).__name__] += 1
            else:
                if response.status_code != 200:
                    errors[str(response.status_code)] += 1
                elif response.json()["verdict"] != "matched":
                    errors["not matched"] += 1
            # A refusal or an error costs the robot this time, too.
            times.append(1e3 * (time.perf_counter() - began))
            time.sleep(_PAUSE)
