"""Finds the principal of a request by its API key, with a cache of one second, and decides whether keys are needed."""

import hmac
import ipaddress
import threading
import time
from datetime import UTC, datetime
from typing import Final

from server.config.settings import Settings
from server.errors import Conflict, Unauthorized
from server.security.api_keys import KEY_FORMAT, digest_of
from server.security.console_sessions import ConsoleSessions
from server.security.principal import UNRESTRICTED, Principal, Scope
from server.store.service_records import ApiKeyRecord
from server.store.storage import Storage

_FRESH: Final = 1.0
"""Seconds for which a key is cached, and so for which a revoked key may still work."""
SESSION: Final = "\nsession"
"""Scheme of the credentials that are made of the cookie of a session. No header can hold it."""
_KNOWN: Final = 10_000
"""Approximate number of keys in the cache."""


def is_exposed(settings: Settings) -> bool:
    """Whether other machines can reach the address, and `insecure` is not set."""
    return not settings.insecure and not _is_loopback(settings.host)


def check_exposure(settings: Settings, database: Storage) -> None:
    """Raise Conflict if other machines can reach the service and there is no key."""
    if not is_exposed(settings):
        return
    with database.read() as tx:
        if tx.api_keys.any_usable(datetime.now(UTC)):
            return
    raise Conflict(
        f"host {settings.host!r} can be reached from other machines, and there is no API key. Create one with urquhart "
        "keys create, listen on 127.0.0.1, or use --insecure (URQUHART_INSECURE=true) if you trust the network"
    )


class Authenticator:
    """Finds the principal behind an API key. Keys are required as soon as one exists, or if the service is exposed."""

    def __init__(self, settings: Settings, database: Storage) -> None:
        self._database = database
        self._always = is_exposed(settings)
        self._sessions = ConsoleSessions(settings.database_path)
        self._guard = threading.Lock()
        self._asks_for_keys: tuple[float, bool] | None = None
        self._known: dict[str, tuple[float, ApiKeyRecord | None]] = {}

    def asks_for_keys(self) -> bool:
        """Whether callers need a key. Raises StorageError."""
        return self._keys_exist(ask=True) is True

    def from_cache(self, authorization: str | None) -> Principal | None:
        """The principal, if it is in the cache; None if the database must be read. Raises Unauthorized."""
        return self._principal_of(authorization, ask=False)

    def authenticate(self, authorization: str | None) -> Principal:
        """The principal. Raises Unauthorized and StorageError."""
        caller = self._principal_of(authorization, ask=True)
        if caller is None:
            raise AssertionError("the database was asked")
        return caller

    def _principal_of(self, authorization: str | None, *, ask: bool) -> Principal | None:
        required = self._keys_exist(ask=ask)
        if required is None:
            return None
        if not required:
            return UNRESTRICTED
        if authorization is None:
            raise Unauthorized("This service needs an API key. Send Authorization: Bearer urq_...", given=False)
        kind, _, token = authorization.partition(" ")
        if kind == SESSION:
            return self._principal_of_session(token, ask=ask)
        match = KEY_FORMAT.fullmatch(token.strip()) if kind.lower() == "bearer" else None
        if match is None:
            raise Unauthorized("Authorization must be: Bearer urq_<id>_<secret>, as urquhart keys create printed it.")
        found = self._row(match[1], ask=ask)
        if found is None:
            return None
        (row,) = found
        # Always compared, so that the duration does not reveal whether the key exists.
        same = hmac.compare_digest(digest_of(match[2]), row.digest if row is not None else bytes(32))
        if row is None or not same:
            raise Unauthorized("There is no such key. Check that you copied all of it.")
        return _usable(row)

    def _principal_of_session(self, token: str, *, ask: bool) -> Principal | None:
        claim = self._sessions.read(token)
        found = self._row(claim.key_id, ask=ask)
        if found is None:
            return None
        (row,) = found
        sealed = self._sessions.is_sealed(claim, row.digest if row is not None else bytes(32))
        if row is None or not sealed:
            raise Unauthorized("This is not a session of this service. Enter the key again.")
        return _usable(row)

    def begin_session(self, key: str) -> tuple[str, int]:
        """A session for a key: its token, and when it ends, in seconds since 1970.

        Raises Unauthorized and StorageError.
        """
        caller = self.authenticate(f"Bearer {key}")
        found = self._row(caller.id, ask=True) if caller.id else None
        if found is None or found[0] is None:
            raise Unauthorized("This service needs no key, so there is no session to begin.")
        return self._sessions.issue(caller.id, found[0].digest)

    def _keys_exist(self, *, ask: bool) -> bool | None:
        if self._always:
            return True
        now = time.monotonic()
        if self._asks_for_keys is not None and now - self._asks_for_keys[0] < _FRESH:
            return self._asks_for_keys[1]
        if not ask:
            return None
        with self._database.read() as tx:
            required = tx.api_keys.any()
        self._asks_for_keys = (now, required)
        return required

    def _row(self, key_id: str, *, ask: bool) -> tuple[ApiKeyRecord | None] | None:
        now = time.monotonic()
        with self._guard:
            known = self._known.get(key_id)
        if known is not None and now - known[0] < _FRESH:
            return (known[1],)
        if not ask:
            return None
        with self._database.read() as tx:
            row = tx.api_keys.get(key_id)
        with self._guard:
            if len(self._known) >= _KNOWN:
                self._known.clear()
            self._known[key_id] = (now, row)
        return (row,)


def _usable(row: ApiKeyRecord) -> Principal:
    state = row.state(datetime.now(UTC))
    if state != "usable":
        raise Unauthorized(f"The key {row.id} is {state}. Ask the operator for another.")
    return Principal(row.id, frozenset(map(Scope, row.scopes)), row.patterns)


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False  # a name may resolve to any address
