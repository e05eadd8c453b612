"""gzip, in and out: a landmark list in JSON shrinks to a third, and a robot's link is thin."""

import zlib
from functools import partial
from gzip import compress
from typing import Final

import anyio.to_thread
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.errors import MalformedBody, TooLarge, UnsupportedMediaType
from server.http.body_limit import is_streamed
from server.http.negotiation import accepts_coding
from server.http.problems import domain_problem

_LEAST: Final = 1024
"""Bytes below which an answer is sent as it is,"""
_LEVEL: Final = 4
"""and how hard it is tried: beyond this time grows faster than size falls."""
_LARGE: Final = 1 << 16
"""Bytes from which it is done in a thread: a megabyte takes 16 ms, for which nobody else would be answered."""
_WORDS: Final = ("json", "text/", "xml")


class Inflater:
    """A gzip stream that is inflated piece by piece, and never by more at once than a piece is long."""

    def __init__(self) -> None:
        self._inflater = zlib.decompressobj(wbits=31)
        self._begun = False
        self._left = b""

    def feed(self, data: bytes, most: int) -> bytes:
        """Up to `most` bytes more; what is left is taken up by the next call. Raises MalformedBody for no gzip."""
        out = bytearray()
        data = self._left + data
        self._begun = self._begun or bool(data)
        try:
            while data and len(out) < most:
                if self._inflater.eof:  # another member follows, as gzip allows
                    self._inflater = zlib.decompressobj(wbits=31)
                out += self._inflater.decompress(data, most - len(out))
                data = self._inflater.unconsumed_tail or self._inflater.unused_data
        except zlib.error as error:
            raise MalformedBody(
                "The body is not gzip, although Content-Encoding says so. Compress it, or leave the header out."
            ) from error
        self._left = data
        return bytes(out)

    def finish(self) -> None:
        """Raise MalformedBody where the stream ended before its end."""
        if self._begun and not self._inflater.eof:
            raise MalformedBody("The body ends in the middle of its gzip stream. Send all of it.")


class InflateRequests:
    """Bodies with Content-Encoding: gzip reach the routes as what they hold, at most `limit` bytes of it.

    Another encoding is 415. Inflating ends at the limit, so a small body that would become a large one does not.
    """

    def __init__(self, app: ASGIApp, limit: int) -> None:
        self._app = app
        self._limit = limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        encoding = Headers(scope=scope).get("content-encoding", "identity") if scope["type"] == "http" else "identity"
        encoding = encoding.strip().lower()
        if encoding == "identity" or is_streamed(scope):
            await self._app(scope, receive, send)
            return
        if encoding not in ("gzip", "x-gzip"):
            error = UnsupportedMediaType(f"Content-Encoding says {encoding[:50]!r}; send gzip, or the body as it is.")
            refusal = domain_problem(error, scope)
            refusal.headers["Accept-Encoding"] = "gzip, identity"
            await refusal(scope, receive, send)
            return
        inflater, received = Inflater(), 0
        headers = [
            (name, value) for name, value in scope["headers"] if name not in (b"content-encoding", b"content-length")
        ]

        async def inflated() -> Message:
            nonlocal received
            message = await receive()
            if message["type"] != "http.request":
                return message
            body = inflater.feed(message.get("body", b""), self._limit - received + 1)
            received += len(body)
            if received > self._limit:
                raise TooLarge(
                    "body_bytes", self._limit, None, "The limit applies to the body when unpacked. Send less at a time."
                )
            if not message.get("more_body", False):
                inflater.finish()
            return {**message, "body": body}

        # Not a copy: what the router notes in the scope, the log and the metrics read there.
        scope["headers"] = headers
        await self._app(scope, inflated, send)


class DeflateAnswers:
    """Answers of text, in one piece and worth it, are packed for callers that accept gzip.

    Their entity tag turns into a weak one: it stands for the content, not for the bytes.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        wanted = accepts_coding(Headers(scope=scope).get("accept-encoding"), "gzip")
        start: Message | None = None

        async def packed(message: Message) -> None:
            nonlocal start
            if message["type"] == "http.response.start":
                start = message
                return
            if start is not None:
                begun, start = start, None
                if message["type"] == "http.response.body" and not message.get("more_body", False):
                    message = await _pack(begun, message, wanted=wanted)
                await send(begun)
            await send(message)

        await self._app(scope, receive, packed)


async def _pack(start: Message, message: Message, *, wanted: bool) -> Message:
    headers, body = MutableHeaders(scope=start), message.get("body", b"")
    if start["status"] == 304:  # says what the whole answer would say
        headers.add_vary_header("Accept-Encoding")
        return message
    content_type = headers.get("content-type", "")
    if len(body) < _LEAST or "content-encoding" in headers or not any(word in content_type for word in _WORDS):
        return message
    headers.add_vary_header("Accept-Encoding")
    if not wanted:
        return message
    pack = partial(compress, body, _LEVEL, mtime=0)
    body = pack() if len(body) < _LARGE else await anyio.to_thread.run_sync(pack)
    headers["Content-Encoding"], headers["Content-Length"] = "gzip", str(len(body))
    etag = headers.get("etag")
    if etag is not None and not etag.startswith("W/"):
        headers["ETag"] = f"W/{etag}"
    return {**message, "body": body}
