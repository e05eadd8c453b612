"""The search for a submap's place before the submap is stored. Writes know this protocol; `queries` implements it."""

from typing import Protocol

from server.schemas.queries import QueryAnswer
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction
from urquhart import Description


class SearchOutdated(Exception):
    """Others have stored submaps between a search and the write that relies on it."""


class LoopClosing(Protocol):
    """A search for a submap's place before the submap is stored."""

    def ask(self, observation: Description) -> QueryAnswer:
        """Search for the submap's landmarks, which are described already."""

    def confirm(
        self, tx: ReadTransaction, collection: CollectionRecord, own_key: int | None, attempt: int
    ) -> QueryAnswer:
        """The answer, in the transaction that stores the submap, after `attempt` + 1 searches.

        `own_key`: key of what is stored under the submap's id. Raises SearchOutdated.
        """
