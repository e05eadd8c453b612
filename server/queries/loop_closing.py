"""The question that is asked before a submap is stored: has anybody been here?

Two robots that come to one place at the same time both search before either has stored its submap. So the transaction
that stores a submap looks at what was committed since the search, and whoever commits last is told of the other.
"""

from typing import Final

from sqlalchemy.orm import Session

from server.errors import InvalidField
from server.index.derived import config_of, features_of
from server.queries.filters import keys_excluded, keys_near
from server.queries.lookup import PendingSubmap, QueryContext, look_up, share_of, shown
from server.schemas.queries import QueryAnswer, QueryInput
from server.store.repositories.feature_rows import FeatureRows
from server.store.repositories.submaps import Submaps
from server.store.tables import CollectionRow
from server.submaps.question import SearchOutdated
from urquhart import Budget, Description, Features, Recognizer

_AT_LEISURE: Final = 2
"""Searches outside of the write transaction before new submaps are looked at within it, where others wait for that."""
_FEW: Final = 16
"""New submaps that are searched within it, at most."""
_SECONDS: Final = 0.25
"""For how long they are searched, at most."""


class LoopQuestion:
    """Where else a submap was seen, by all that is stored before it."""

    def __init__(
        self, context: QueryContext, collection_id: str, body: QueryInput, own_id: str | None, budget: Budget
    ) -> None:
        """`own_id`: of the submap, where the caller gave one; what is stored under it is not to be found."""
        self._context = context
        self._collection_id, self._body, self._own_id, self._budget = collection_id, body, own_id, budget
        self._observation: Description | None = None
        self._answer: QueryAnswer | None = None

    def ask(self, observation: Description) -> QueryAnswer:
        """Search what is stored now. Raises as `look_up`; fields are pointed at below `/query`."""
        try:
            look = look_up(
                self._context,
                self._collection_id,
                self._body,
                pending=PendingSubmap(self._own_id, observation),
                budget=share_of(self._budget, self._body, self._context.limits),
            )
        except InvalidField as error:
            raise error.below("/query") from error
        self._observation, self._answer = observation, shown(look.answer, self._body)
        return self._answer

    def confirm(self, session: Session, collection: CollectionRow, own_key: int | None, turn: int) -> QueryAnswer:
        """The last answer, once nothing that was committed since could change it. Raises SearchOutdated."""
        answer = self._answer
        assert answer is not None, "ask comes before confirm"
        new = self._unseen(session, collection, answer.revision, own_key)
        if new and (turn < _AT_LEISURE or len(new) > _FEW or self._may_find(session, collection, new)):
            raise SearchOutdated
        return answer.model_copy(update={"revision": collection.revision})

    def _unseen(self, session: Session, collection: CollectionRow, revision: int, own_key: int | None) -> list[int]:
        """Keys of submaps that were stored after the search and that the question is about; some of very many."""
        if collection.revision == revision:
            return []
        submaps = Submaps(session, collection.key)
        changed = [key for key in submaps.changed_since(revision, 2 * _FEW) if key != own_key]
        if not changed:
            return []
        near = keys_near(submaps, self._body.near, among=changed)
        excluded = keys_excluded(submaps, self._body.exclude, self._body.stamp, among=changed)
        left = [key for key in changed if key not in excluded and (near is None or key in near)]
        # Behind those that were looked at there may be others.
        return changed if len(changed) + 1 >= 2 * _FEW else left

    def _may_find(self, session: Session, collection: CollectionRow, keys: list[int]) -> bool:
        """Whether one of these submaps may be the place, or look like it: then all have to be weighed together."""
        observation = None if self._observation is None else self._observation.result
        if not isinstance(observation, Features):
            return False  # nothing can be found by it
        config = config_of(collection)
        recognizer = Recognizer(config)
        recognizer.add(
            (row.key, features_of(row.features, row.landmarks, row.attributes, config))
            for row in FeatureRows(session, collection.key).stored(keys)
        )
        found = recognizer.recognize(observation, budget=self._budget.within(_SECONDS))
        return found.reason == "deadline" or any(candidate.log_odds > 0.0 for candidate in found.candidates)
