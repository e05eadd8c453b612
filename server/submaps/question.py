"""What may be asked of a collection before a submap is stored in it."""

from typing import Protocol

from sqlalchemy.orm import Session

from server.schemas.queries import QueryAnswer
from server.store.tables import CollectionRow
from urquhart import Description


class SearchOutdated(Exception):
    """Others stored submaps between a search and the write that relies on it."""


class Question(Protocol):
    """What is asked of the collection before a submap is stored in it."""

    def ask(self, observation: Description) -> QueryAnswer:
        """Search what is stored now for the submap's landmarks, which were described before."""

    def confirm(self, session: Session, collection: CollectionRow, own_key: int | None, turn: int) -> QueryAnswer:
        """The answer, in the transaction that stores the submap, after `turn` + 1 searches.

        `own_key`: what is stored under the submap's id. Raises SearchOutdated.
        """
