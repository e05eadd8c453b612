"""The search of one query in a view of a collection, and what would make it match if it finds nothing."""

import time
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from server.collections.georeference import Georeference
from server.errors import InvalidField
from server.index.live_indexes import View
from server.queries.contradicting_maps import COMPARED, without_contradictions
from server.queries.per_session import by_session
from server.queries.poses import place_pose
from server.queries.query import KnownPlace, PlaceQuery, QueryLandmarks, Surroundings
from server.store.repositories.candidate_rows import CandidateRows
from server.submaps.preparation import invalid_landmarks
from urquhart import (
    SE2,
    Budget,
    Description,
    Features,
    LandmarkError,
    Recognition,
    Stage,
    WindowTooLarge,
    describe_observation,
)
from urquhart.hints import HINTS, Change, Hint, changed_prior, changes, find_hint
from urquhart.prior.region import window_extent

_UNFOUND = frozenset({"below_gate", "verification_failed", "no_proposal"})
"""Reasons that a stored place with wrong coordinates has as well."""
MOST_SUBMAPS: Final = 1_000
"""Most submaps that are searched together about a prior: their features take about 50 MB."""
NAMED_FRAMES: Final = 5
"""Most map frames that an error names."""


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
        rows: of the submaps that were found; the answer needs them again.
    """

    view: View
    query: PlaceQuery
    observation: Features
    most: int
    only: set[int] | None
    budget: Budget | None
    rows: CandidateRows

    def find(self, excluded: set[int]) -> tuple[Recognition, Hint | None]:
        """The answer, and what would make it match."""
        if self.query.per_session:
            sessions = self.view.tx.sessions(self.view.collection.key)
            found = by_session(self, sessions, excluded, self.most)
        else:
            found = self(excluded)
        # The searches for a hint take several times as long again.
        return self._hinted(found, excluded) if self.query.hints else (found, None)

    def __call__(self, excluded: set[int]) -> Recognition:
        """The best candidates in all submaps except those with these keys. Raises InvalidField for a prior that cannot
        be used."""
        if self.query.prior is not None:
            return self._within(self.query.prior, excluded)
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
        if self.query.compare_each:
            found = self.view.recognizer.compare_each(
                self.observation, found, min_confidence=self.query.min_confidence, budget=self.budget
            )
        accepted = [one.key for one in found.candidates if one.refused is None]
        places = {}
        if len(accepted) > 1:
            # Of all that the answer names, so that it needs no statement of its own.
            named = {one.key for one in found.candidates} | {one.key for one in found.rivals}
            rows = self.rows.read(named, landmarks=False)
            places = {key: row.place for key, row in rows.items() if key in accepted and row.place is not None}
        map_frames = {place.map_frame_id for place in places.values()}
        frames = self.view.tx.map_frames(self.view.collection).some(map_frames) if len(map_frames) > 1 else {}
        return without_contradictions(found, places, frames, self.most)

    def _within(self, known: KnownPlace, excluded: set[int]) -> Recognition:
        """The answer for a query whose rough pose is known."""
        places = submaps_about(self.view, known, self.observation, excluded, self.only)
        try:
            return self.view.recognizer.recognize_within(
                self.observation,
                known.prior,
                places,
                min_confidence=self.query.min_confidence,
                budget=self.budget,
            )
        except WindowTooLarge as error:
            raise InvalidField(str(error), code="window_too_large", pointer="/prior/covariance") from error

    def _hinted(self, found: Recognition, excluded: set[int]) -> tuple[Recognition, Hint | None]:
        """If the query found nothing, search for it with changed coordinates as well. Returns `found` and a hint.

        The verdict is unchanged; the time of these searches is added to the stages.
        """
        if found.verdict != "no_match" or found.reason not in _UNFOUND:
            return found, None
        began = time.perf_counter()
        tried = list(changes(self._latitude(), turned=self.query.prior is not None))
        budget = (self.budget or Budget()).within(HINTS.seconds)

        def search(changed: Features, change: Change) -> Recognition:
            query, known = self.query, self.query.prior
            if known is not None:
                query = replace(query, prior=replace(known, prior=changed_prior(known.prior, change)))
            return replace(self, query=query, observation=changed, most=1, budget=budget)(excluded)

        recognizer = self.view.recognizer
        hint = find_hint(self.observation, search, tried, recognizer.config, recognizer.features, budget)
        spent = 1000.0 * (time.perf_counter() - began)
        stage = Stage("changed coordinates", spent, {"found": int(hint is not None)})
        return replace(found, stages=(*found.stages, stage)), hint

    def _latitude(self) -> float | None:
        """Latitude of the map in degrees, if its first map frame has a coordinate reference system."""
        frames = self.view.tx.map_frames(self.view.collection)
        names = frames.in_use(1) if self.query.prior is None else [self.query.prior.frame_id]
        references, extent = frames.some(names), frames.extent(names[0]) if names else None
        if extent is None or not references:
            return None
        x, y = 0.5 * (extent[0] + extent[2]), 0.5 * (extent[1] + extent[3])
        return Georeference(references[names[0]]).latitude(x, y)


def submaps_about(
    view: View, known: KnownPlace, observation: Features, excluded: Collection[int], only: set[int] | None
) -> dict[int, SE2]:
    """`map_T_submap` of the submaps that reach into the window of a prior, by key.

    Args:
        observation: features of the query.
        excluded: keys of submaps to leave out.
        only: keys of the submaps to search; None for all.

    Raises:
        InvalidField: no submap has a pose in that map frame, or too many reach into the window.
    """
    middle, radius = window_extent(known.prior, observation)
    window = Surroundings(known.frame_id, float(middle[0]), float(middle[1]), radius)
    keys = window.keys(view.tx.submaps(view.collection.key)) - set(excluded)
    if only is not None:
        keys &= only
    if not keys:
        _check_frame(view, known.frame_id)
    if len(keys) > MOST_SUBMAPS:
        raise InvalidField(
            f"{len(keys):,} submaps reach into the window, more than {MOST_SUBMAPS:,}: give a smaller covariance, or "
            "leave submaps out with `exclude`",
            code="window_too_large",
            pointer="/prior/covariance",
        )
    rows = view.tx.candidates(view.collection.key).read(keys, landmarks=False)
    return {key: place_pose(row.place) for key, row in sorted(rows.items()) if row.place is not None}


def _check_frame(view: View, frame_id: str) -> None:
    """Raise InvalidField if no submap of a collection that has some has a pose in a map frame."""
    frames = view.tx.map_frames(view.collection)
    if not len(view.recognizer.index) or frames.extent(frame_id) is not None:
        return
    known = frames.in_use(NAMED_FRAMES + 1)
    names = ", ".join(repr(name) for name in known[:NAMED_FRAMES])
    there = f"there are {names}{' and others' if len(known) > NAMED_FRAMES else ''}" if known else "none has one"
    raise InvalidField(
        f"no submap has a map pose in the frame {frame_id!r}: {there}", code="no_frame", pointer="/prior/frame_id"
    )
