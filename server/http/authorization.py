"""Who may pass: every route asks before it reads a body or looks at anything."""

from collections.abc import Callable, Coroutine
from typing import Any

import anyio.to_thread
from fastapi import Request, Response
from fastapi.routing import APIRoute

from server.access import NOBODY, Caller
from server.errors import NotFound, Unauthorized
from server.http.scopes import SCOPES
from server.keys import Doorkeeper


class GuardedRoute(APIRoute):
    """A route that lets callers in whose key has the scope of its operation and sees the collection in its path.

    A collection that the key does not see is told of as one that is not there.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Let in first, then handle. Raises KeyError for an operation of which no scope is said."""
        handle = self.make_handler()
        scope = SCOPES[self.operation_id] if self.operation_id is not None else None
        if scope is None:
            return handle

        async def handle_admitted(request: Request) -> Response:
            caller = await who_asks(request)
            caller.require(scope)
            collection = request.path_params.get("collection")
            if collection is not None and not caller.sees(collection):
                raise NotFound("collection", collection)
            request.state.caller = caller
            return await handle(request)

        return handle_admitted

    def make_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """What handles a request of a caller who was let in."""
        return super().get_route_handler()


async def who_asks(request: Request) -> Caller:
    """The caller. Raises Unauthorized."""
    keeper: Doorkeeper = request.app.state.doorkeeper
    authorization = request.headers.get("authorization")
    remembered = keeper.recall(authorization)
    if remembered is not None:
        return remembered
    return await anyio.to_thread.run_sync(keeper.ask, authorization)


async def get_caller(request: Request) -> Caller:
    """The caller that a guarded route let in."""
    caller: Caller = getattr(request.state, "caller", NOBODY)
    return caller


async def get_visitor(request: Request) -> Caller:
    """The caller of a page that is open to all, and shows each what they see."""
    try:
        return await who_asks(request)
    except Unauthorized:
        return NOBODY
