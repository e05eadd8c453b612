"""A repeated request waits for its first attempt and gets the same answer.

The Idempotency-Key of a finished write is found in the database, whichever process carried it out. While the first
attempt is in progress there is nothing to find yet, and a long search would run twice.
"""

import asyncio
from collections.abc import AsyncIterator, Hashable
from contextlib import asynccontextmanager
from typing import Final

from server.errors import StillRunning

_PATIENCE: Final = 20.0
"""Seconds that a repetition waits: less than the 30 s that the Python client waits for an answer."""


class AttemptsInProgress:
    """The requests with an Idempotency-Key that are in progress in this process, on its event loop."""

    def __init__(self, patience: float = _PATIENCE) -> None:
        self._patience = patience
        self._running: dict[Hashable, asyncio.Event] = {}

    @asynccontextmanager
    async def turn(self, name: Hashable) -> AsyncIterator[None]:
        """Wait until no other request of this name is in progress. Raises StillRunning if that takes too long."""
        try:
            async with asyncio.timeout(self._patience):
                while (running := self._running.get(name)) is not None:
                    await running.wait()
        except TimeoutError:
            raise StillRunning(
                "A request with the same Idempotency-Key is still in progress. Send this one again to get its answer.",
                1.0,
            ) from None
        done = self._running[name] = asyncio.Event()
        try:
            yield
        finally:
            del self._running[name]
            done.set()
