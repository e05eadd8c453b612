"""One client in several processes, threads and event loops: every answer is the one to the caller's own request."""

import asyncio
import multiprocessing
import os
import pickle
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from tests.client.fake import COLLECTION
from tests.server.factories import forest, observed
from tests.server.processes import Server
from urquhart_client import AsyncClient, Client, Retry, UnexpectedAnswer

WORKERS = 4
PLACES = 4
GETS = 100
QUERIES = 10


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service with a forest for each worker."""
    folder = tmp_path_factory.mktemp("service")
    started = Server(folder / "urquhart.db", folder / "log")
    with Client(str(started.client.base_url)) as client:
        client.put_collection("plots")
        for place in range(PLACES):
            client.put_submap("plots", f"p{place}", xy=forest(place))
    yield started
    started.close()


def strangers(client: Client, worker: int) -> list[str]:
    """Answers that are not to what this worker asked."""
    own, wrong = f"p{worker % PLACES}", []
    seen, _ = observed(forest(worker % PLACES), worker)
    for i in range(GETS):
        found = client.get_submap("plots", own).id
        wrong += [] if found == own else [found]
        if i % (GETS // QUERIES) == 0:
            best = client.query("plots", seen).best
            wrong += [] if best is not None and best.submap_id == own else [str(best)]
    return wrong


def together(work: Callable[[int], list[str]], start_method: str = "fork") -> list[list[str]]:
    """What `work` returns in processes that run at once."""
    context = multiprocessing.get_context(start_method)
    with context.Pool(WORKERS) as pool:
        return pool.map_async(work, range(WORKERS), chunksize=1).get(timeout=300.0)


def test_forked_workers_get_their_own_answers(server: Server) -> None:
    client = Client(str(server.client.base_url))
    client.get_submap("plots", "p0")
    global _work
    _work = lambda worker: strangers(client, worker)  # noqa: E731 (what a fork inherits is named here)
    assert together(_run) == [[]] * WORKERS
    assert client.get_submap("plots", "p1").id == "p1"
    client.close()


def test_forked_workers_of_an_awaiting_client_get_their_own_answers(server: Server) -> None:
    client = AsyncClient(str(server.client.base_url))

    async def gets(worker: int) -> list[str]:
        own = f"p{worker % PLACES}"
        found = [await client.get_submap("plots", own) for _ in range(GETS)]
        return [one.id for one in found if one.id != own]

    async def parent() -> list[list[str]]:
        await client.get_submap("plots", "p0")
        global _work
        _work = lambda worker: in_a_loop(gets(worker))  # noqa: E731
        answers = await asyncio.to_thread(together, _run)
        await client.close()
        return answers

    assert asyncio.run(parent()) == [[]] * WORKERS


def in_a_loop(work: object) -> list[str]:
    """Run in a new event loop. The one that a fork inherits still counts as running."""
    asyncio.events._set_running_loop(None)
    return asyncio.run(work)  # type: ignore[arg-type]


_work: Callable[[int], list[str]]


def _run(worker: int) -> list[str]:
    return _work(worker)


def test_threads_share_a_client(server: Server) -> None:
    with Client(str(server.client.base_url)) as client, ThreadPoolExecutor(WORKERS) as pool:
        assert list(pool.map(lambda worker: strangers(client, worker), range(WORKERS))) == [[]] * WORKERS


def loops(url: str) -> tuple[list[list[str]], str]:
    """What one client reads in three loops one after the other and three at once, and what it says when closed."""
    client = AsyncClient(url)

    async def several() -> list[str]:
        found = await asyncio.gather(*(client.get_submap("plots", f"p{i % PLACES}") for i in range(20)))
        return [one.id for one in found]

    read = [asyncio.run(several()) for _ in range(3)]
    with ThreadPoolExecutor(3) as pool:
        read += pool.map(lambda _: asyncio.run(several()), range(3))
    asyncio.run(client.close())
    try:
        asyncio.run(several())
    except RuntimeError as error:
        return read, str(error)
    return read, ""


def test_an_awaiting_client_serves_several_loops(server: Server) -> None:
    # In a process of its own: connections of a loop that has ended cannot be closed, and Python warns of each.
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        read, said = pool.apply(loops, (str(server.client.base_url),))
    assert read == [[f"p{i % PLACES}" for i in range(20)]] * 6
    assert "closed" in said


def from_a_copy(packed: bytes) -> str:
    """What a copy of a client reads."""
    client: Client = pickle.loads(packed)
    with client:
        return client.get_submap("plots", "p2").id


def test_a_client_can_be_sent_to_another_process(server: Server) -> None:
    with Client(str(server.client.base_url), api_key="urq_key", retry=Retry(attempts=2), timeout=7.0) as client:
        client.get_submap("plots", "p0")
        packed = pickle.dumps(client)
        assert from_a_copy(packed) == "p2"
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            assert pool.apply(from_a_copy, (packed,)) == "p2"


def test_a_transport_of_the_callers_is_not_used_after_a_fork() -> None:
    transport = httpx.MockTransport(lambda _: httpx.Response(200, json=COLLECTION))
    client = Client("http://service", transport=transport)
    client.get_collection("plots")
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            client.get_collection("plots")
        except RuntimeError as error:
            os.write(write, str(error).encode())
        finally:
            os._exit(0)
    os.close(write)
    os.waitpid(child, 0)
    with os.fdopen(read) as told:
        assert "after a fork" in told.read()
    client.close()
    with pytest.raises(RuntimeError, match="closed"):
        client.get_collection("plots")


def test_the_answer_to_another_request_is_refused() -> None:
    mixed = iter([True, False])

    def answer(request: httpx.Request) -> httpx.Response:
        sent = request.headers["X-Request-Id"]
        return httpx.Response(200, json=COLLECTION, headers={"X-Request-Id": "another" if next(mixed) else sent})

    with Client("http://service", transport=httpx.MockTransport(answer)) as client:
        with pytest.raises(UnexpectedAnswer, match="another request"):
            client.get_collection("plots")
        assert client.get_collection("plots").id == "plots"


def test_the_connection_that_mixed_answers_up_is_closed() -> None:
    """By a server that answers with a foreign id first: the next request comes on another connection."""
    body = httpx.Response(200, json=COLLECTION).content
    head = b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: %d\r\nX-Request-Id: %s\r\n\r\n"
    seen: list[int] = []
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            for number in range(2):
                connection, _ = listener.accept()
                with connection:
                    while request := connection.recv(65536):
                        seen.append(number)
                        own = next(line[14:] for line in request.split(b"\r\n") if line.lower().startswith(b"x-req"))
                        connection.sendall(head % (len(body), own.strip() if number else b"another") + body)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        with Client(f"http://127.0.0.1:{listener.getsockname()[1]}") as client:
            with pytest.raises(UnexpectedAnswer):
                client.get_collection("plots")
            assert client.get_collection("plots").id == "plots"
        thread.join(60.0)
    assert seen == [0, 1]


def test_ids_are_compared_in_streams_too() -> None:
    transport = httpx.MockTransport(lambda _: httpx.Response(200, text="{}\n", headers={"X-Request-Id": "another"}))
    with Client("http://service", transport=transport) as client, pytest.raises(UnexpectedAnswer):
        list(client.job_results("j"))
