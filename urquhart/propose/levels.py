"""The levels of a search, in the order of their cost, and when each is worth its time."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from urquhart.index.collection_index import CollectionIndex
from urquhart.options import Effort
from urquhart.propose.by_correlation import is_large, is_small, propose_by_correlation
from urquhart.propose.by_polygons import propose_by_polygons
from urquhart.propose.by_quads import QUADS, QuadChoice, propose_by_quads, search_quads
from urquhart.propose.correlation import covers_ends
from urquhart.propose.hit_buffer import BUFFERS, HitBuffer
from urquhart.propose.quad_consensus import QuadConsensus
from urquhart.propose.query import Proposal, Query


class LevelNumbers(NamedTuple):
    """How far the levels go. Chosen by hand, not fitted; `make bench-levels` measures what each level adds."""

    rarest: float = 0.1
    """Share of a query's quads, the rarest ones, that are searched first if it has many. In dense stands they cost a
    tenth of the time and answer three queries of four."""
    many: int = 320
    """Such a query has this many quads. With fewer, the rarest are too few to agree, and cost more than they save."""
    rare: float = 0.5
    """Share of a query's quads that are searched next. They answer most queries."""
    few: int = 4
    """Fewest submaps that are verified after the search for the rarest quads."""
    fast: int = 12
    """Submaps that are verified after the search for quads with loose lengths, if the effort is `fast`. Of 400 places
    seen with 40 cm of noise and 80 % of the trees, among 10,000 submaps, all are among them; no command repeats it."""
    fast_unsure: int = 16
    """The same if fewer than `agreeing` quads must agree. Of 600 such places among 1,000 submaps, all are among them,
    and with 12 one is not; no command repeats it."""
    agreeing: int = 3
    """Quads that must agree on a pose among 10,000 submaps for it to be verified then, if the query has many quads; one
    more for ten times as many submaps, one less for a tenth. Measured with 40 cm of noise and 80 % of the trees: of 750
    places of which 18 to 79 trees are seen, this loses none that is found without; no command repeats it."""
    quads_each: int = 80
    """A query with fewer quads than this needs a single one, with fewer than twice as many two, and so on."""
    fast_poses: int = 2
    """Distinct poses of such a submap that are verified."""


EXTENT: Final = LevelNumbers()


@dataclass(slots=True, eq=False)
class Search:
    """One search of one index for a query: the state that its levels share.

    Attributes:
        query, index: what is searched for, and where.
        limit: most candidates in the answer.
        buffer: memory for quad hits.
        is_single: whether the index holds one submap, and a correlation covers it to its ends.
        quads, loose_quads: the searches for quads with tight and with loose lengths, once a level has begun them.
    """

    query: Query
    index: CollectionIndex
    limit: int
    buffer: HitBuffer
    is_single: bool
    quads: QuadConsensus | None = None
    loose_quads: QuadConsensus | None = None

    def propose_by_quads(self, share: float, count: int, least: int = 1) -> list[Proposal]:
        """Continue the search with tight lengths up to a `share` of the query's quads, and propose `count` submaps."""
        self.quads = self.quads or search_quads(self.query, self.index, QUADS.tight, self.buffer)
        return propose_by_quads(self.query, self.index, self.quads, QuadChoice(share, count, least))

    def propose_by_loose_quads(self, choice: QuadChoice, errors: float = QUADS.loose) -> list[Proposal]:
        """Search for the query's quads with loose lengths; `errors`: their tolerance in units of `Config.sigma`."""
        if self.quads is None:
            self.loose_quads = search_quads(self.query, self.index, errors, self.buffer)
        else:
            self.loose_quads = self.quads.begun_again(errors * self.query.config.sigma)
        return propose_by_quads(self.query, self.index, self.loose_quads, choice)

    def propose_by_correlation(self) -> list[Proposal]:
        """Try the query on whole submaps, under every rotation and shift."""
        return propose_by_correlation(self.query, self.index, self.loose_quads)


