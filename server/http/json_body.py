"""JSON bodies: a route class that reads them strictly, and error messages for bodies that are not JSON."""

from collections.abc import Callable, Coroutine
from typing import Any, Final

import anyio.to_thread
import orjson
from fastapi import Request, Response

from server.errors import DomainError, InvalidField, MalformedBody, TooLarge, UnsupportedMediaType
from server.http.authorization import GuardedRoute
from server.http.direct_call import DirectCall
from server.parsing.strict_json import read_json

_LONG: Final = 1 << 14
"""Bytes of a body that take longer to read and check, about half a millisecond, than a thread takes to start."""

_Check = Callable[..., tuple[Any, Any]]
"""Validates JSON as a model, or raises what is wrong with it."""


class _JsonRequest(Request):
    """A request whose body is strict JSON. `prepare` reads and checks a long body in a thread."""

    async def json(self) -> Any:
        if not hasattr(self, "_json"):
            self._json = self._read(await self.body())
        return self._json

    async def prepare(self, body: bytes, check: _Check) -> None:
        """Read the body and check it against the route's model, without blocking other requests."""
        self._json = await anyio.to_thread.run_sync(self._validated, body, check)

    def _validated(self, body: bytes, check: _Check) -> Any:
        """The body as the route's model, which the framework accepts as it is. An invalid body is returned unchanged,
        and the framework refuses it.
        """
        content = self._read(body)
        model, errors = check(content, {}, loc=("body",))
        return content if errors else model

    def _read(self, body: bytes) -> Any:
        try:
            return read_json(body, self.app.state.service.settings.limits.body_values)
        except orjson.JSONDecodeError as error:
            raise _Refused(MalformedBody(malformed_detail(error, body))) from error
        except (InvalidField, TooLarge) as error:
            raise _Refused(error) from error


class _Refused(Exception):
    """Carries an error through the framework, which would replace other errors of the body by its own."""

    def __init__(self, error: DomainError) -> None:
        super().__init__(str(error))
        self.error = error


class JsonRoute(GuardedRoute):
    """A guarded route with a strict JSON body. Another content type is answered with 415, invalid JSON with 400."""

    def make_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Wrap the framework's handler."""
        handle, direct = super().make_handler(), DirectCall.of(self)
        field = self.body_field
        if field is None:
            return handle

        async def handle_json(plain: Request) -> Response:
            request = _JsonRequest(plain.scope, plain.receive)
            body = await request.body()  # Read here, because the framework would hide errors of the body limit.
            if body:
                check_content_type(request.headers.get("content-type"))
            try:
                if len(body) > _LONG:
                    await request.prepare(body, field.validate)
                answer = await direct(request, await request.json()) if body and direct is not None else None
                return answer or await handle(request)
            except _Refused as refused:
                raise refused.error from refused
            except Exception as error:
                if isinstance(error.__cause__, _Refused):
                    raise error.__cause__.error from error.__cause__
                raise

        return handle_json


def check_content_type(content_type: str | None) -> None:
    """Raise UnsupportedMediaType unless the body is sent as JSON in UTF-8."""
    name, *parameters = (part.strip().lower() for part in (content_type or "").split(";"))
    if name != "application/json":
        shown = "nothing" if not name else name[:100]
        raise UnsupportedMediaType(f"Content-Type is {shown}. Send JSON with Content-Type: application/json.")
    for parameter in parameters:
        if parameter.startswith("charset=") and parameter[8:].strip('"') not in {"utf-8", "utf8"}:
            raise UnsupportedMediaType("JSON must be in UTF-8. Leave out the charset.")


def malformed_detail(error: orjson.JSONDecodeError, body: bytes) -> str:
    """Why a body is not JSON, in one sentence."""
    where = f"line {error.lineno}, column {error.colno}"
    around = body[max(error.pos - 1, 0) : error.pos + 9].lstrip(b"-").lower()
    if around.startswith((b"nan", b"inf")) or b"nan" in around or b"infinity" in around:
        return f"JSON has no NaN or Infinity ({where}); leave out the member, or the landmark, that has no value."
    return f"The body is not JSON: {error.msg.split(': line')[0]} ({where})."
