"""Middleware that limits how many requests are in progress and how long a request may take to arrive."""

from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Receive, Scope, Send

from server.errors import Overloaded, TooSlow, forget_frames
from server.http.admission.request_admission import Admission, AdmissionState
from server.http.problems import domain_problem
from urquhart import Abandoned


class AdmissionMiddleware:
    """Limits the load to what the service can handle.

    A request takes a place when all of it has arrived, and returns it when its answer begins. So slow callers occupy a
    connection and memory, but not a place. A body that does not arrive in time is answered with 408, and its connection
    is closed. Work for a caller that has gone ends. While the service stops, every answer asks the caller to close the
    connection.
    """

    def __init__(self, app: ASGIApp, shared: AdmissionState) -> None:
        self._app, self._shared = app, shared

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI. Raises ClientDisconnect if the caller has gone."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Admission(self._shared, scope, receive, send)
        scope.setdefault("state", {})["admission"] = request
        try:
            await self._app(scope, request.receive, request.send)
        except Abandoned as error:
            forget_frames(error)
            if request.refusal is None or request.answered:
                raise ClientDisconnect from None
            await domain_problem(request.refusal, scope)(scope, receive, request.send)
        except (Overloaded, TooSlow) as error:
            if request.answered:
                raise
            await domain_problem(error, scope)(scope, receive, request.send)
        finally:
            request.end()
