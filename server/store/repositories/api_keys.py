"""Rows of API keys."""

from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, Row, exists, insert, or_, select, update

from server.store.columns import columns_of, values_of
from server.store.service_records import ApiKeyRecord
from server.store.service_tables import KeyRow


class ApiKeyReader:
    """Reads API keys in a transaction of the caller."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def get(self, key_id: str) -> ApiKeyRecord | None:
        """The key of that id, also one that is revoked or expired; or None."""
        row = self._connection.execute(_ALL.where(KeyRow.id == key_id)).one_or_none()
        return None if row is None else _record(row)

    def all(self) -> list[ApiKeyRecord]:
        """All keys in the order they were made."""
        return [_record(row) for row in self._connection.execute(_ALL.order_by(KeyRow.key))]

    def any(self) -> bool:
        """Whether there is a key, even a revoked or expired one."""
        return bool(self._connection.scalar(select(exists().select_from(KeyRow))))

    def any_usable(self, now: datetime) -> bool:
        """Whether there is a key that is neither revoked nor expired."""
        usable = select(KeyRow.key).where(KeyRow.revoked.is_(None), or_(KeyRow.expires.is_(None), KeyRow.expires > now))
        return bool(self._connection.scalar(select(usable.exists())))


class ApiKeys(ApiKeyReader):
    """Reads and writes API keys in a transaction that the caller commits."""

    def add(self, record: ApiKeyRecord) -> None:
        """Add a key."""
        lists = {"scopes": list(record.scopes), "patterns": list(record.patterns)}
        self._connection.execute(insert(KeyRow).values(values_of(record) | lists))

    def revoke(self, key_id: str) -> None:
        """Note that a key may not be used any more; the first time stays."""
        self._connection.execute(
            update(KeyRow).where(KeyRow.id == key_id, KeyRow.revoked.is_(None)).values(revoked=datetime.now(UTC))
        )


_ALL = select(*columns_of(ApiKeyRecord, KeyRow))


def _record(row: Row[Any]) -> ApiKeyRecord:
    values = row._asdict()
    return ApiKeyRecord(**values | {"scopes": tuple(values["scopes"]), "patterns": tuple(values["patterns"])})
