"""Sessions of the console: begun with a key, looked at, and ended."""

import time
from datetime import UTC, datetime
from typing import Annotated, Any, Final

from fastapi import APIRouter, Body, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from server.errors import Forbidden, Unauthorized
from server.http.authorization import authenticate
from server.http.json_body import JsonRoute
from server.http.responses import json_response
from server.http.session_cookie import CONSOLE_HEADER, set_cookie, token_of
from server.platform.version import service_version
from server.security.authenticator import Authenticator
from server.security.console_sessions import TOKEN

router = APIRouter(route_class=JsonRoute, include_in_schema=False)
PATH: Final = "/ui/session"


class SessionInput(BaseModel):
    """What a session is begun with."""

    model_config = ConfigDict(extra="forbid")

    key: str = Field(description="An API key.", max_length=200)


@router.get(PATH)
async def get_session(request: Request) -> Response:
    """Whether the service needs a key, and what this caller may do."""
    return json_response(await _session(request), headers={"Cache-Control": "no-store"})


@router.post(PATH)
def begin_session(request: Request, body: Annotated[SessionInput, Body()]) -> Response:
    """Check a key, and set the cookie that stands for it."""
    _require_console(request)
    authenticator: Authenticator = request.app.state.authenticator
    token, ends = authenticator.begin_session(body.key.strip())
    cookie = set_cookie(token, ends - int(time.time()), secure=request.url.scheme == "https")
    return Response(status_code=204, headers={"Set-Cookie": cookie, "Cache-Control": "no-store"})


@router.delete(PATH)
def end_session(request: Request) -> Response:
    """Remove the cookie."""
    _require_console(request)
    cookie = set_cookie("", 0, secure=request.url.scheme == "https")
    return Response(status_code=204, headers={"Set-Cookie": cookie, "Cache-Control": "no-store"})


def _require_console(request: Request) -> None:
    """Refuse pages of other origins, which could sign somebody in with a key of theirs."""
    if CONSOLE_HEADER not in request.headers:
        raise Forbidden("Sessions are begun and ended by the console, which sends the header Urquhart-Console.")


async def _session(request: Request) -> dict[str, Any]:
    token = token_of(request.headers)
    try:
        caller = await authenticate(request)
    except Unauthorized as error:
        refusal = None if token is None else str(error)
        return {"version": service_version(), "needs_key": True, "signed_in": False, "refusal": refusal}
    said = TOKEN.fullmatch(token or "") if caller.id else None
    return {
        "version": service_version(),
        "needs_key": bool(caller.id),
        "signed_in": True,
        "key": caller.id or None,
        "scopes": sorted(caller.scopes),
        "patterns": list(caller.patterns),
        "ends": None if said is None else datetime.fromtimestamp(int(said[2]), UTC).isoformat(),
    }
