"""Check that the derived columns of each submap (entity tag, footprint, ids) agree with its content."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from server.checks.database import Discrepancy
from server.schemas.common import check_id
from server.schemas.poses import PlacedPose
from server.store.codec import unpack_positions
from server.store.storage import Storage
from server.store.submap_records import Place, SubmapContent
from server.submaps.preparation import place_from, row_etag

_FOOTPRINT: Final = ("map_min_x", "map_min_y", "map_max_x", "map_max_y")


def content_discrepancies(database: Storage) -> Iterator[Discrepancy]:
    """All submaps whose derived columns do not agree with their content. Raises StorageError."""
    with database.read() as tx:
        for collection in tx.collections.all():
            if not _is_id(collection.id):
                yield Discrepancy(collection.id, "its id is none that a collection can have")
            for row in tx.submaps(collection.key).every(SubmapContent):
                for what in _submap(row):
                    yield Discrepancy(f"{collection.id}/{row.id}", what)


def _submap(row: SubmapContent) -> Iterator[str]:
    if not _is_id(row.id):
        yield "its id is none that a submap can have"
    place = row.place
    if place is not None:
        yield from _footprint(row, place)
    etag = row_etag(row, place, row.properties)
    if etag != row.etag:
        yield f"the entity tag is {row.etag}, its content's is {etag}"


def _footprint(row: SubmapContent, place: Place) -> Iterator[str]:
    try:
        pose = PlacedPose(
            frame_id=place.map_frame_id,
            x=place.map_x,
            y=place.map_y,
            yaw=place.map_yaw,
            covariance=place.map_covariance,
        )
    except ValueError as error:
        yield f"the map pose cannot be used: {' '.join(str(error).split())}"
        return
    made = place_from(pose, unpack_positions(row.landmarks))
    kept, expected = ([getattr(of, name) for name in _FOOTPRINT] for of in (place, made))
    if not np.allclose(kept, expected, rtol=1e-9, atol=1e-6):
        yield f"the footprint is {kept}, that of its landmarks is {expected}"


def _is_id(value: str) -> bool:
    try:
        check_id(value)
    except ValueError:
        return False
    return True
