"""What the database holds of a session: its submaps and the constraints between them, read little by little."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from server.collections.crud import get_collection
from server.constraints.extraction import search_of
from server.errors import NotFound
from server.maps.building import constraint_of
from server.schemas.maps.request import MapInput
from server.store.records import SessionMember
from server.store.repositories.maps.constraint_records import ConstraintFilter
from server.store.storage import ReadTransaction
from urquhart.mapping.pose_graph import PoseConstraints


class SessionEdge(NamedTuple):
    """A constraint of a session: its key, its kind, and the ids of its submaps."""

    key: int
    kind: str
    from_id: str
    to_id: str


@dataclass(frozen=True, slots=True, eq=False)
class SessionRows:
    """The rows of a session.

    Attributes:
        revision: of the collection.
        members: its submaps, in the order they were stored.
        newest: the largest key of all submaps of the collection.
        extent: the number of constraints of the collection, and the largest key of them.
        edges: the constraints between its submaps that are not stale, in the order they were stored.
        constraints: the same between the numbers of the submaps.
    """

    revision: int
    members: Sequence[SessionMember]
    newest: int
    extent: tuple[int, int]
    edges: Sequence[SessionEdge]
    constraints: PoseConstraints

    def continues(self, other: "SessionRows") -> bool:
        """Whether these are the rows of `other`, and later ones."""
        same = self.members[: len(other.members)] == other.members
        return same and self.edges[: len(other.edges)] == other.edges


def read_members(tx: ReadTransaction, collection_id: str, session: str) -> list[SessionMember]:
    """The submaps of a session, in the order they were stored. Raises NotFound."""
    members = tx.sessions(get_collection(tx, collection_id).key).members(session)
    if not members:
        raise NotFound("session", session)
    return members


def read_rows(tx: ReadTransaction, collection_id: str, session: str, known: SessionRows | None) -> SessionRows:
    """The rows of a session. Of those that are known only what came later is read, unless others were deleted or
    changed.

    Matches are those of searches with the default gates, as maps use them. Raises NotFound.
    """
    collection = get_collection(tx, collection_id)
    sessions, constraints = tx.sessions(collection.key), tx.constraints(collection.key)
    members = read_members(tx, collection_id, session)
    newest, extent = sessions.last_key(), constraints.extent()
    after = 0
    if known is not None and _only_more(known, members, extent[0] - constraints.extent(known.extent[1])[0]):
        after = known.extent[1]
    chosen = ConstraintFilter(search=search_of(MapInput()), session=session)
    found = [one for one in constraints.page(chosen, after_key=after) if not one.stale] if after < extent[1] else []
    numbers = {one.id: number for number, one in enumerate(members)}
    edges = [SessionEdge(one.key, one.kind, one.from_id, one.to_id) for one in found]
    graph = PoseConstraints.of([constraint_of(one, numbers) for one in found])
    if after and known is not None:
        edges, graph = [*known.edges, *edges], known.constraints.with_more(graph)
    return SessionRows(collection.revision, members, newest, extent, edges, graph)


def _only_more(known: SessionRows, members: Sequence[SessionMember], kept: int) -> bool:
    """Whether submaps and constraints were only added. `kept`: constraints of the collection that are not later ones.

    A submap that was stored earlier and came into the session since may have constraints that were read over.
    """
    later = members[len(known.members) :]
    return (
        members[: len(known.members)] == known.members
        and all(one.key > known.newest for one in later)
        and kept == known.extent[0]
    )
