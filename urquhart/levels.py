"""The levels of a search in the order of their cost, and when the next one is worth its time."""

from collections.abc import Iterator
from typing import Final

from urquhart.decide.confidence import against_chance, log_odds
from urquhart.decide.doubt import Standing
from urquhart.decide.ranking import refusal
from urquhart.propose.correlation import sees_ends
from urquhart.propose.proposals import (
    TIGHT,
    WIDE,
    Proposal,
    Sighting,
    is_large,
    is_small,
    propose_by_polygons,
    propose_by_quads,
    propose_by_sweep,
    search_quads,
)
from urquhart.propose.quad_consensus import Room
from urquhart.trace import Stages

_HALF: Final = 0.5
"""Share of a query's quads, the rarest, that mostly settle it,"""
_FIRST: Final = 4
"""and submaps that are verified then at least."""
_MOST: Final = 0.7
"""Share of them that settles most of what is left, where lengths may be off by more."""


def propose_by_level(
    query: Sighting, limit: int, room: Room, stages: Stages, ranked: list[Proposal]
) -> Iterator[list[Proposal]]:
    """What each level proposes, in the order of their cost.

    Args:
        limit: submaps that the answer is to name, where there are so many.
        ranked: the proposals so far, best first; the caller fills it before it asks for the next level.
    """
    index, config, wide = query.index, query.index.config, None
    # Quads and polygons choose among submaps; a single one is swept first, which needs no choice, but for one so much
    # larger than the query that a sweep would leave out its ends.
    alone = len(index) == 1 and sees_ends(query.pattern, query.submaps.pattern(next(iter(index))))
    if alone and not is_large(index):
        yield propose_by_sweep(query, None, stages)
    # A sweep counts pairs: of a handful of trees there are too few, where quads still know their shape.
    if not alone or is_lost(ranked, query):
        tight = search_quads(query, TIGHT, room)
        for share, count in ((_HALF, max(limit, _FIRST)), (1.0, config.candidates)):
            yield propose_by_quads(query, tight, share, count, stages)
        yield propose_by_polygons(query, stages)
    if is_lost(ranked, query) and not is_small(index):
        wide = search_quads(query, WIDE, room)
        for share in (_MOST, 1.0):
            yield propose_by_quads(query, wide, share, config.candidates, stages)
    if is_lost(ranked, query) and is_large(index):
        stages.skip("exhaustive")
    elif is_lost(ranked, query) and not alone:
        yield propose_by_sweep(query, wide, stages)


def is_settled(standing: Standing, query: Sighting) -> bool:
    """Whether the first proposal is so sure that another level could not change the answer."""
    if not standing.ranked or not standing.complete:
        return False
    first, config = standing.ranked[0].verified, query.index.config
    odds = log_odds(first, query.pattern, query.volume)
    return odds > 2.0 * config.gate and refusal(first, odds, standing.lead, config) is None


def is_lost(ranked: list[Proposal], query: Sighting) -> bool:
    """Whether no proposal is better than chance. Too close a rival is another matter: more poses do not mend it."""
    if not ranked:
        return True
    return against_chance(log_odds(ranked[0].verified, query.pattern, query.volume)) < query.index.config.gate
