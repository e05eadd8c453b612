"""Constraints of some submaps, found at once: for commands, where no job stores progress."""

from collections.abc import Callable, Sequence

from server.constraints.extraction import Found, agree, from_look, question
from server.queries.lookup import QueryContext, look_up
from server.schemas.constraints import ConstraintsInput
from server.store.submap_records import SubmapMetadata


def search_constraints(
    context: QueryContext,
    collection_id: str,
    rows: Sequence[SubmapMetadata],
    body: ConstraintsInput,
    advance: Callable[[], None],
) -> tuple[list[Found], int]:
    """One constraint for each pair of submaps that match, and the number of pairs that contradict themselves.

    `rows` are looked up in all submaps of the collection; `advance` is called after each. Raises NotFound and
    StorageError.
    """
    found: list[Found] = []
    for row in rows:
        look = look_up(context, collection_id, question(row, body, context.limits.candidates))
        found += from_look(row, look, body)
        advance()
    return agree(found)
