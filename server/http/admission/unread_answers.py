"""A bound on the memory of answers that callers do not read."""

from collections.abc import Callable
from typing import Protocol


class AnsweredRequest(Protocol):
    """A request whose answer is being sent. `stalled`: when it last took a piece of the answer, in monotonic time."""

    stalled: float

    def abort(self) -> None:
        """Cut the caller off."""


class UnreadAnswers:
    """Answers that are kept until their callers have read them. Callers that read nothing for longest are cut off."""

    def __init__(self, most: int, count: Callable[[], None]) -> None:
        self._most, self._count = most, count
        self._sizes: dict[AnsweredRequest, int] = {}

    @property
    def held(self) -> int:
        """Bytes of the answers that are kept."""
        return sum(self._sizes.values())

    def hold(self, request: AnsweredRequest, size: int) -> None:
        """Keep an answer of `size` bytes, and cut off other callers if there is no room for it."""
        held = self.held + size
        for other in sorted(self._sizes, key=lambda one: one.stalled):
            if held <= self._most:
                break
            held -= self._sizes.pop(other)
            self._count()
            other.abort()
        self._sizes[request] = size

    def release(self, request: AnsweredRequest) -> None:
        """The answer was sent or dropped."""
        self._sizes.pop(request, None)
