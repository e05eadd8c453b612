"""The search of one query in a view of a collection, and what is tried where it finds nothing."""

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from server.index.catalog import View
from server.queries.contradictions import COMPARED, without_contradictions
from server.queries.per_session import Search
from server.schemas.queries import QueryInput
from server.store.repositories.candidate_rows import found_submaps
from urquhart import Budget, Recognition, Stage

_UNFOUND = frozenset({"below_gate", "verification_failed", "no_votes"})
"""Reasons that a mirror image of a place has, too."""


def search_in(
    view: View,
    body: QueryInput,
    xy: NDArray[np.float64],
    diameters: NDArray[np.float64] | None,
    most: int,
    only: set[int] | None,
    budget: Budget | None,
) -> Search:
    """A search for landmarks (N, 2), metres, and their diameters (N,), metres, that leaves out some submaps by key.

    It finds `most` candidates in the submaps of `only`, by default in all, and ends with the `budget`.
    """

    def search(excluded: set[int]) -> Recognition:
        found = view.recognizer.recognize(
            xy,
            diameters=diameters,
            limit=max(most, COMPARED),
            method=body.method,
            exclude=excluded,
            only=only,
            rng=None if body.seed is None else np.random.default_rng(body.seed),
            budget=budget,
        )
        accepted = [one.key for one in found.candidates if one.refused is None]
        places = {}
        if len(accepted) > 1:
            rows = found_submaps(view.session, view.collection.key, accepted, landmarks=False)
            places = {key: row.place for key, row in rows.items() if row.place is not None}
        return without_contradictions(found, places, xy, most)

    return search


def try_mirrored(
    view: View,
    body: QueryInput,
    xy: NDArray[np.float64],
    diameters: NDArray[np.float64] | None,
    found: Recognition,
    only: set[int] | None,
    excluded: set[int],
    budget: Budget | None,
) -> tuple[Recognition, tuple[str, ...]]:
    """Where a query found nothing, whether its mirror image does: one more search; the answer and its warnings.

    The answer stays what it was, with the time that this took among its stages.
    """
    if found.verdict != "no_match" or found.reason not in _UNFOUND:
        return found, ()
    if budget is not None and budget.is_spent():
        return found, ()
    began = time.perf_counter()
    image = search_in(view, body, xy * (1.0, -1.0), diameters, 1, only, budget)(excluded)
    stage = Stage("mirror image", 1000.0 * (time.perf_counter() - began), {"matched": int(image.verdict == "matched")})
    told = replace(found, stages=(*found.stages, stage))
    return told, ("mirrored",) if image.verdict == "matched" else ()
