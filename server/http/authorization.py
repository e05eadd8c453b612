"""Authorization: every route checks the caller before it reads a body or anything else."""

from collections.abc import Callable, Coroutine, Set
from typing import Any

import anyio.to_thread
from fastapi import Request, Response
from fastapi.routing import APIRoute

from server.errors import InvalidField, NotFound, TooManyRequests, Unauthorized
from server.http.body_limit import is_streamed
from server.http.direct_call import DirectCall
from server.http.session_cookie import credentials_of
from server.security.authenticator import Authenticator
from server.security.operation_scopes import ALSO, SCOPES
from server.security.principal import ANONYMOUS, Principal
from server.security.rate_limit import RateLimiter


class GuardedRoute(APIRoute):
    """A route that admits callers whose key has the scope of its operation and may see the collection in its path.

    A collection that the key may not see is answered like one that does not exist.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Check the caller, then handle. Raises KeyError for an operation without an entry in the table of scopes."""
        handle = self.make_handler()
        scope = SCOPES[self.operation_id] if self.operation_id is not None else None
        also = ALSO.get(self.operation_id or "", frozenset())
        known = {parameter.alias for parameter in self.dependant.query_params}
        reads_body = self.body_field is not None

        async def handle_whole(request: Request) -> Response:
            if not reads_body and not is_streamed(request.scope):
                await request.body()  # also sets the caller of the request's admission
            return await handle(request)

        if scope is None:
            return handle_whole

        async def handle_admitted(request: Request) -> Response:
            caller = await _authenticate_and_count(request)
            request.state.caller = caller
            if not caller.scopes & also:
                caller.require(scope)
            collection = request.path_params.get("collection")
            if collection is not None and not caller.sees(collection):
                raise NotFound("collection", collection)
            _check_parameters(request, known)
            return await handle_whole(request)

        return handle_admitted

    def make_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler for requests of admitted callers."""
        handle, direct = super().get_route_handler(), DirectCall.of(self)
        if direct is None or self.body_field is not None:
            return handle

        async def handle_directly(request: Request) -> Response:
            return await direct(request) or await handle(request)

        return handle_directly


def _check_parameters(request: Request, known: Set[str]) -> None:
    """Refuse unknown and repeated query parameters, because ignoring one would answer another question."""
    if not request.scope["query_string"]:
        return
    names = [name for name, _ in request.query_params.multi_items()]
    for name in names:
        if name not in known:
            offered = f"it has {', '.join(sorted(known))}" if known else "it has none"
            raise InvalidField(
                f"is not a parameter of this path; {offered}", code="unknown_parameter", parameter=name[:100]
            )
        if names.count(name) > 1:
            raise InvalidField("is given more than once; give it once", code="repeated_parameter", parameter=name)


async def authenticate(request: Request) -> Principal:
    """The caller. Raises Unauthorized."""
    authenticator: Authenticator = request.app.state.authenticator
    authorization = credentials_of(request.headers, request.method)
    remembered = authenticator.from_cache(authorization)
    if remembered is not None:
        return remembered
    return await anyio.to_thread.run_sync(authenticator.authenticate, authorization)


async def _authenticate_and_count(request: Request) -> Principal:
    """The caller, counted against its rate: by key, or by address without one. Raises Unauthorized, TooManyRequests."""
    rates: RateLimiter = request.app.state.service.rates
    address = request.client.host if request.client is not None else ""
    try:
        caller = await authenticate(request)
    except Unauthorized:
        _count(request, rates, f"address {address}")
        raise
    _count(request, rates, f"key {caller.id}" if caller.id else f"address {address}")
    return caller


def _count(request: Request, rates: RateLimiter, caller: str) -> None:
    try:
        rates.take(caller)
    except TooManyRequests:
        request.app.state.service.metrics.rejected.labels("rate").inc()
        raise


async def get_principal(request: Request) -> Principal:
    """The caller that a guarded route admitted."""
    caller: Principal = getattr(request.state, "caller", ANONYMOUS)
    return caller


async def get_visitor(request: Request) -> Principal:
    """The caller of a page that is open to everybody, which shows what the caller may see."""
    try:
        return await authenticate(request)
    except Unauthorized:
        return ANONYMOUS
