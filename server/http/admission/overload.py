"""How much is taken on at once, and how long a request may take to arrive."""

from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Receive, Scope, Send

from server.errors import Overloaded, TooSlow
from server.http.admission.admission import Admission, AdmissionState
from server.http.problems import domain_problem, forget_frames
from urquhart import Abandoned


class AdmissionMiddleware:
    """Holds requests to what the service can do.

    A request takes a place once it is there as a whole, and gives it back when its answer begins: slow callers take up
    a connection and what they have sent, but nobody's turn. A body that does not arrive in time is 408, and its
    connection is closed. The work for a caller that is gone ends. While the service stops, every answer asks the caller
    to close the connection.
    """

    def __init__(self, app: ASGIApp, shared: AdmissionState) -> None:
        self._app, self._shared = app, shared

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI. Raises ClientDisconnect where the caller went away."""
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
