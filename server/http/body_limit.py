"""The limit on the size of a request's body."""

import re
from collections.abc import Mapping

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.errors import TooLarge
from server.http.problems import domain_problem, problem
from server.problem_types import OTHER

# An answer that is sent while the caller still sends may be lost to a reset, so a body that is over the limit is read
# on for a while.
_PATIENCE = 4


class BodyLimit:
    """Refuses bodies over the limit, by Content-Length before a byte is read, and by count while they stream in.

    And those that say twice where they end.
    """

    def __init__(self, app: ASGIApp, limit: int) -> None:
        self._app = app
        self._limit = limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        headers = Headers(scope=scope) if scope["type"] == "http" else Headers()
        if "content-length" in headers and "transfer-encoding" in headers:
            # A proxy may go by the other one, and then what is a body to it is the next caller's request to us.
            detail = "Content-Length and Transfer-Encoding say both where the body ends; send one of them."
            await problem(OTHER, detail, scope, headers={"Connection": "close"})(scope, receive, send)
            return
        if scope["type"] != "http" or is_streamed(scope):
            await self._app(scope, receive, send)
            return
        declared = declared_length(headers)
        if declared is not None and declared > self._limit:
            if headers.get("expect", "").lower() != "100-continue":
                await self._drain(receive, 0)
            await domain_problem(self._too_large(declared), scope)(scope, receive, send)
            return
        received = 0

        async def counted() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > self._limit:
                if message.get("more_body", False):
                    await self._drain(receive, received)
                raise self._too_large(None)
            return message

        await self._app(scope, counted, send)

    async def _drain(self, receive: Receive, received: int) -> None:
        while received <= _PATIENCE * self._limit:
            message = await receive()
            received += len(message.get("body", b""))
            if message["type"] != "http.request" or not message.get("more_body", False):
                return

    def _too_large(self, got: int | None) -> TooLarge:
        return TooLarge("body_bytes", self._limit, got, "Send fewer landmarks at a time.")


_STREAMED = re.compile(r"/v1/collections/[^/]+/imports")


def is_streamed(scope: Scope) -> bool:
    """Whether the route reads its body piece by piece, and minds its size itself."""
    return scope["type"] == "http" and _STREAMED.fullmatch(scope["path"]) is not None


def declared_length(headers: Mapping[str, str]) -> int | None:
    """What Content-Length says, None where it says nothing that can be read."""
    length = headers.get("content-length", "")
    return int(length) if length.isascii() and length.isdigit() else None
