"""A request that is sent again while its first attempt is at work waits for it, and is answered as it was.

What a write did is found by its Idempotency-Key in the database, whichever process did it. Until it is done there is
nothing to find, and a search that takes long would be done twice at once.
"""

import asyncio
from collections.abc import AsyncIterator, Hashable
from contextlib import asynccontextmanager
from typing import Final

from server.errors import StillRunning

_PATIENCE: Final = 20.0
"""Seconds for which a repetition waits: less than the 30 s that the Python client waits for an answer."""


class RepeatedRequests:
    """The requests with an Idempotency-Key that are at work in this process, on its event loop."""

    def __init__(self, patience: float = _PATIENCE) -> None:
        self._patience = patience
        self._running: dict[Hashable, asyncio.Event] = {}

    @asynccontextmanager
    async def turn(self, name: Hashable) -> AsyncIterator[None]:
        """Be the only one of that name at work. Raises StillRunning when the one before takes too long."""
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
