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
    """A connection to one service; usable as a context manager, and by several threads at once.

    Every call raises `ProblemError` when the service refuses, `ConnectionFailed` when it cannot be reached and
    `UnexpectedAnswer` when something else answers. What is harmless to repeat is sent again by itself where the
    connection breaks or the service is busy, as `retry` says: reads, PUT and DELETE, queries that are not stored, and
    POSTs, which carry an Idempotency-Key. A PUT with `if_match` that is sent again may meet its own first attempt and
    be refused (412): read the submap to see whether it is yours.
    """


class AsyncClient(AsyncServiceCalls, AsyncSubmapCalls, AsyncQueryCalls, AsyncJobCalls):
    """The same for asyncio: calls are awaited, listings are asynchronous iterators."""
