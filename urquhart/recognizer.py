"""The whole method: where in this collection was this observation made?

describe   landmarks -> tessellation -> polygons and quads                features
propose    level by level, the cheapest first: poses in some submaps      index, propose
verify     each pose against all landmarks, as it is proposed             verify
decide     against chance and every rival pose; candidates and verdict    decide
"""

from collections.abc import Collection as Keys
from collections.abc import Mapping
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from urquhart.budget import Budget, OutOfTime
from urquhart.decide.ranking import NOTHING, rank
from urquhart.decide.verdict import Reason, Recognition, decide, unsearched
from urquhart.features.landmarks import LandmarkError
from urquhart.index.collection import Collection
from urquhart.index.collection_index import CollectionIndex
from urquhart.propose.by_paper import propose_by_paper
from urquhart.propose.levels import propose_on
from urquhart.propose.query import Proposal, Query, make_query
from urquhart.se2 import SE2
from urquhart.trace import Trace
from urquhart.verify.refinement import verify

Method = Literal["robust", "paper"]
_TOO_LITTLE: Final[Mapping[str, Reason]] = {"too_few": "too_few_landmarks", "collinear": "collinear_landmarks"}
"""Landmarks that fix no pose are no error of the caller: the reason of their `no_match`."""


class Recognizer(Collection):
    """A collection that can be asked. Each look-up searches the collection as it was when the look-up began."""

    def recognize(
        self,
        xy: ArrayLike,
        *,
        diameters: ArrayLike | None = None,
        limit: int = 5,
        method: Method = "robust",
        exclude: Keys[int] = (),
        only: Keys[int] | None = None,
        rng: np.random.Generator | None = None,
        budget: Budget | None = None,
    ) -> Recognition:
        """Look an observation up.

        Args:
            xy: (N, 2), metres, any rigid frame.
            diameters: (N,), stem diameters in any unit, NaN where not known; they count where a submap has them too.
            limit: most candidates returned.
            exclude: keys of submaps that are not to be considered.
            only: keys of those that are; all by default.
            rng: randomness of the paper's method (sampling, RANSAC); a fixed seed by default.
            budget: when the search must end; by default it ends when it is done. An answer at the deadline is
                `no_match` with the reason `deadline` and the candidates found so far: rivals may not have been seen.

        Raises:
            Abandoned: nobody waits for the answer any more.
            LandmarkError: for input that is wrong. Too few landmarks, or all on one line, is normal life for a robot
                and answered with `no_match` and the reason.
        """
        trace = Trace()
        index, source = self._held
        chosen = index.narrowed(only, exclude)
        try:
            query = make_query(xy, diameters, self.config, source, len(chosen), trace=trace, budget=budget)
        except LandmarkError as error:
            if error.code not in _TOO_LITTLE:
                raise
            return unsearched(_TOO_LITTLE[error.code], trace)
        except OutOfTime:
            return unsearched("deadline", trace)
        if not len(chosen):
            return unsearched("nothing_left" if len(index) else "empty_collection", trace)
        return _search(query, chosen, limit, method, rng)

    def check(self, xy: ArrayLike, key: int, transform: SE2, *, diameters: ArrayLike | None = None) -> Recognition:
        """Verify a given pose as if it had been found, with the same rivals and the same verdict.

        Args:
            transform: `submap_T_query`, in the frames as posted.

        Raises:
            KeyError: no such submap.
            LandmarkError: for input that cannot be described.
        """
        index, source = self._held
        query = make_query(xy, diameters, self.config, source, len(index), trace=Trace())
        start = SE2.shift(query.submaps.features(key).origin).inverse() @ transform @ SE2.shift(query.features.origin)
        with query.trace.timed("verify given"):
            verified = verify(query.grid, query.submaps.grid(key), start, query.reach)
        return decide(query, rank(query, [Proposal(key, "given", 0, verified)]), 1, "exhausted")


def _search(
    query: Query, index: CollectionIndex, limit: int, method: Method, rng: np.random.Generator | None
) -> Recognition:
    """Propose and rank, level by level, until one leaves nothing to doubt or the time is over; then decide."""
    ranking = NOTHING
    if method == "paper":
        levels = iter([propose_by_paper(query, index, rng or np.random.default_rng(0))])
    else:
        levels = propose_on(index, query, limit, lambda: ranking.is_lost(query))
    for proposals in levels:
        ranking = rank(query, proposals, ranking)
        if ranking.is_certain(query):
            return decide(query, ranking, limit, "settled")
        if query.budget.is_spent():
            return decide(query, ranking, limit, "deadline")
    return decide(query, ranking, limit, "exhausted" if ranking.is_lost(query) else "beats_chance")
