"""`urquhart serve` that notes when each query comes by: `python -m benchmarks.service.marks serve ...`.

Functions that a query runs through are wrapped; the service's own code does not know of it. One query at a time: the
marks of a request are the ones between the arrival of its first byte and the end of its answer.
"""

import os
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, Final, NamedTuple

import orjson

from server.http import authorization, json_body, request_logging
from server.http.serving.connections import TimedConnection
from server.index.live_indexes import LiveIndexes, View
from server.queries import lookup, search

FILE: Final = "BENCHMARK_MARKS"
"""Environment variable with the path of the file that the marks of each request are appended to, as JSON."""


class Mark(NamedTuple):
    """How far a request has come: nanoseconds of the clock that all processes share, and of the processor's time."""

    name: str
    wall: int
    cpu: int


_marks: list[Mark] = []


def mark(name: str) -> None:
    """Note that the request has come so far."""
    _marks.append(Mark(name, time.perf_counter_ns(), time.process_time_ns()))


def install(path: Path) -> None:
    """Wrap what a query runs through; append the marks of each request to a file."""
    _wrap(TimedConnection, "data_received", before="received")
    _wrap(authorization, "_authenticate_and_count", before="routed")
    _wrap(json_body, "read_json", before="body", after="parsed")
    _wrap(lookup, "answer_as_json", before="called")
    _wrap(lookup, "describe_query", before="snapshot")
    _wrap(search.SubmapSearch, "find", after="searched")
    _wrap(lookup, "answer_json", before="answered", after="serialised")
    setattr(LiveIndexes, "view", _viewing(LiveIndexes.view))  # noqa: B010  as `_wrap` does
    recorded = _recording(request_logging.RequestLogging.__call__, path)
    setattr(request_logging.RequestLogging, "__call__", recorded)  # noqa: B010


def _wrap(owner: Any, name: str, *, before: str = "", after: str = "") -> None:
    inner = getattr(owner, name)

    @wraps(inner)
    def marked(*args: Any, **named: Any) -> Any:
        if before:
            mark(before)
        found = inner(*args, **named)
        if after:
            mark(after)
        return found

    setattr(owner, name, marked)


def _viewing(inner: Callable[..., Any]) -> Callable[..., Any]:
    @contextmanager
    def view(self: LiveIndexes, collection_id: str) -> Iterator[View]:
        mark("asked")
        with inner(self, collection_id) as found:
            yield found

    return view


def _recording(inner: Callable[..., Awaitable[None]], path: Path) -> Callable[..., Awaitable[None]]:
    async def handled(self: Any, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await inner(self, scope, receive, send)
            return
        mark("layers")
        await inner(self, scope, receive, send)
        mark("done")
        with path.open("ab") as file:
            file.write(orjson.dumps([tuple(one) for one in _marks]) + b"\n")
        _marks.clear()

    return handled


if __name__ == "__main__":
    from server.cli import main

    install(Path(os.environ[FILE]))
    main()
