"""API keys: made, listed, revoked, and told from forgeries.

A key is `urq_<id>_<secret>`. The secret has 256 random bits, so its SHA-256 is all that needs to be kept: there is
nothing to be guessed that a slower hash would protect.
"""

import hashlib
import hmac
import ipaddress
import re
import secrets
import string
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final

from server.access import ANYBODY, Caller, Scope
from server.errors import Conflict, InvalidField, NotFound, Unauthorized
from server.kinds import kind_of, plain
from server.settings import Settings
from server.store.database import Database
from server.store.jobs import Jobs
from server.store.keys import Keys
from server.store.tables import KeyRow

_ALPHABET: Final = string.ascii_letters + string.digits
_ID, _SECRET = 8, 43
_KEY: Final = re.compile(rf"urq_([A-Za-z0-9]{{{_ID}}})_([A-Za-z0-9]{{{_SECRET}}})")
_PATTERN: Final = re.compile(r"[\w.~*?-]{1,128}")
_FRESH: Final = 1.0
"""Seconds for which what the database said of a key is believed; so long a revoked one may still work."""
_KNOWN: Final = 10_000
"""Keys that are remembered, about."""


@dataclass(frozen=True, slots=True)
class KeyInfo:
    """What may be shown of a key."""

    id: str
    name: str
    scopes: tuple[str, ...]
    patterns: tuple[str, ...]
    created: datetime
    expires: datetime | None
    revoked: datetime | None

    def state(self, now: datetime) -> str:
        """In a word."""
        if self.revoked is not None:
            return "revoked"
        return "expired" if self.expires is not None and self.expires <= now else "usable"


def make(
    database: Database, name: str, scopes: Sequence[Scope], patterns: Sequence[str], expires: datetime | None = None
) -> tuple[str, KeyInfo]:
    """A new key, which is told this once, and what is kept of it.

    Raises:
        InvalidField: no scope, no pattern, or one that no collection's id can match.
        StorageError.
    """
    if not scopes:
        raise InvalidField("a key needs at least one scope: read, write or admin", code="no_scope", parameter="scope")
    if not patterns:
        raise InvalidField("a key needs a pattern of collections, * for all", code="no_pattern", parameter="pattern")
    for pattern in patterns:
        if not _PATTERN.fullmatch(pattern):
            raise InvalidField(
                f"{pattern!r} is no pattern of collection ids: letters, digits, '.', '_', '~', '-', "
                "with * for any characters and ? for one",
                code="pattern",
                parameter="pattern",
            )
    key_id, secret = _random(_ID), _random(_SECRET)
    with database.write() as session:
        row = Keys(session).add(
            key_id=key_id,
            name=name,
            digest=_digest(secret),
            scopes=sorted({scope.value for scope in scopes}),
            patterns=list(dict.fromkeys(patterns)),
            expires=expires,
        )
        return f"urq_{key_id}_{secret}", _info(row)


def listed(database: Database) -> list[KeyInfo]:
    """All keys, oldest first, the revoked and expired ones, too."""
    with database.read() as session:
        return [_info(row) for row in Keys(session).all()]


def revoke(database: Database, key_id: str) -> None:
    """Make a key useless, for every process within a second, and end its jobs.

    Raises NotFound and Conflict (it is already).
    """
    with database.write() as session:
        keys = Keys(session)
        row = keys.get(key_id)
        if row is None:
            raise NotFound("key", key_id)
        if row.revoked is not None:
            raise Conflict(f"The key {key_id} was revoked on {row.revoked:%Y-%m-%d}.")
        keys.revoke(key_id)
        problem = plain(kind_of(Unauthorized("")), f"The key {key_id}, which began the job, was revoked.")
        Jobs(session).end_those_of(key_id, problem)


def is_exposed(settings: Settings) -> bool:
    """Whether other machines may reach the address, and nobody said that this is all right."""
    return not settings.insecure and not _is_loopback(settings.host)


