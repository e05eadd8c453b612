"""Which submaps a map is built from, and what is read of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from server.collections.crud import get_collection
from server.constraints.extraction import chosen_submaps
from server.errors import InvalidField
from server.schemas.maps.request import MapInput
from server.store.codec import unpack_attributes, unpack_diameters, unpack_positions
from server.store.storage import ReadTransaction
from server.store.submap_records import Place, SubmapContent, SubmapMetadata
from urquhart.mapping.landmark_map import MappedSubmap


@dataclass(frozen=True, slots=True)
class ChosenSubmap:
    """A submap of a map.

    Attributes:
        content_revision: of the collection, when its landmarks were stored.
        place: its stored pose; None if it has none.
        mapped: its landmarks.
    """

    key: int
    id: str
    session: str | None
    content_revision: int
    place: Place | None
    mapped: MappedSubmap


def choose(tx: ReadTransaction, collection_id: str, body: MapInput) -> list[ChosenSubmap]:
    """The submaps of a map, in the order they were stored. Raises NotFound and InvalidField."""
    keys = chosen_keys(tx, collection_id, body)
    collection = get_collection(tx, collection_id)
    rows = tx.submaps(collection.key).some(keys, SubmapContent)
    return [_chosen(row) for row in sorted(rows, key=lambda row: row.key)]


def chosen_keys(tx: ReadTransaction, collection_id: str, body: MapInput) -> list[int]:
    """The keys of the submaps of a map, in order. Raises NotFound and InvalidField."""
    collection = get_collection(tx, collection_id)
    submaps = tx.submaps(collection.key)
    keys = submaps.matching(chosen_submaps(body))
    if body.submap_ids is not None:
        named = submaps.keys(body.submap_ids)
        for number, name in enumerate(body.submap_ids):
            if name not in named:
                raise InvalidField(f"there is no submap {name!r}", code="not_found", pointer=f"/submap_ids/{number}")
        keys &= set(named.values())
    if body.sessions is not None:
        wanted = set(body.sessions)
        rows = submaps.some(sorted(keys), SubmapMetadata)
        known = {row.session for row in rows}
        for number, session in enumerate(body.sessions):
            if session not in known:
                raise InvalidField(
                    f"none of the chosen submaps is of the session {session!r}",
                    code="not_found",
                    pointer=f"/sessions/{number}",
                )
        keys = {row.key for row in rows if row.session in wanted}
    return sorted(keys)


def names_of(tx: ReadTransaction, collection_key: int, keys: Sequence[int]) -> list[str]:
    """The ids of submaps by key, in order."""
    return [row.id for row in tx.submaps(collection_key).some(keys, SubmapMetadata)]


def numbers_of(chosen: Sequence[ChosenSubmap], body: MapInput) -> dict[str, int]:
    """The number of each submap by its id. Raises InvalidField for odometry between submaps that were not chosen."""
    numbers = {one.id: number for number, one in enumerate(chosen)}
    for number, edge in enumerate(body.odometry):
        for end, name in (("from", edge.from_), ("to", edge.to)):
            if name not in numbers:
                raise InvalidField(
                    f"{name!r} is none of the {len(chosen)} submaps of this map",
                    code="not_found",
                    pointer=f"/odometry/{number}/{end}",
                )
    return numbers


def _chosen(row: SubmapContent) -> ChosenSubmap:
    heights = unpack_attributes(row.attributes).get("height_m")
    diameters = unpack_diameters(row.attributes)
    mapped = MappedSubmap(
        unpack_positions(row.landmarks),
        None if diameters is None else 100.0 * diameters,
        None if heights is None else np.array(heights, np.float64),
        None if row.stamp is None else row.stamp.timestamp(),
    )
    return ChosenSubmap(row.key, row.id, row.session, row.content_revision, row.place, mapped)
