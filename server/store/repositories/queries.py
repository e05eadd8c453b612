"""Rows of stored queries, seen through one collection."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import delete, select
from sqlalchemy.orm import Session, undefer

from server.store.tables import QueryRow


class Queries:
    """Repository of one collection's stored queries; the session is the caller's, and so is the commit."""

    def __init__(self, session: Session, collection_key: int) -> None:
        self._session = session
        self._collection_key = collection_key

    def add(
        self,
        number: int,
        *,
        candidates: Sequence[Mapping[str, Any]],
        landmarks: bytes,
        landmark_ids: bytes | None,
        answer: bytes,
    ) -> None:
        """Store a query: its landmarks (float64 (N, 2)), their ids, the answer as JSON, and the candidates.

        The candidates are the method's own, by landmark positions, which no later renaming of landmarks touches.
        """
        self._session.add(
            QueryRow(
                collection_key=self._collection_key,
                number=number,
                created=datetime.now(UTC),
                candidates=[dict(candidate) for candidate in candidates],
                landmarks=landmarks,
                landmark_ids=landmark_ids,
                answer=answer,
            )
        )
        self._session.flush()

    def drop_through(self, number: int) -> None:
        """Remove the stored queries up to and including a number."""
        statement = delete(QueryRow).where(QueryRow.collection_key == self._collection_key, QueryRow.number <= number)
        self._session.execute(statement, execution_options={"synchronize_session": False})

    def get(self, number: int) -> QueryRow | None:
        """A stored query, or None."""
        query = (
            select(QueryRow)
            .where(QueryRow.collection_key == self._collection_key, QueryRow.number == number)
            .options(undefer(QueryRow.landmarks), undefer(QueryRow.landmark_ids), undefer(QueryRow.answer))
        )
        return self._session.scalar(query)
