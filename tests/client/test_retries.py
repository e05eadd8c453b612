"""What is sent again, when, and what is not; and that nothing is done twice for it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.client.fake import COLLECTION, RECEIPT, RESULT
from urquhart_client import AsyncClient, Client, ConnectionFailed, ProblemError, Retry

Answer = httpx.Response | Exception
BUSY = httpx.Response(503, json={"title": "busy", "status": 503}, headers={"Retry-After": "0"})
LOST = httpx.ReadError("the link is gone")
FAST = Retry(attempts=4, first=0.001, most=0.002, deadline=5.0)


class FlakyService:
    """Answers in turn, the last for ever; keeps what came in."""

    def __init__(self, *answers: Answer) -> None:
        self.answers, self.requests = list(answers), list[httpx.Request]()

    def __call__(self, request: httpx.Request) -> httpx.Response:
        request.read()
        self.requests.append(request)
        answer = self.answers[min(len(self.requests), len(self.answers)) - 1]
        if isinstance(answer, Exception):
            raise answer
        return answer


def client(service: FlakyService, retry: Retry = FAST) -> Client:
    return Client("http://service", transport=httpx.MockTransport(service), retry=retry)


def ok(document: Any, status: int = 200) -> httpx.Response:
    return httpx.Response(status, json=document)


CALLS: list[tuple[str, Callable[[Client], object], httpx.Response]] = [
    ("get", lambda c: c.get_collection("plots"), ok(COLLECTION)),
    ("put", lambda c: c.put_submap("plots", "p7", xy=[(0, 0)]), ok(RECEIPT)),
    ("post", lambda c: c.post_submap("plots", xy=[(0, 0)]), ok(RECEIPT, 201)),
    ("query", lambda c: c.query("plots", xy=[(0, 0)]), ok(RESULT)),
    ("query that is kept", lambda c: c.query("plots", xy=[(0, 0)], store=True), ok(RESULT)),
    ("batch", lambda c: c.query_batch("plots", [{"xy": [[0, 0]]}]), ok({"results": [RESULT]})),
    ("delete", lambda c: c.delete_submap("plots", "p7"), httpx.Response(204)),
]


@pytest.mark.parametrize(("name", "call", "answer"), CALLS, ids=[name for name, *_ in CALLS])
@pytest.mark.parametrize("trouble", [BUSY, LOST, httpx.ConnectError("no route")], ids=["busy", "lost", "no route"])
def test_what_is_harmless_is_sent_again(
    name: str, call: Callable[[Client], object], answer: httpx.Response, trouble: Answer
) -> None:
    service = FlakyService(trouble, trouble, answer)
    call(client(service))
    assert len(service.requests) == 3
    first, *others = service.requests
    for other in others:
        assert (other.method, other.url, other.content) == (first.method, first.url, first.content)
        assert other.headers.get("Idempotency-Key") == first.headers.get("Idempotency-Key")
    assert (name not in ("get", "query", "batch")) == ("Idempotency-Key" in first.headers)


LATE = httpx.ReadTimeout("no answer in time")


@pytest.mark.parametrize(
    "late", [LATE, httpx.Response(504, json={"title": "late", "status": 504})], ids=["own", "proxy"]
)
@pytest.mark.parametrize("name", ["query", "batch"])
def test_a_search_that_took_too_long_is_not_begun_again(name: str, late: Answer) -> None:
    call = next(call for known, call, _ in CALLS if known == name)
    service = FlakyService(late)
    with pytest.raises((ConnectionFailed, ProblemError)):
        call(client(service))
    assert len(service.requests) == 1


def test_a_write_that_took_too_long_joins_its_first_attempt() -> None:
    running = httpx.Response(409, json={"title": "still running", "status": 409}, headers={"Retry-After": "0"})
    service = FlakyService(LATE, running, ok(RECEIPT, 201))
    assert client(service).post_submap("plots", xy=[(0, 0)], query={}).id == "p7"
    assert len({request.headers["Idempotency-Key"] for request in service.requests}) == 1
    assert len({request.headers["X-Request-Id"] for request in service.requests}) == 3


WRITES: list[Callable[[Client], object]] = [
    lambda c: c.put_collection("plots"),
    lambda c: c.patch_collection("plots", title="t"),
    lambda c: c.delete_collection("plots"),
    lambda c: c.put_submap("plots", "p7", xy=[(0, 0)]),
    lambda c: c.post_submap("plots", xy=[(0, 0)]),
    lambda c: c.patch_submap("plots", "p7", properties={}),
    lambda c: c.delete_submap("plots", "p7"),
    lambda c: c.query("plots", xy=[], store=True),
    lambda c: c.query_batch("plots", [{"xy": []}, {"xy": [], "store": True}]),
    lambda c: c.import_file("plots", __file__, wait=False),
    lambda c: c.reindex("plots"),
    lambda c: c.constraints("plots"),
    lambda c: c.delete_job("j"),
    lambda c: c.create_snapshot(),
    lambda c: c.delete_snapshot("s"),
]


@pytest.mark.parametrize("call", WRITES)
def test_every_write_carries_a_key_of_its_own_for_all_its_attempts(call: Callable[[Client], object]) -> None:
    service = FlakyService(LOST)
    for calls in (1, 2):
        with pytest.raises(ConnectionFailed):
            call(client(service))
        assert len(service.requests) == 4 * calls
        assert len({request.headers["Idempotency-Key"] for request in service.requests}) == calls


@pytest.mark.parametrize("status", [400, 401, 403, 404, 409, 412, 413, 422, 500, 507])
def test_a_refusal_is_final(status: int) -> None:
    service = FlakyService(httpx.Response(status, json={"title": "no", "status": status}))
    with pytest.raises(ProblemError) as refused:
        client(service).get_collection("plots")
    assert (refused.value.status, len(service.requests)) == (status, 1)


@pytest.mark.parametrize("status", [408, 429, 502, 503, 504])
def test_it_gives_up_in_the_end(status: int) -> None:
    service = FlakyService(httpx.Response(status, json={"title": "later", "status": status}))
    with pytest.raises(ProblemError):
        client(service).get_collection("plots")
    assert len(service.requests) == 4
    with pytest.raises(ProblemError):
        client(FlakyService(BUSY), Retry(attempts=1)).get_collection("plots")


def test_a_delete_that_was_lost_and_done_is_done() -> None:
    gone = httpx.Response(404, json={"title": "not found", "status": 404})
    client(FlakyService(LOST, gone)).delete_submap("plots", "p7")
    with pytest.raises(ProblemError):
        client(FlakyService(gone)).delete_submap("plots", "p7")
    with pytest.raises(ProblemError):
        client(FlakyService(BUSY, gone)).delete_submap("plots", "p7")


def test_pauses_grow_and_end() -> None:
    retry = Retry(attempts=10, first=1.0, most=4.0, deadline=30.0)
    for attempt, most in ((1, 1.0), (2, 2.0), (3, 4.0), (9, 4.0)):
        drawn = [retry.pause(attempt, 0.0) for _ in range(200)]
        assert all(pause is not None and 0.0 <= pause <= most for pause in drawn)
        assert max(pause or 0.0 for pause in drawn) > 0.7 * most
    assert retry.pause(10, 0.0) is None
    assert retry.pause(1, 30.0) is None
    asked = retry.pause(1, 0.0, status=503, asked=5.0)
    assert asked is not None and 5.0 <= asked <= 6.0
    assert retry.pause(1, 0.0, status=503, asked=60.0) is None
    assert retry.pause(1, 0.0, status=404) is None


def test_an_upload_is_sent_whole_each_time(tmp_path: Path) -> None:
    import gzip

    content = b'{"id": "a"}\n' * 100_000
    (tmp_path / "season.ndjson").write_bytes(content)
    job = {"id": "j", "type": "import", "collection": "plots", "state": "accepted", "created": "2026-05-04T09:30:00Z"}
    service, told = FlakyService(LOST, BUSY, ok(job, 202)), list[int]()
    client(service).import_file(
        "plots", tmp_path / "season.ndjson", wait=False, progress=lambda progress: told.append(progress.done)
    )
    assert [gzip.decompress(request.content) for request in service.requests] == [content] * 3
    assert len({request.headers["Idempotency-Key"] for request in service.requests}) == 1
    assert told[-1] == len(content)


def test_keys_are_sent_and_not_shown() -> None:
    service = FlakyService(LOST)
    keyed = Client("http://service", api_key="urq_secret", transport=httpx.MockTransport(service), retry=FAST)
    with pytest.raises(ConnectionFailed) as failed:
        keyed.get_collection("plots")
    assert service.requests[0].headers["Authorization"] == "Bearer urq_secret"
    assert "secret" not in repr(keyed) + str(failed.value)


@pytest.mark.parametrize("key", ["urq_secret\n", "urq secret", "urq_s\u00e9cret", ""])
def test_keys_that_no_service_gave_are_refused_and_not_shown(key: str) -> None:
    for kind in (Client, AsyncClient):
        with pytest.raises(ValueError, match="API key") as refused:
            kind("http://service", api_key=key)
        assert "cret" not in str(refused.value)


def test_large_bodies_are_packed() -> None:
    service = FlakyService(ok(RECEIPT))
    client(service).put_submap("plots", "p7", xy=[(float(i), 0.5) for i in range(3000)])
    assert service.requests[0].headers["Content-Encoding"] == "gzip"
    plain = Client("http://service", compress=False, transport=httpx.MockTransport(service))
    plain.put_submap("plots", "p7", xy=[(float(i), 0.5) for i in range(3000)])
    assert "Content-Encoding" not in service.requests[1].headers


@pytest.mark.anyio
async def test_the_awaiting_client_does_the_same() -> None:
    busy = httpx.Response(503, content=b'{"title": "busy"}', headers={"Content-Type": "application/json"})
    service = FlakyService(LOST, busy, ok(RECEIPT, 201))
    async with AsyncClient("http://service", transport=httpx.MockTransport(service), retry=FAST) as awaiting:
        receipt = await awaiting.post_submap("plots", xy=[(0, 0)])
    assert receipt.id == "p7"
    assert len({request.headers["Idempotency-Key"] for request in service.requests}) == 1
    assert len(service.requests) == 3


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"
