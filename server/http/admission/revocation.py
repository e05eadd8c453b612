"""Requests whose key is revoked while they are worked on: their work ends, and they are told so."""

import asyncio
import logging
from typing import Final

import anyio.to_thread

from server.errors import StorageError, Unauthorized
from server.http.admission.admission import Admission, Shared
from server.security.authenticator import Doorkeeper

_LOOK: Final = 1.0
"""Seconds between two looks at the keys of the requests at hand."""
_log = logging.getLogger(__name__)


async def watch_keys(shared: Shared, keeper: Doorkeeper) -> None:
    """Refuse requests at hand whose key cannot be used any more, soon after it was revoked, until cancelled."""
    while True:
        await asyncio.sleep(_LOOK)
        by_key: dict[str | None, list[Admission]] = {}
        for request in shared.requests:
            if request.caller is not None and request.refusal is None:
                by_key.setdefault(request.authorization, []).append(request)
        for authorization, requests in by_key.items():
            try:
                await anyio.to_thread.run_sync(keeper.ask, authorization)
            except Unauthorized as error:
                for request in requests:
                    request.refuse(error)
            except StorageError as error:
                _log.debug("keys of requests at hand cannot be looked at: %s", error)
