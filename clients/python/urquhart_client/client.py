"""The clients: one that blocks, one that awaits; the same calls, made of the same requests."""

from urquhart_client._async.jobs import AsyncJobCalls
from urquhart_client._async.queries import AsyncQueryCalls
from urquhart_client._async.service import AsyncServiceCalls
from urquhart_client._async.submaps import AsyncSubmapCalls
from urquhart_client._sync.jobs import JobCalls
from urquhart_client._sync.queries import QueryCalls
from urquhart_client._sync.service import ServiceCalls
from urquhart_client._sync.submaps import SubmapCalls


class Client(ServiceCalls, SubmapCalls, QueryCalls, JobCalls):
    """A client of one service; usable as a context manager, by several threads at once, and after a fork.

    Every call raises `ProblemError` when the service refuses, `ConnectionFailed` when it cannot be reached and
    `UnexpectedAnswer` when something else answers, or the answer is to another request. Where the connection breaks
    or the service is busy, the client sends the request again, as `retry` says. Every write carries an
    Idempotency-Key, so the service does it once and answers a repetition with the first answer. The client does not
    repeat a search that took longer than `timeout`.
    """


class AsyncClient(AsyncServiceCalls, AsyncSubmapCalls, AsyncQueryCalls, AsyncJobCalls):
    """The same for asyncio, on any number of event loops: calls are awaited, listings are asynchronous iterators."""
