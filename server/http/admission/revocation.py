"""Requests in progress whose key is revoked end with a refusal."""

import asyncio
import logging
from typing import Final

import anyio.to_thread

from server.errors import StorageError, Unauthorized
from server.http.admission.request_admission import Admission, AdmissionState
from server.security.authenticator import Authenticator

_LOOK: Final = 1.0
"""Seconds between two checks of the keys of requests in progress."""
_log = logging.getLogger(__name__)


async def watch_keys(shared: AdmissionState, authenticator: Authenticator) -> None:
    """Refuse requests in progress whose key was revoked or has expired. Runs until cancelled."""
    while True:
        await asyncio.sleep(_LOOK)
        by_key: dict[str | None, list[Admission]] = {}
        for request in shared.requests:
            if request.caller is not None and request.refusal is None:
                by_key.setdefault(request.authorization, []).append(request)
        for authorization, requests in by_key.items():
            try:
                await anyio.to_thread.run_sync(authenticator.authenticate, authorization)
            except Unauthorized as error:
                for request in requests:
                    request.refuse(error)
            except StorageError as error:
                _log.debug("keys of requests in progress cannot be looked at: %s", error)
