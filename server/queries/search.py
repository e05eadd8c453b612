"""The search of one query in a view of a collection, and the search for its mirror image if it finds nothing."""

import time
from dataclasses import dataclass, replace

import numpy as np

from server.index.live_indexes import View
from server.queries.contradicting_maps import COMPARED, without_contradictions
from server.queries.per_session import by_session
from server.queries.query import PlaceQuery, QueryLandmarks
from server.submaps.preparation import invalid_landmarks
from urquhart import Budget, Description, Features, LandmarkError, Recognition, Stage, describe, describe_observation

_UNFOUND = frozenset({"below_gate", "verification_failed", "no_proposal"})
"""Reasons that the mirror image of a stored place has as well."""


def describe_query(
    view: View, landmarks: QueryLandmarks, pointer: str, key: int | None, budget: Budget | None
) -> Description:
    """Describe the landmarks of a query, unless they are those of the stored submap `key`, whose features are stored.

    `pointer`: JSON pointer to the landmarks in the request. Raises InvalidLandmarks and Abandoned.
    """
    if key is not None:
        return Description(view.recognizer.features(key))
    try:
        return describe_observation(landmarks.xy, view.recognizer.config, landmarks.diameters, budget or Budget())
    except LandmarkError as error:
        raise invalid_landmarks(error, pointer) from error


@dataclass(frozen=True, slots=True)
class SubmapSearch:
    """The search of one query in a view. Called with the keys of submaps to leave out.

    Attributes:
        view: the collection at the revision that is searched.
        query: for its method and its seed.
        observation: features of the query's landmarks.
        most: candidates to find.
        only: keys of the submaps to search; None for all.
        budget: what the search may take; None for as long as it takes.
    """

    view: View
    query: PlaceQuery
    observation: Features
    most: int
    only: set[int] | None
    budget: Budget | None

    def find(self, excluded: set[int]) -> tuple[Recognition, tuple[str, ...]]:
        """The answer, and warnings."""
        if self.query.per_session:
            sessions = self.view.tx.sessions(self.view.collection.key)
            found = by_session(self, sessions, excluded, self.most)
        else:
            found = self(excluded)
        # A search for the mirror image takes as long again.
        return self._try_mirrored(found, excluded) if self.query.explain else (found, ())

    def __call__(self, excluded: set[int]) -> Recognition:
        """The best candidates in all submaps except those with these keys."""
        found = self.view.recognizer.recognize(
            self.observation,
            limit=max(self.most, COMPARED),
            method=self.query.method,
            effort=self.query.effort,
            min_confidence=self.query.min_confidence,
            exclude=excluded,
            only=self.only,
            rng=None if self.query.seed is None else np.random.default_rng(self.query.seed),
            budget=self.budget,
        )
        accepted = [one.key for one in found.candidates if one.refused is None]
        places = {}
        if len(accepted) > 1:
            rows = self.view.tx.candidates(self.view.collection.key).read(accepted, landmarks=False)
            places = {key: row.place for key, row in rows.items() if row.place is not None}
        map_frames = {place.map_frame_id for place in places.values()}
        frames = self.view.tx.map_frames(self.view.collection).some(map_frames) if len(map_frames) > 1 else {}
        return without_contradictions(found, places, frames, self.most)

    def _try_mirrored(self, found: Recognition, excluded: set[int]) -> tuple[Recognition, tuple[str, ...]]:
        """If the query found nothing, search for its mirror image as well. Returns `found` and warnings.

        The verdict is unchanged; the time of this search is added to the stages.
        """
        if found.verdict != "no_match" or found.reason not in _UNFOUND:
            return found, ()
        if self.budget is not None and self.budget.is_spent():
            return found, ()
        began = time.perf_counter()
        image = replace(self, observation=self._mirrored(), most=1)(excluded)
        spent = 1000.0 * (time.perf_counter() - began)
        stage = Stage("mirror image", spent, {"matched": int(image.verdict == "matched")})
        return replace(found, stages=(*found.stages, stage)), ("mirrored",) if image.verdict == "matched" else ()

    def _mirrored(self) -> Features:
        """The features of the query's mirror image."""
        here = self.observation
        diameters = here.diameters if len(here.diameters) else None
        return describe(here.landmarks * (1.0, -1.0), self.view.recognizer.config, diameters)
