"""Protection against web pages that use the service through the browser of somebody who can reach it.

A page of another site can send requests to a service on the reader's own machine. A page whose name is made to resolve
to that machine (DNS rebinding) can read the answers, too. A key stops both, because the page does not have it. Without
keys, the names in Host and Origin are checked.
"""

import hashlib
import ipaddress
import re
from base64 import b64encode
from collections.abc import Iterable, Sequence
from typing import Final
from urllib.parse import SplitResult, urlsplit

import anyio.to_thread
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.errors import StorageError, UnknownHost
from server.http.problems import domain_problem
from server.security.authenticator import Authenticator

ANY: Final = "*"
_SCRIPT: Final = re.compile(r"<script>(.*?)</script>", re.DOTALL)
_LOOPBACK: Final = frozenset({"localhost", "127.0.0.1", "::1"})
_PORTS: Final = {"http": 80, "https": 443}
NOTHING: Final = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
"""Content security policy of an answer that is not a page: nothing in it runs, loads, or is framed."""
DRAWING: Final = f"{NOTHING}; style-src 'unsafe-inline'; sandbox"
"""Content security policy of an SVG drawing: its own styles apply, and scripts in it do not run."""


CONSOLE: Final = (
    "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; object-src 'none'; "
    "img-src 'self' blob:"
)
"""Content security policy of the console: files of this service only, none of them inline. Pictures that it exports
are blobs."""


def page_policy(html: str) -> str:
    """Content security policy of our HTML pages: their own inline styles and scripts, and files of this service."""
    scripts = " ".join(f"'{_hash(text)}'" for text in _SCRIPT.findall(html))
    # Swagger UI sets styles on elements, and its pictures are data: URLs. Hashes cannot allow either.
    return (
        f"default-src 'none'; script-src 'self' {scripts}; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
        "connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        if scripts
        else f"{NOTHING}; style-src 'unsafe-inline'"
    )


def _hash(text: str) -> str:
    return f"sha256-{b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def safe_headers(media_type: str) -> dict[str, str]:
    """The security headers of an answer that is not a page: a browser must not guess its type, run it or frame it."""
    return {
        "Content-Security-Policy": DRAWING if media_type.startswith("image/svg") else NOTHING,
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
        "Referrer-Policy": "no-referrer",
    }


_SAFE, _SAFE_DRAWING = (
    [(name.lower().encode(), value.encode()) for name, value in safe_headers(media_type).items()]
    for media_type in ("application/json", "image/svg+xml")
)


class SafeAnswers:
    """Adds security headers to every answer: the browser must not guess its type, frame it, or run scripts in it.

    A route that answers with a page sets a policy of its own.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""

        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = _with_safe(message.get("headers", ()))
            await send(message)

        await self._app(scope, receive, marked)


def _with_safe(headers: Iterable[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    """Headers of an answer with the security headers that are not among them."""
    there = {name.lower(): value for name, value in headers}
    is_drawing = there.get(b"content-type", b"").startswith(b"image/svg")
    return [*headers, *(one for one in (_SAFE_DRAWING if is_drawing else _SAFE) if one[0] not in there)]


class KnownHosts:
    """Refuses requests under foreign host names, and requests that pages of other origins send.

    `allowed` are additional host names. If there are any, every request is checked against them. Otherwise only a
    service without keys checks: it accepts localhost, the address that the connection came to and, if it listens on all
    addresses (`everywhere`), any IP address, because no foreign page can have one as its name.
    """

    def __init__(self, app: ASGIApp, allowed: Sequence[str], authenticator: Authenticator, *, everywhere: bool) -> None:
        self._app, self._keeper, self._everywhere = app, authenticator, everywhere
        self._allowed = frozenset(name.lower() for name in allowed)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] == "http" and ANY not in self._allowed:
            refusal = self._refusal(scope)
            if refusal is not None:
                try:
                    checked = bool(self._allowed) or not await anyio.to_thread.run_sync(self._keeper.asks_for_keys)
                except StorageError as error:
                    await domain_problem(error, scope)(scope, receive, send)
                    return
                if checked:
                    await domain_problem(refusal, scope)(scope, receive, send)
                    return
        await self._app(scope, receive, send)

    def _refusal(self, scope: Scope) -> UnknownHost | None:
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        for host in hosts:
            if not self._knows(host, scope):
                return UnknownHost("Host", host[:100])
        for origin in headers.getlist("origin"):
            if not self._is_ours(origin, hosts):
                return UnknownHost("Origin", origin[:100])
        return None

    def _knows(self, host: str, scope: Scope) -> bool:
        split = _split(f"//{host}")
        name = split.hostname.rstrip(".") if split is not None and split.hostname else ""
        bound = (scope.get("server") or ("",))[0]
        if name in _LOOPBACK or name in self._allowed or (name and name == bound):
            return True
        return self._everywhere and not self._allowed and _is_address(name)

    def _is_ours(self, origin: str, hosts: Sequence[str]) -> bool:
        """Whether a page at `origin` is from this service, under the name in the request or an allowed one."""
        split = _split(origin)
        if split is None or not split.hostname or split.scheme not in _PORTS:
            return False
        if split.hostname in self._allowed:
            return True
        own = [found for host in hosts if (found := _split(f"{split.scheme}://{host}")) is not None]
        return any(_place(split) == _place(one) for one in own)


def _split(url: str) -> SplitResult | None:
    """The parts of a URL, None if its port cannot be read."""
    try:
        split = urlsplit(url)
        _ = split.port
    except ValueError:
        return None
    return None if split.path or split.query or split.fragment or "@" in split.netloc else split


def _place(split: SplitResult) -> tuple[str | None, int]:
    return split.hostname, split.port or _PORTS[split.scheme]


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
