"""Rows of a page of submaps: as many as requested, and as fit into its bytes."""

from typing import Final, TypeVar

import orjson

from server.collections.crud import get_collection
from server.config.settings import Limits
from server.resources.paging import PageRequest, page_size, read_cursor, write_cursor
from server.store.records import CollectionRecord
from server.store.storage import Storage
from server.store.submap_records import SubmapContent, SubmapFilter, SubmapMetadata

_K = TypeVar("_K", bound=SubmapMetadata)
_ROWS: Final = 50
"""Rows that are read at once if landmarks are read, too."""
_SUMMARY: Final = 700
"""Approximate bytes of a submap in a page, without its properties."""


def rows_of_page(
    database: Storage,
    limits: Limits,
    collection_id: str,
    chosen: SubmapFilter,
    asked: PageRequest,
    kind: type[_K],
) -> tuple[CollectionRecord, list[_K], str | None]:
    """The collection, the rows of the page in the order they were stored, and the cursor of the next page if there is
    one.

    The page ends at `limits.page_bytes`, but has at least one row. Landmarks count if the records of `kind` have them.

    Raises NotFound and InvalidField.
    """
    size = page_size(asked.limit, limits)
    after = read_cursor("submaps", asked.cursor)
    rows: list[_K] = []
    left = limits.page_bytes
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        submaps = tx.submaps(collection.key)
        while len(rows) < size:
            most = min(size - len(rows), _ROWS if issubclass(kind, SubmapContent) else size)
            piece = submaps.page(chosen, kind, after_key=after, limit=most + 1)
            for row in piece[:most]:
                left -= _weight(row)
                if left < 0 and rows:
                    return collection, rows, write_cursor("submaps", rows[-1].key)
                rows.append(row)
            if len(piece) <= most:
                return collection, rows, None
            after = rows[-1].key
    return collection, rows, write_cursor("submaps", rows[-1].key)


def _weight(row: SubmapMetadata) -> int:
    landmarks = len(row.landmarks) if isinstance(row, SubmapContent) else 0
    return _SUMMARY + len(orjson.dumps(row.properties)) + landmarks
