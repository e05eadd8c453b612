"""API keys: created, listed, revoked.

A key is `urq_<id>_<secret>`. The secret has 256 random bits, so storing its SHA-256 is enough: there is nothing to
guess that a slower hash would protect.
"""

import hashlib
import re
import secrets
import string
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Final

from server.errors import Conflict, InvalidField, NotFound, Unauthorized
from server.problem_types import plain, problem_type_of
from server.security.principal import Scope
from server.store.service_records import ApiKeyRecord
from server.store.storage import Storage

_ALPHABET: Final = string.ascii_letters + string.digits
_ID, _SECRET = 8, 43
KEY_FORMAT: Final = re.compile(rf"urq_([A-Za-z0-9]{{{_ID}}})_([A-Za-z0-9]{{{_SECRET}}})")
_PATTERN: Final = re.compile(r"[\w.~*?-]{1,128}")


def make(
    database: Storage, name: str, scopes: Sequence[Scope], patterns: Sequence[str], expires: datetime | None = None
) -> tuple[str, ApiKeyRecord]:
    """Create a key. Returns the key, which is shown only now, and what is stored of it.

    Raises:
        InvalidField: no scope, no pattern, or one that no collection's id can match.
        StorageError.
    """
    if not scopes:
        raise InvalidField("a key needs at least one scope: read, write or admin", code="no_scope", parameter="scope")
    if not patterns:
        raise InvalidField(
            "a key needs a pattern of collection ids; use * for all", code="no_pattern", parameter="pattern"
        )
    for pattern in patterns:
        if not _PATTERN.fullmatch(pattern):
            raise InvalidField(
                f"{pattern!r} is not a pattern of collection ids; use letters, digits, '.', '_', '~', '-', * for any "
                "characters, and ? for one",
                code="pattern",
                parameter="pattern",
            )
    key_id, secret = _random(_ID), _random(_SECRET)
    record = ApiKeyRecord(
        id=key_id,
        name=name,
        digest=digest_of(secret),
        scopes=tuple(sorted({scope.value for scope in scopes})),
        patterns=tuple(dict.fromkeys(patterns)),
        created=datetime.now(UTC),
        expires=expires,
        revoked=None,
    )
    with database.write() as tx:
        tx.api_keys.add(record)
    return f"urq_{key_id}_{secret}", record


def listed(database: Storage) -> list[ApiKeyRecord]:
    """All keys, oldest first, including revoked and expired ones."""
    with database.read() as tx:
        return tx.api_keys.all()


def revoke(database: Storage, key_id: str) -> None:
    """Revoke a key, for every process within a second, and end its jobs.

    Raises NotFound and Conflict (it is revoked already).
    """
    with database.write() as tx:
        keys = tx.api_keys
        row = keys.get(key_id)
        if row is None:
            raise NotFound("key", key_id)
        if row.revoked is not None:
            raise Conflict(f"The key {key_id} was revoked on {row.revoked:%Y-%m-%d}.")
        keys.revoke(key_id)
        problem = plain(problem_type_of(Unauthorized("")), f"The key {key_id}, which began the job, was revoked.")
        tx.jobs.end_those_of(key_id, problem)


def _random(length: int) -> str:
    return "".join(secrets.choice(_ALPHABET) for _ in range(length))


def digest_of(secret: str) -> bytes:
    """SHA-256 of a secret. Only this is stored."""
    return hashlib.sha256(secret.encode()).digest()