def check_exposure(settings: Settings, database: Database) -> None:
    """Raise Conflict where other machines may reach the service and it has no key to ask them for."""
    if not is_exposed(settings):
        return
    with database.read() as session:
        if Keys(session).any_usable(datetime.now(UTC)):
            return
    raise Conflict(
        f"host {settings.host!r} can be reached from other machines and there is no key to ask them for: make one with "
        "urquhart keys create, listen on 127.0.0.1, or say --insecure (URQUHART_INSECURE=true) if the network is "
        "trusted"
    )


class Doorkeeper:
    """Tells who asks. Keys are asked for as soon as there is one, or where the service is exposed."""

    def __init__(self, settings: Settings, database: Database) -> None:
        self._database = database
        self._always = is_exposed(settings)
        self._guard = threading.Lock()
        self._locked: tuple[float, bool] | None = None
        self._known: dict[str, tuple[float, KeyRow | None]] = {}

    def asks_for_keys(self) -> bool:
        """Whether callers need a key. Raises StorageError."""
        return self._is_locked(ask=True) is True

    def recall(self, authorization: str | None) -> Caller | None:
        """Who asks, from what is remembered; None where the database has to be asked. Raises Unauthorized."""
        return self._tell(authorization, ask=False)

    def ask(self, authorization: str | None) -> Caller:
        """Who asks. Raises Unauthorized and StorageError."""
        caller = self._tell(authorization, ask=True)
        if caller is None:
            raise AssertionError("the database was asked")
        return caller

    def _tell(self, authorization: str | None, *, ask: bool) -> Caller | None:
        locked = self._is_locked(ask=ask)
        if locked is None:
            return None
        if not locked:
            return ANYBODY
        if authorization is None:
            raise Unauthorized("This service asks for a key: send Authorization: Bearer urq_...", given=False)
        kind, _, token = authorization.partition(" ")
        match = _KEY.fullmatch(token.strip()) if kind.lower() == "bearer" else None
        if match is None:
            raise Unauthorized("Authorization must be: Bearer urq_<id>_<secret>, as urquhart keys create printed it.")
        found = self._row(match[1], ask=ask)
        if found is None:
            return None
        (row,) = found
        # Compared in any case, so that the time does not tell whether there is such a key.
        same = hmac.compare_digest(_digest(match[2]), row.digest if row is not None else bytes(32))
        if row is None or not same:
            raise Unauthorized("There is no such key; was it copied whole?")
        state = _info(row).state(datetime.now(UTC))
        if state != "usable":
            raise Unauthorized(f"The key {row.id} is {state}; ask the operator for another.")
        return Caller(row.id, frozenset(map(Scope, row.scopes)), tuple(row.patterns))

    def _is_locked(self, *, ask: bool) -> bool | None:
        if self._always:
            return True
        now = time.monotonic()
        if self._locked is not None and now - self._locked[0] < _FRESH:
            return self._locked[1]
        if not ask:
            return None
        with self._database.read() as session:
            locked = Keys(session).any()
        self._locked = (now, locked)
        return locked

    def _row(self, key_id: str, *, ask: bool) -> tuple[KeyRow | None] | None:
        now = time.monotonic()
        with self._guard:
            known = self._known.get(key_id)
        if known is not None and now - known[0] < _FRESH:
            return (known[1],)
        if not ask:
            return None
        with self._database.read() as session:
            row = Keys(session).get(key_id)
        with self._guard:
            if len(self._known) >= _KNOWN:
                self._known.clear()
            self._known[key_id] = (now, row)
        return (row,)


def _info(row: KeyRow) -> KeyInfo:
    return KeyInfo(row.id, row.name, tuple(row.scopes), tuple(row.patterns), row.created, row.expires, row.revoked)


def _random(length: int) -> str:
    return "".join(secrets.choice(_ALPHABET) for _ in range(length))


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.encode()).digest()


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False  # a name may resolve to anything
