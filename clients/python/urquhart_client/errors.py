"""The exceptions of the client."""

from collections.abc import Mapping, Sequence
from typing import Any


class UrquhartError(Exception):
    """Base of all exceptions of this package."""


class ConnectionFailed(UrquhartError):
    """The service could not be reached, or the connection broke, so it is unknown whether a write took place."""


class UnexpectedAnswer(UrquhartError):
    """The answer is not from this service: a proxy's page, another program on the port, or a broken document.

    `status` is the HTTP status, `body` the first characters of the answer.
    """

    def __init__(self, message: str, status: int, body: str) -> None:
        super().__init__(message)
        self.status = status
        self.body = body


class ProblemError(UrquhartError):
    """The service refused the request, and says why (RFC 9457).

    Attributes:
        status: HTTP status.
        type: URI of the kind of problem.
        title: the kind of problem, in words.
        detail: what is wrong with this request and what to do, in a sentence.
        errors: one entry for each offending place, with a JSON `pointer` (or `parameter`) and a `detail`.
        instance: URI of this occurrence, when the service gave one.
        members: the whole problem document, with whatever else it carries.
        retry_after: seconds after which another try makes sense, when the service said so.
    """

    def __init__(self, status: int, document: Mapping[str, Any], retry_after: float | None = None) -> None:
        self.status = status
        self.type = str(document.get("type", "about:blank"))
        self.title = str(document.get("title", ""))
        self.detail = str(document.get("detail", ""))
        given = document.get("errors")
        self.errors: Sequence[Mapping[str, Any]] = tuple(given) if isinstance(given, list) else ()
        instance = document.get("instance")
        self.instance = None if instance is None else str(instance)
        self.members = dict(document)
        self.retry_after = retry_after
        super().__init__(self._sentence())

    def _sentence(self) -> str:
        text = f"{self.status} {self.title}".rstrip()
        if self.detail:
            text += f": {self.detail}"
        places = [
            f"{e.get('pointer') or e.get('parameter') or ''} {e.get('detail', '')}".strip()
            for e in self.errors[:3]
            if not e.get("detail") or str(e["detail"]) not in self.detail
        ]
        return text + (f" ({'; '.join(places)})" if any(places) else "")
