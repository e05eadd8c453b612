"""Rows of API keys."""

from collections.abc import Sequence
from datetime import UTC, datetime

from sqlalchemy import exists, or_, select, update
from sqlalchemy.orm import Session

from server.store.tables import KeyRow


class ApiKeys:
    """Repository of API keys; the session is the caller's, and so is the commit."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def get(self, key_id: str) -> KeyRow | None:
        """The key of that id, also one that is revoked or expired; or None."""
        return self._session.scalar(select(KeyRow).where(KeyRow.id == key_id))

    def all(self) -> Sequence[KeyRow]:
        """All keys in the order they were made."""
        return self._session.scalars(select(KeyRow).order_by(KeyRow.key)).all()

    def any(self) -> bool:
        """Whether there is a key, even a revoked or expired one."""
        return bool(self._session.scalar(select(exists().select_from(KeyRow))))

    def any_usable(self, now: datetime) -> bool:
        """Whether there is a key that is neither revoked nor expired."""
        usable = select(KeyRow.key).where(KeyRow.revoked.is_(None), or_(KeyRow.expires.is_(None), KeyRow.expires > now))
        return bool(self._session.scalar(select(usable.exists())))

    def add(
        self,
        *,
        key_id: str,
        name: str,
        digest: bytes,
        scopes: list[str],
        patterns: list[str],
        expires: datetime | None,
    ) -> KeyRow:
        """Add a key."""
        row = KeyRow(
            id=key_id,
            name=name,
            digest=digest,
            scopes=scopes,
            patterns=patterns,
            created=datetime.now(UTC),
            expires=expires,
            revoked=None,
        )
        self._session.add(row)
        self._session.flush()
        return row

    def revoke(self, key_id: str) -> None:
        """Note that a key may not be used any more; the first time stays."""
        self._session.execute(
            update(KeyRow).where(KeyRow.id == key_id, KeyRow.revoked.is_(None)).values(revoked=datetime.now(UTC))
        )
