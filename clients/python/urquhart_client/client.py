"""The clients: a blocking one and an asynchronous one, with the same calls."""

from urquhart_client._async.files import AsyncFileCalls
from urquhart_client._async.queries import AsyncQueryCalls
from urquhart_client._async.service_and_collections import AsyncServiceCalls
from urquhart_client._async.submaps import AsyncSubmapCalls
from urquhart_client._sync.files import FileCalls
from urquhart_client._sync.queries import QueryCalls
from urquhart_client._sync.service_and_collections import ServiceCalls
from urquhart_client._sync.submaps import SubmapCalls


class Client(ServiceCalls, SubmapCalls, QueryCalls, FileCalls):
    """A client of one service. It is a context manager, and several threads may use it, also after a fork.

    Every call raises `ProblemError` if the service refuses, `ConnectionFailed` if it cannot be reached, and
    `UnexpectedAnswer` if something else answers, or the answer is to another request. If the connection breaks or the
    service is busy, the client sends the request again, as `retry` says. Every write has an Idempotency-Key, so the
    service carries it out once and answers a repetition with the first answer. A search that took longer than `timeout`
    is not repeated.
    """


class AsyncClient(AsyncServiceCalls, AsyncSubmapCalls, AsyncQueryCalls, AsyncFileCalls):
    """The same client for asyncio, on any number of event loops: calls are coroutines, lists are asynchronous
    iterators.
    """
