"""Sessions of the console: a token that stands for an API key for some hours, so that a browser need not keep the key.

A token is `<key id>.<end>.<seal>`. The seal is an HMAC over the rest and over the key's stored hash, with a secret that
lies in a file beside the database. So every process of a service accepts the sessions of the others, sessions outlast a
restart, a revoked key ends its sessions, and a copy of the database alone opens none.
"""

import hashlib
import hmac
import os
import re
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.errors import Unauthorized
from server.platform.disk_errors import disk_errors

HOURS: Final = 12.0
"""Hours after which the key must be entered again: a working day."""
TOKEN: Final = re.compile(r"([A-Za-z0-9]{8})\.([0-9]{10})\.([0-9a-f]{64})")
_BYTES: Final = 32


@dataclass(frozen=True, slots=True)
class SessionClaim:
    """What a token says before anybody has checked its seal."""

    key_id: str
    ends: int
    seal: str


class ConsoleSessions:
    """Issues and checks the tokens of sessions. Thread-safe."""

    def __init__(self, database: Path, clock: Callable[[], float] = time.time) -> None:
        """`database`: the file beside which the secret lies. `clock`: seconds since 1970."""
        self._path = database.with_name(f"{database.name}.session-secret")
        self._clock = clock
        self._secret: bytes | None = None

    def issue(self, key_id: str, digest: bytes, hours: float = HOURS) -> tuple[str, int]:
        """A token for a key, whose stored hash is `digest`, and the time when it ends, in seconds since 1970.

        Raises StorageError if the secret does not exist and cannot be written.
        """
        ends = int(self._clock() + 3600.0 * hours)
        return f"{key_id}.{ends}.{_seal(self._existing() or self._create(), key_id, ends, digest)}", ends

    def read(self, token: str) -> SessionClaim:
        """What a token says. Raises Unauthorized if it is none, or has ended."""
        match = TOKEN.fullmatch(token)
        if match is None:
            raise Unauthorized("This is not a session of this service. Enter the key again.")
        claim = SessionClaim(match[1], int(match[2]), match[3])
        if claim.ends <= self._clock():
            raise Unauthorized(f"The session has ended: it lasts {HOURS:g} hours. Enter the key again.")
        return claim

    def is_sealed(self, claim: SessionClaim, digest: bytes) -> bool:
        """Whether this service issued the token, for a key whose stored hash is `digest`."""
        secret = self._existing()
        expected = _seal(secret or bytes(_BYTES), claim.key_id, claim.ends, digest)
        return hmac.compare_digest(expected, claim.seal) and secret is not None

    def _existing(self) -> bytes | None:
        if self._secret is None:
            with disk_errors(self._path):
                try:
                    read = self._path.read_bytes()
                except FileNotFoundError:
                    return None
            self._secret = read if len(read) == _BYTES else None
        return self._secret

    def _create(self) -> bytes:
        """The secret, whichever process was the first to write one."""
        draft = self._path.with_name(f"{self._path.name}.{os.getpid()}-{secrets.token_hex(8)}")
        with disk_errors(self._path):
            try:
                handle = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
                with os.fdopen(handle, "wb") as file:
                    file.write(secrets.token_bytes(_BYTES))
                try:
                    os.link(draft, self._path)  # unlike a rename, it replaces nothing
                except FileExistsError:
                    if self._path.stat().st_size != _BYTES:
                        draft.replace(self._path)
            finally:
                draft.unlink(missing_ok=True)
        created = self._existing()
        if created is None:
            raise AssertionError("the secret was just written")
        return created


def _seal(secret: bytes, key_id: str, ends: int, digest: bytes) -> str:
    return hmac.new(secret, f"{key_id}.{ends}.".encode() + digest, hashlib.sha256).hexdigest()
