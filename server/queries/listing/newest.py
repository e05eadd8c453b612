"""Stored queries of a collection, the newest first."""

from typing import Final

from server.collections.crud import get_collection
from server.config.settings import Limits
from server.queries.stored_queries import stored_answers
from server.resources.paging import PageRequest, page_size, read_cursor, write_cursor
from server.schemas.common import write_stamp
from server.schemas.listings.queries import QueryPage, StoredQuery
from server.schemas.queries import QueryAnswer
from server.store.storage import Storage
from urquhart import Verdict

_LOOKED_AT: Final = 1000
"""Most answers that are read for one page, in which a verdict may be rare. The page then ends early, with `next`."""


def newest_queries(
    database: Storage, limits: Limits, collection_id: str, asked: PageRequest, verdict: Verdict | None
) -> QueryPage:
    """A page of stored queries, of all or of one verdict. Raises NotFound and InvalidField."""
    size = page_size(asked.limit, limits)
    cursor = read_cursor("queries", asked.cursor)
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        queries = tx.queries(collection.key)
        before = cursor or queries.last_number() + 1
        found: list[QueryAnswer] = []
        lowest = max(1, before - _LOOKED_AT)
        while len(found) < size and before > lowest:
            # Numbers are without gaps, because only the oldest queries are deleted.
            begin = max(lowest, before - size)
            stretch = stored_answers(tx, collection, after=begin - 1, limit=before - begin)
            chosen = [one for one in reversed(stretch) if verdict is None or one.verdict == verdict]
            found += chosen[: size - len(found)]
            before = int(found[-1].id or 1) if len(found) == size else begin
        created = queries.created([int(one.id or 0) for one in found])
        more = before > queries.first_number() > 0
    entries = [_entry(one, write_stamp(created[int(one.id or 0)])) for one in found]
    return QueryPage(queries=entries, next=write_cursor("queries", before) if more else None)


def _entry(answer: QueryAnswer, created: str) -> StoredQuery:
    best = answer.candidates[0] if answer.candidates else None
    return StoredQuery(
        id=answer.id or "",
        created=created,
        verdict=answer.verdict,
        reason=answer.reason,
        landmark_count=answer.landmark_count,
        revision=answer.revision,
        milliseconds=round(sum(stage.milliseconds for stage in answer.stages), 3),
        submap_id=best.submap_id if best is not None else None,
        inlier_count=best.inlier_count if best is not None else None,
        confidence=best.confidence if best is not None else None,
        links=answer.links,
    )
