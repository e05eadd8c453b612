"""gzip for requests and answers: it reduces a list of landmarks in JSON to a third, and robots' links are slow."""

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
"""Bytes below which an answer is not compressed."""
_LEVEL: Final = 4
"""Compression level. Beyond it, time grows faster than size shrinks."""
_LARGE: Final = 1 << 16
"""Bytes from which compression runs in a thread. A megabyte takes 16 ms, during which nobody else would be answered."""
_WORDS: Final = ("json", "text/", "xml")


class Inflater:
    """A gzip stream that is decompressed piece by piece, never more at once than one piece."""

    def __init__(self) -> None:
        self._inflater = zlib.decompressobj(wbits=31)
        self._begun = False
        self._left = b""

    def feed(self, data: bytes, most: int) -> bytes:
        """Decompress at most `most` bytes. The rest is left for the next call. Raises MalformedBody if it is not
        gzip.
        """
        out = bytearray()
        data = self._left + data
        self._begun = self._begun or bool(data)
        try:
            while data and len(out) < most:
                if self._inflater.eof:  # gzip allows several members, one after the other
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
        """Raise MalformedBody if the stream is not complete."""
        if self._begun and not self._inflater.eof:
            raise MalformedBody("The body ends in the middle of its gzip stream. Send all of it.")


class InflateRequests:
    """Decompresses bodies with Content-Encoding: gzip, up to `limit` bytes.

    Another encoding is answered with 415. Decompression stops at the limit, so a small body cannot become a huge one.
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

        # Not a copy, because log and metrics read what the router writes into the scope.
        scope["headers"] = headers
        await self._app(scope, inflated, send)


class DeflateAnswers:
    """Compresses text answers that are complete and large enough, for callers that accept gzip.

    Their entity tag becomes a weak one, because it stands for the content and not for the bytes.
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
    if start["status"] == 304:  # the same as the complete answer would have
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
