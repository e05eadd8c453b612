"""The cookie of a session of the console, and the credentials of a request: a header, or that cookie.

A browser sends cookies with requests of any page, so the cookie counts for less than a header. SameSite=Strict keeps it
from pages of other sites. Pages of another port of the same host are of the same site to a browser, so requests that a
browser says are not of this origin are left without it, and a request that may change something needs a header that
only a page of this origin can set.
"""

from typing import Final

from starlette.datastructures import Headers
from starlette.requests import cookie_parser

from server.errors import Unauthorized
from server.security.authenticator import SESSION

CONSOLE_HEADER: Final = "urquhart-console"
"""The header of the console's own requests. A page of another origin cannot set it without being allowed to."""
_READING: Final = frozenset({"GET", "HEAD"})
_OWN: Final = frozenset({"same-origin", "none"})
_PLAIN, _SECURE = "urquhart_session", "__Host-urquhart_session"
# Over TLS, the prefix makes browsers refuse the cookie from anybody but this host.


def credentials_of(headers: Headers, method: str) -> str | None:
    """The header Authorization, or credentials made of the session's cookie; None without either.

    Raises Unauthorized if Authorization was sent more than once.
    """
    given = headers.getlist("authorization")
    if len(given) > 1:
        # A proxy before us may have checked the other one.
        raise Unauthorized("The header Authorization was sent more than once. Send one key.")
    if given:
        return given[0]
    token = token_of(headers)
    if token is None or headers.get("sec-fetch-site", "none") not in _OWN:
        return None
    if method not in _READING and CONSOLE_HEADER not in headers:
        return None
    return f"{SESSION} {token}"


def token_of(headers: Headers) -> str | None:
    """The token in the cookie of the session; None if there is no cookie."""
    cookies = cookie_parser(headers.get("cookie", ""))
    return cookies.get(_SECURE) or cookies.get(_PLAIN)


def set_cookie(token: str, seconds: int, *, secure: bool) -> str:
    """The header Set-Cookie that keeps a token for some time; `seconds` 0 removes it. `secure`: whether over TLS."""
    name = _SECURE if secure else _PLAIN
    return f"{name}={token}; Path=/; Max-Age={seconds}; HttpOnly; SameSite=Strict{'; Secure' if secure else ''}"