def fast_choice(search: Search) -> QuadChoice:
    """What is verified after the search for quads with loose lengths, if the effort is `fast`.

    The more quads a query has, the more of them agree on its true place; the more submaps are searched, the more agree
    by chance somewhere.
    """
    quads, submaps = len(search.query.features.tessellation.quads), len(search.index)
    by_chance = EXTENT.agreeing + math.floor(math.log10(max(submaps, 1))) - 4
    least = max(min(1 + quads // EXTENT.quads_each, by_chance), 1)
    verified = EXTENT.fast if least >= EXTENT.agreeing else EXTENT.fast_unsure
    return QuadChoice(1.0, verified, least, EXTENT.fast_poses if least > 1 else QUADS.poses)


def looser_choice(search: Search) -> QuadChoice:
    """What is verified after the last search for quads in a large collection: where more agree than by chance.

    With such lengths there are four times as many hits by chance. To compare all of them would take three quarters of
    the time, and at the true place at least six agree.
    """
    fast = fast_choice(search)
    return fast._replace(least=fast.least + 1)


class Level(NamedTuple):
    """One level of a search.

    Attributes:
        name: in tables and benchmarks.
        applies: whether the level is worth its time, given the search so far, and whether the query is lost, which
            means that no proposal so far beats chance.
        propose: returns the level's proposals.
        sees_few: whether rivals may be missed, so that a pose is certain after it only if it has no rival at all.
    """

    name: str
    applies: Callable[[Search, bool], bool]
    propose: Callable[[Search], list[Proposal]]
    sees_few: bool = False


# With one submap there is nothing to choose. If few trees are seen, a correlation has too few pairs to count, and the
# next levels follow: quads still have a shape.
_ONLY: Final = Level("the only submap", lambda s, _: s.is_single, lambda s: s.propose_by_correlation())
# Where trees repeat their pattern, the best pose has rivals in its own submap, and those in others are looked for, too.
_RAREST: Final = Level(
    "rarest quads",
    lambda s, _: not s.is_single and len(s.query.features.tessellation.quads) >= EXTENT.many,
    lambda s: s.propose_by_quads(EXTENT.rarest, max(s.limit, EXTENT.few), least=2),
    sees_few=True,
)
_RARE: Final = Level(
    "rare quads",
    lambda s, lost: lost or not s.is_single,
    lambda s: s.propose_by_quads(EXTENT.rare, max(s.limit, EXTENT.few)),
)
# A pose that beats chance is compared with its rivals, which tight lengths find.
_ALL: Final = Level(
    "all quads",
    lambda s, lost: s.quads is not None and not lost,
    lambda s: s.propose_by_quads(1.0, s.query.config.candidates),
)
LEVELS: Final[Mapping[Effort, Sequence[Level]]] = {
    "fast": (
        _ONLY,
        _RAREST,
        _RARE,
        _ALL,
        # A pose that beats chance is compared with the same rivals as in a full search.
        Level(
            "polygons",
            lambda s, lost: s.quads is not None and not lost,
            lambda s: propose_by_polygons(s.query, s.index),
        ),
        Level("loose quads", lambda _, lost: lost, lambda s: s.propose_by_loose_quads(fast_choice(s))),
    ),
    "full": (
        _ONLY,
        _RAREST,
        _RARE,
        _ALL,
        # In a small collection, correlation tries every submap at every rotation, and needs no quads to choose them.
        Level(
            "loose quads",
            lambda s, lost: lost and not is_small(s.index),
            lambda s: s.propose_by_loose_quads(QuadChoice(1.0, s.query.config.candidates)),
        ),
        Level("polygons", lambda s, _: s.quads is not None, lambda s: propose_by_polygons(s.query, s.index)),
        # Correlation tries too few submaps of a large collection to be worth its time.
        Level(
            "looser quads",
            lambda s, lost: lost and is_large(s.index),
            lambda s: s.propose_by_loose_quads(looser_choice(s), QUADS.looser),
        ),
        Level(
            "correlation",
            lambda s, lost: lost and not s.is_single and not is_large(s.index),
            lambda s: s.propose_by_correlation(),
        ),
    ),
}
"""The levels of each effort, the cheapest first."""


def propose_on(
    index: CollectionIndex,
    query: Query,
    limit: int,
    is_lost: Callable[[], bool],
    levels: Sequence[Level],
) -> Iterator[tuple[Level, list[Proposal]]]:
    """Each level with its proposals for a query in one index. A level starts when its proposals are requested.

    Args:
        limit: most candidates in the answer.
        is_lost: returns whether no proposal so far, of this index or of others, beats chance.
        levels: the levels to go through, the cheapest first.

    Raises:
        Abandoned: nobody waits for the answer any more.
    """
    # A correlation does not reach the ends of a submap that is much larger than the query.
    single = (
        len(index) == 1 and index.config.survey > 0 and covers_ends(query.grid, query.submaps.grid(next(iter(index))))
    )
    with BUFFERS.borrow() as buffer:
        search = Search(query, index, limit, buffer, single)
        for level in levels:
            if level.applies(search, is_lost()):
                yield level, level.propose(search)
    if levels[-1].name == "correlation" and is_lost() and is_large(index):
        query.trace.skip("exhaustive")
