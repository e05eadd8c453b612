"""The whole method: where in this collection was this observation made?

describe   landmarks -> tessellation -> polygons and quads                   features
propose    poses in some submaps, level by level, the cheapest first         index, propose
verify     each proposed pose, by all landmarks                              verify
decide     compare with chance and with every rival; candidates, verdict     decide
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from urquhart.budget import Budget, DeadlinePassed
from urquhart.decide.ranking import NOTHING, Ranking, rank
from urquhart.decide.verdict import Recognition, decide, unsearched
from urquhart.features.describe import Features
from urquhart.features.observation import describe_observation
from urquhart.index.collection_index import CollectionIndex
from urquhart.index.submap_collection import SubmapCollection
from urquhart.options import FAST_PROMISE, Options, SearchOptions
from urquhart.prior.decision import decide_within, match_window
from urquhart.prior.prior import Prior
from urquhart.prior.window import search_window, trees_about
from urquhart.propose.by_paper import propose_by_paper
from urquhart.propose.levels import LEVELS, Level, propose_on
from urquhart.propose.query import Proposal, Query, make_query
from urquhart.se2 import SE2
from urquhart.trace import StoppedBy
from urquhart.verify.refinement import verify


class Recognizer(SubmapCollection):
    """A collection that can be searched. Each search sees the collection as it was when the search began."""

    def recognize(
        self,
        observation: Features,
        **options: Unpack[SearchOptions],
    ) -> Recognition:
        """Search for an observation that was described with this collection's configuration.

        Args:
            observation: from `describe`, or the features of a stored submap.
            options: the members of `Options`.

        Raises:
            ValueError: the observation was described with another configuration, or an option is out of range.
            Abandoned: nobody waits for the answer any more.
        """
        chosen = Options(**options)
        index, source = self.read_view
        searched = index.narrowed(chosen.only, chosen.exclude)
        if not len(searched):
            return unsearched("all_filtered_out" if len(index) else "empty_collection")
        query = make_query(observation, self.config, source, len(searched), chosen)
        return _search(query, searched, chosen)

    def locate(
        self, xy: ArrayLike, *, diameters: ArrayLike | None = None, **options: Unpack[SearchOptions]
    ) -> Recognition:
        """Describe landmarks, and search for them. Too few of them, or all on one line, give the answer `no_match`.

        Args:
            xy: (N, 2), metres, any rigid frame.
            diameters: (N,), stem diameters in any unit, NaN where not known. They count if a submap has them too.
            options: keyword arguments of `recognize`.

        Raises:
            LandmarkError: the landmarks or diameters cannot be used.
            Abandoned: nobody waits for the answer any more.
        """
        described = describe_observation(xy, self.config, diameters, options.get("budget") or Budget())
        if not isinstance(described.result, Features):
            return unsearched(described.result, described.stages)
        found = self.recognize(described.result, **options)
        return replace(found, stages=described.stages + found.stages)

    def verify_pose(self, observation: Features, key: int, transform: SE2) -> Recognition:
        """Verify a given pose as if a level had proposed it, and decide. Rivals come from the same submap only.

        Args:
            transform: `submap_T_query`, in the frames as posted.

        Raises:
            KeyError: no such submap.
            ValueError: the observation was described with another configuration.
        """
        return self._verify_given(observation, key, transform, Options())

    def compare_each(
        self,
        observation: Features,
        found: Recognition,
        *,
        min_confidence: float | None = None,
        budget: Budget | None = None,
    ) -> Recognition:
        """Compare the other accepted candidates of a matched answer with the rivals in their own submaps, too.

        A search compares only its first candidate with rivals. If that has none, the others are accepted if they beat
        chance. In rows of trees this is not enough. In 25 simulated drives through rows 3 m apart with 0.3 m of jitter,
        4116 of the 6301 others were at wrong places. After this comparison none was, and 8.5 % of the right ones were
        left out (1 % in the paper's forest). It takes about 3 ms for each candidate, in rows of trees 40 ms.

        Args:
            observation: the one that `found` answers.
            found: an answer of this collection.
            min_confidence, budget: as in `Options`.

        Returns:
            The same answer. Candidates that do not clearly lead their rivals are refused. If a rival fits better and
            leads all others, the candidate has its pose.

        Raises:
            KeyError: the submap of a candidate was removed.
            ValueError: the observation was described with another configuration, or an option is out of range.
            Abandoned: nobody waits for the answer any more.
        """
        if found.verdict != "matched":
            return found
        chosen = Options(min_confidence=min_confidence, budget=budget)
        candidates = list(found.candidates[:1])
        for one in found.candidates[1:]:
            if one.refused is None:
                again = self._verify_given(observation, one.key, one.transform, chosen).candidates
                compared = again[0] if again else replace(one, refused="verification_failed")
                one = replace(compared, level=one.level, support=one.support)
            candidates.append(one)
        return replace(found, candidates=tuple(candidates))

    def _verify_given(self, observation: Features, key: int, transform: SE2, chosen: Options) -> Recognition:
        """The answer for one given pose `submap_T_query`, frames as posted."""
        index, source = self.read_view
        query = make_query(observation, self.config, source, len(index), chosen)
        start = SE2.shift(query.submaps.features(key).origin).inverse() @ transform @ SE2.shift(query.features.origin)
        with query.trace.timed("verify given"):
            verified = verify(query.grid, query.submaps.grid(key), start, query.reach)
        ranking = rank(query, [Proposal(key, "given", 0, verified)])
        return decide(query, ranking, 1, "exhausted" if ranking.complete else "deadline")

    def recognize_within(
        self,
        observation: Features,
        prior: Prior,
        places: Mapping[int, SE2],
        *,
        min_confidence: float | None = None,
        budget: Budget | None = None,
    ) -> Recognition:
        """Search for an observation where a prior says that it is: at every pose of its window.

        The window has the poses whose position at their yaw, and whose yaw, are each within 3.5 standard deviations of
        the prior. If the trees fit best outside of it, the answer is `no_match` with the reason `outside_prior`.

        All trees of the given submaps about the window are searched as one map. The one candidate is reported in the
        submap with most partners. Positions count, diameters where both sides have them; and if the observation has
        diameters and the map does not, the map may lack the thinner stems.

        Args:
            observation: from `describe`, or the features of a stored submap.
            prior: rough pose of the observation, `map_T_query`.
            places: `map_T_submap`, frames as posted, of the submaps about the prior; those without trees near the
                window do no harm.
            min_confidence, budget: as in `Options`.

        Raises:
            ValueError: the observation was described with another configuration, or an option is out of range.
            WindowTooLarge: the prior is too vague.
            KeyError: no such submap.
            Abandoned: nobody waits for the answer any more.
        """
        index, source = self.read_view
        if not places:
            return unsearched("all_filtered_out" if len(index) else "empty_collection")
        chosen = Options(min_confidence=min_confidence, budget=budget)
        query = make_query(observation, self.config, source, len(places), chosen)
        try:
            query.read(places)
            submaps = {key: query.submaps.features(key) for key in places}
            xy, diameters = trees_about(observation, prior, submaps, places)
            about = describe_observation(xy, self.config, diameters, query.budget)
            if not isinstance(about.result, Features):
                return unsearched("no_proposal", about.stages)
            with query.trace.timed("search window") as counts:
                search = search_window((observation, query.grid), about.result, prior, query.budget)
                counts["poses"] = len(search.poses)
                match = match_window(search)
        except DeadlinePassed:
            return unsearched("deadline", query.trace.done())
        return decide_within(query, about.result, places, match)


def _search(query: Query, index: CollectionIndex, options: Options) -> Recognition:
    """Propose and rank, level by level, until a pose is certain or time runs out; then decide."""
    ranking, limit = NOTHING, options.limit
    levels = LEVELS[options.effort]
    if options.method == "paper":
        rng = options.rng or np.random.default_rng(0)
        levels = [Level("paper", lambda *_: True, lambda search: propose_by_paper(search.query, search.index, rng))]
    proposed = propose_on(index, query, limit, lambda: ranking.is_lost(query), levels)
    for level, proposals in proposed:
        ranking = rank(query, proposals, ranking)
        if ranking.is_certain(query, level.sees_few):
            return decide(query, ranking, limit, "decided")
        if query.budget.is_spent():
            return decide(query, ranking, limit, "deadline")
    return decide(query, ranking, limit, _end(query, ranking, options))


def _end(query: Query, ranking: Ranking, options: Options) -> StoppedBy:
    """Why a search ends after its last level."""
    if not ranking.is_lost(query):
        return "beats_chance"
    if not options.is_cut_short:
        return "exhausted"
    return "evidence_bound" if len(query.features.landmarks) >= FAST_PROMISE.landmarks else "effort"
