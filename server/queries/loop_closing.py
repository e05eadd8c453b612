"""The search before a submap is stored: was this place seen before?

Two robots that come to one place at the same time both search before either has stored its submap. So the transaction
that stores a submap considers what was committed since the search, and whoever commits last learns of the other.
"""

from typing import Final

from server.errors import InvalidField
from server.index.row_decoding import config_of, features_of
from server.platform.precedence import turn
from server.queries.lookup import PendingSubmap, QueryContext, look_up, share_of, shown
from server.queries.query import PlaceQuery
from server.schemas.queries import QueryAnswer
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction
from server.submaps.loop_closing import SearchOutdated
from urquhart import Budget, Description, Features, Recognizer

_AT_LEISURE: Final = 2
"""Searches outside of the write transaction before new submaps are searched within it, while other writers wait."""
_FEW: Final = 16
"""Most new submaps that are searched within the transaction."""
_SECONDS: Final = 0.25
"""Longest time of that search."""


class LoopClosingQuery:
    """Where else a submap was seen, among all that is stored before it."""

    def __init__(
        self, context: QueryContext, collection_id: str, query: PlaceQuery, own_id: str | None, budget: Budget
    ) -> None:
        """`own_id`: id of the submap if the caller gave one. What is stored under it is left out of the search."""
        self._context = context
        self._collection_id, self._query, self._own_id, self._budget = collection_id, query, own_id, budget
        self._observation: Description | None = None
        self._answer: QueryAnswer | None = None

    def ask(self, observation: Description) -> QueryAnswer:
        """Search what is stored now. Raises as `look_up`, with pointers below `/query`."""
        try:
            with turn():
                look = look_up(
                    self._context,
                    self._collection_id,
                    self._query,
                    pending=PendingSubmap(self._own_id, observation),
                    budget=share_of(self._budget, self._query, self._context.limits),
                )
        except InvalidField as error:
            raise error.below("/query") from error
        self._observation, self._answer = observation, shown(look.answer, self._query)
        return self._answer

    def confirm(
        self, tx: ReadTransaction, collection: CollectionRecord, own_key: int | None, attempt: int
    ) -> QueryAnswer:
        """The last answer, if nothing that was committed since could change it. Raises SearchOutdated."""
        answer = self._answer
        assert answer is not None, "ask comes before confirm"
        new = self._unseen(tx, collection, answer.revision, own_key)
        if new and (attempt < _AT_LEISURE or len(new) > _FEW or self._may_find(tx, collection, new)):
            raise SearchOutdated
        return answer.model_copy(update={"revision": collection.revision})

    def _unseen(
        self, tx: ReadTransaction, collection: CollectionRecord, revision: int, own_key: int | None
    ) -> list[int]:
        """Keys of the submaps that were stored after the search and that the query covers; only some if there are
        very many.
        """
        if collection.revision == revision:
            return []
        submaps = tx.submaps(collection.key)
        changed = [key for key in submaps.changed_since(revision, 2 * _FEW) if key != own_key]
        if not changed:
            return []
        near = None if self._query.near is None else self._query.near.keys(submaps, changed)
        excluded = self._query.exclude.keys(submaps, self._query.stamp, changed)
        left = [key for key in changed if key not in excluded and (near is None or key in near)]
        # Others may follow after those that were read.
        return changed if len(changed) + 1 >= 2 * _FEW else left

    def _may_find(self, tx: ReadTransaction, collection: CollectionRecord, keys: list[int]) -> bool:
        """Whether one of these submaps may be the place or a rival, so that all must be compared."""
        observation = None if self._observation is None else self._observation.result
        if not isinstance(observation, Features):
            return False  # it covers no submap
        if self._query.prior is not None:
            return True  # in the window, all trees count together
        config = config_of(collection)
        recognizer = Recognizer(config)
        recognizer.add(
            (row.key, features_of(row.features, row.landmarks, row.attributes, config))
            for row in tx.features(collection.key).stored(keys)
        )
        found = recognizer.recognize(observation, budget=self._budget.within(_SECONDS))
        return found.reason == "deadline" or any(candidate.log_odds > 0.0 for candidate in found.candidates)
