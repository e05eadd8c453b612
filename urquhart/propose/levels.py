"""The levels of a search in the order of their cost, and when each is worth its time."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from urquhart.index.collection_index import CollectionIndex
from urquhart.propose.by_correlation import is_large, is_small, propose_by_correlation
from urquhart.propose.by_polygons import propose_by_polygons
from urquhart.propose.by_quads import QUADS, propose_by_quads, search_quads
from urquhart.propose.correlation import covers_ends
from urquhart.propose.hit_buffer import BUFFERS, HitBuffer
from urquhart.propose.quad_consensus import QuadConsensus
from urquhart.propose.query import Proposal, Query


class LevelNumbers(NamedTuple):
    """How far the first look of a level goes. Chosen by hand, not fitted; `make bench-levels` shows what each level
    adds."""

    rare: float = 0.5
    """Share of a query's quads, the rarest, that settles most queries."""
    few: int = 4
    """Submaps, at least, that are verified after a search for the rarest quads."""
    loose_rare: float = 0.7
    """Share of a query's loosely measured quads, the rarest, that settles most of the queries that are left."""


EFFORT: Final = LevelNumbers()


@dataclass(slots=True, eq=False)
class Search:
    """One search of one index for a query, with what its levels share.

    Attributes:
        limit: submaps that the answer is to name, where there are so many.
        is_single: whether there is nothing to choose from: one submap, which a correlation covers to its ends.
        quads, loose_quads: searches for quads with tight and with loose lengths, once a level began them.
    """

    query: Query
    index: CollectionIndex
    limit: int
    buffer: HitBuffer
    is_single: bool
    quads: QuadConsensus | None = None
    loose_quads: QuadConsensus | None = None

    def propose_by_quads(self, share: float, count: int) -> list[Proposal]:
        """Go on with tight lengths until `share` of the query's quads have been looked for."""
        self.quads = self.quads or search_quads(self.query, self.index, QUADS.tight, self.buffer)
        return propose_by_quads(self.query, self.index, self.quads, share, count)

    def propose_by_loose_quads(self, share: float) -> list[Proposal]:
        """Go on with loose lengths until `share` of the query's quads have been looked for."""
        self.loose_quads = self.loose_quads or search_quads(self.query, self.index, QUADS.loose, self.buffer)
        return propose_by_quads(self.query, self.index, self.loose_quads, share, self.query.config.candidates)

    def propose_by_correlation(self) -> list[Proposal]:
        """Turn and shift the query over the submaps as a whole."""
        return propose_by_correlation(self.query, self.index, self.loose_quads)


class Level(NamedTuple):
    """One level of a search.

    Attributes:
        name: for readers.
        applies: whether the level is worth its time, by the search so far and by whether the query is lost: whether no
            proposal so far is better than chance.
        propose: the level's proposals.
    """

    name: str
    applies: Callable[[Search, bool], bool]
    propose: Callable[[Search], list[Proposal]]


LEVELS: Final = (
    # A single submap needs no choice. A correlation counts pairs, though: of a handful of trees there are too few,
    # while quads still know their shape.
    Level("the only submap", lambda s, _: s.is_single and not is_large(s.index), lambda s: s.propose_by_correlation()),
    Level(
        "rare quads",
        lambda s, lost: lost or not s.is_single,
        lambda s: s.propose_by_quads(EFFORT.rare, max(s.limit, EFFORT.few)),
    ),
    Level("all quads", lambda s, _: s.quads is not None, lambda s: s.propose_by_quads(1.0, s.query.config.candidates)),
    Level("polygons", lambda s, _: s.quads is not None, lambda s: propose_by_polygons(s.query, s.index)),
    # In a small collection every submap is tried under every rotation, which needs no choice of rotations by quads.
    Level(
        "rare loose quads",
        lambda s, lost: lost and not is_small(s.index),
        lambda s: s.propose_by_loose_quads(EFFORT.loose_rare),
    ),
    Level("all loose quads", lambda s, _: s.loose_quads is not None, lambda s: s.propose_by_loose_quads(1.0)),
    Level(
        "correlation",
        lambda s, lost: lost and not s.is_single and not is_large(s.index),
        lambda s: s.propose_by_correlation(),
    ),
)
"""The levels, the cheapest first."""


def propose_on(
    index: CollectionIndex,
    query: Query,
    limit: int,
    is_lost: Callable[[], bool],
    levels: Sequence[Level] = LEVELS,
) -> Iterator[list[Proposal]]:
    """What each level proposes for a query in one index; a level begins when its proposals are asked for.

    Args:
        limit: submaps that the answer is to name, where there are so many.
        is_lost: whether no proposal so far, of this index or of others, is better than chance.
        levels: the levels to go through, the cheapest first.

    Raises:
        Abandoned: nobody waits for the answer any more.
    """
    # A correlation leaves out the ends of a submap that is much larger than the query.
    single = len(index) == 1 and covers_ends(query.grid, query.submaps.grid(next(iter(index))))
    with BUFFERS.borrow() as buffer:
        search = Search(query, index, limit, buffer, single)
        for level in levels:
            if level.applies(search, is_lost()):
                yield level.propose(search)
    if is_lost() and is_large(index):
        query.trace.skip("exhaustive")
