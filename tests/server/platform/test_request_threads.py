"""Threads of requests: results, errors, contexts, and no more of them than allowed."""

import asyncio
import threading
from contextvars import ContextVar
from functools import partial

import pytest

from server.platform.request_threads import RequestThreads

NAME: ContextVar[str] = ContextVar("name", default="nobody")


def test_a_call_has_the_context_of_its_caller_and_gives_its_result() -> None:
    async def ask() -> tuple[str, int]:
        NAME.set("robot")
        return await RequestThreads(1).run(lambda: (NAME.get(), threading.get_ident()))

    name, thread = asyncio.run(ask())
    assert name == "robot"
    assert thread != threading.get_ident()


def test_errors_come_back() -> None:
    def fail() -> None:
        raise KeyError("a")

    with pytest.raises(KeyError, match="a"):
        asyncio.run(RequestThreads(1).run(fail))


def test_calls_beyond_the_threads_wait() -> None:
    running, most, order = 0, 0, list[int]()
    guard = threading.Lock()

    def work(number: int) -> int:
        nonlocal running, most
        with guard:
            running += 1
            most = max(most, running)
            order.append(number)
        threading.Event().wait(0.01)
        with guard:
            running -= 1
        return number

    async def ask() -> list[int]:
        threads = RequestThreads(2)
        found = await asyncio.gather(*(threads.run(partial(work, number)) for number in range(6)))
        threads.stop()
        return list(found)

    assert asyncio.run(ask()) == list(range(6))
    assert most == 2
    assert sorted(order) == list(range(6))


def test_the_thread_that_was_used_last_is_used_again() -> None:
    async def ask() -> set[int]:
        threads = RequestThreads(4)
        return {await threads.run(threading.get_ident) for _ in range(5)}

    assert len(asyncio.run(ask())) == 1


def test_a_call_goes_on_when_nobody_waits_for_it_any_more() -> None:
    go, done = threading.Event(), threading.Event()

    def work() -> None:
        go.wait(10.0)
        done.set()

    async def ask() -> int:
        threads = RequestThreads(1)
        waiting = asyncio.create_task(threads.run(work))
        await asyncio.sleep(0)
        waiting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await waiting
        go.set()
        return await threads.run(lambda: 7)  # the thread is free again after that

    assert asyncio.run(ask()) == 7
    assert done.is_set()
