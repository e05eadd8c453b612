"""The limit on the size of a request's body."""

import re
from collections.abc import Mapping

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.errors import TooLarge
from server.http.problems import domain_problem, problem
from server.problem_types import OTHER

# The rest of a body over the limit is read for a while, because an answer that is sent while the caller still sends may
# be lost to a reset.
_PATIENCE = 4


class BodyLimit:
    """Refuses bodies over the limit: by Content-Length before reading, or by counting while they arrive.

    Also refuses requests that give the end of their body twice.
    """

    def __init__(self, app: ASGIApp, limit: int) -> None:
        self._app = app
        self._limit = limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        headers = Headers(scope=scope) if scope["type"] == "http" else Headers()
        if "content-length" in headers and "transfer-encoding" in headers:
            # A proxy may believe the other header. Then the rest of this body would be another caller's request to us.
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


_STREAMED = re.compile(r"/v1/collections/[^/]+/(imports|coregistrations)")


def is_streamed(scope: Scope) -> bool:
    """Whether the route reads its body piece by piece and checks its size itself."""
    return scope["type"] == "http" and _STREAMED.fullmatch(scope["path"]) is not None


def declared_length(headers: Mapping[str, str]) -> int | None:
    """The value of Content-Length, None if it is missing or not a number."""
    length = headers.get("content-length", "")
    return int(length) if length.isascii() and length.isdigit() else None
