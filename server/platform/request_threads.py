"""Threads for the work of requests, given out by the event loop.

A query goes to a thread and back. With the framework's threads that takes 0.10 ms of processor time, with these 0.05
(`python -m benchmarks.service --only waterfall`): there is no cancel scope, limiter or Python lock on the way.
"""

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from contextvars import Context, copy_context
from queue import SimpleQueue
from typing import Any, Generic, TypeVar

Result = TypeVar("Result")


class _Call(Generic[Result]):
    """A call, the context that it is made in, and the future that waits for its result on an event loop."""

    __slots__ = ("_call", "_context", "_error", "_result", "future")

    def __init__(self, call: Callable[[], Result], future: "asyncio.Future[Result]") -> None:
        self._call, self.future = call, future
        self._context: Context = copy_context()
        self._result: Result | None = None
        self._error: BaseException | None = None

    def work(self) -> None:
        """Make the call. Runs in a thread."""
        try:
            self._result = self._context.run(self._call)
        except BaseException as error:  # noqa: BLE001  it belongs to the one who waits
            self._error = error

    def tell(self) -> None:
        """Hand the result over, unless nobody waits for it any more. Runs on the event loop."""
        if self.future.cancelled():
            return
        if self._error is not None:
            self.future.set_exception(self._error)
        else:
            self.future.set_result(self._result)  # type: ignore[arg-type]


class _Thread:
    """A thread that does one task after the other, and is idle in between."""

    def __init__(self, number: int, finished: "Callable[[_Thread, _Call[Any]], None]") -> None:
        self._tasks: SimpleQueue[_Call[Any] | None] = SimpleQueue()
        self._finished = finished
        # Not waited for at the exit of the process: a search that hangs must not keep it.
        threading.Thread(target=self._work, name=f"request-{number}", daemon=True).start()

    def take(self, task: _Call[Any] | None) -> None:
        """The next task; None to end."""
        self._tasks.put(task)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            task.work()
            loop = task.future.get_loop()
            try:
                loop.call_soon_threadsafe(self._finished, self, task)
            except RuntimeError:  # the loop was closed: nobody waits, and there is no more work
                return
            del task  # what it holds, an answer perhaps, is not kept until the next one


class RequestThreads:
    """At most so many threads. A call beyond waits for one that is free; the one that was used last is taken first.

    To be used on one event loop. A call is not ended when the one who waits for it is cancelled.
    """

    def __init__(self, most: int) -> None:
        self._most, self._count = most, 0
        self._idle: list[_Thread] = []
        self._waiting: deque[_Call[Any]] = deque()

    async def run(self, call: Callable[[], Result]) -> Result:
        """Make a call in a thread, with the context variables of the caller. Raises what the call raises."""
        task = _Call(call, asyncio.get_running_loop().create_future())
        if self._idle:
            self._idle.pop().take(task)
        elif self._count < self._most:
            self._count += 1
            _Thread(self._count, self._is_free).take(task)
        else:
            self._waiting.append(task)
        result: Result = await task.future
        return result

    def stop(self) -> None:
        """End the threads that are idle; the others end with their process."""
        while self._idle:
            self._idle.pop().take(None)
            self._count -= 1

    def _is_free(self, thread: _Thread, task: _Call[Any]) -> None:
        if self._waiting:
            thread.take(self._waiting.popleft())
        else:
            self._idle.append(thread)
        task.tell()
