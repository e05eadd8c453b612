"""Collections: created, read, changed, deleted."""

from dataclasses import dataclass, replace
from typing import Any

from server.collections.georeference import check_crs
from server.collections.map_frames import check_default_frame, check_frames, must_agree, set_frames
from server.config.settings import Limits
from server.errors import Conflict, InvalidField, NotFound
from server.index.row_decoding import config_of
from server.parsing.field_errors import pointer
from server.resources import links
from server.resources.idempotency import NO_CONTENT, StoredResponse
from server.resources.paging import page_size, read_cursor, write_cursor
from server.resources.preconditions import ANYTHING, Preconditions
from server.schemas.collections import (
    Collection,
    CollectionLinks,
    CollectionPage,
    CollectionPatch,
    CollectionPut,
    CollectionSummary,
    Extent,
    MapFrame,
    SpatialExtent,
    StandCounts,
)
from server.schemas.common import Counts
from server.security.principal import Principal
from server.store.records import DEFAULT_FRAME, CollectionRecord, StandTotals
from server.store.storage import ReadTransaction, Storage, WriteTransaction
from urquhart import Config, ConfigError


@dataclass(frozen=True, slots=True)
class Ensured:
    """A collection that exists now, and whether it was created."""

    collection: Collection
    etag: str
    created: bool


def ensure(
    database: Storage, collection_id: str, body: CollectionPut, preconditions: Preconditions = ANYTHING
) -> Ensured:
    """Create a collection, or check that it agrees with the body.

    Members that the body leaves out are not compared. Raises PreconditionFailed, Conflict if the collection differs in
    a given member, and InvalidField for a configuration or CRS that cannot be used.
    """
    config = checked(body)
    with database.read() as tx:
        row = tx.collections.get(collection_id)
        if row is not None:
            preconditions.check(etag_of(row))
            _must_agree(tx, row, body, config)
            return Ensured(_full(tx, row), etag_of(row), created=False)
    with database.write() as tx:
        return ensure_in(tx, collection_id, body, config, preconditions)


def checked(body: CollectionPut | CollectionPatch) -> Config:
    """The configuration in a body, whose CRSs are checked. Raises InvalidField."""
    if body.crs is not None:
        check_crs(body.crs)
    check_frames(body.frames)
    return read_config(body.config)


def ensure_in(
    tx: WriteTransaction, collection_id: str, body: CollectionPut, config: Config, preconditions: Preconditions
) -> Ensured:
    """The same as `ensure`, within a write transaction; `config` is the result of `checked`."""
    collections = tx.collections
    row = collections.get(collection_id)
    created = row is None
    preconditions.check(None if row is None else etag_of(row))
    if row is None:
        row = collections.create(
            collection_id,
            title=body.title,
            config=config.to_dict(),
            fingerprint=config.fingerprint(),
            crs=body.crs,
            origin=body.origin,
        )
        set_frames(tx, row, body.frames)
    else:
        _must_agree(tx, row, body, config)
    return Ensured(_full(tx, row), etag_of(row), created)


def read(database: Storage, collection_id: str) -> tuple[Collection, str]:
    """A collection and its entity tag. Raises NotFound."""
    with database.read() as tx:
        row = get_collection(tx, collection_id)
        return _full(tx, row), etag_of(row)


def known_collections(database: Storage) -> list[str]:
    """Ids of all collections, oldest first."""
    with database.read() as tx:
        return tx.collections.ids()


def page(database: Storage, limits: Limits, caller: Principal, limit: int | None, cursor: str | None) -> CollectionPage:
    """A page of the collections that the caller may see, oldest first. Raises InvalidField."""
    size = page_size(limit, limits)
    with database.read() as tx:
        rows = tx.collections.page(caller.patterns, after_key=read_cursor("collections", cursor), limit=size + 1)
        totals = tx.collections.stand_totals(rows[:size])
    more = len(rows) > size
    return CollectionPage(
        collections=[CollectionSummary(**_summary(row, totals[row.key])) for row in rows[:size]],
        next=write_cursor("collections", rows[size - 1].key) if more else None,
    )


def patch(
    database: Storage, collection_id: str, body: CollectionPatch, preconditions: Preconditions = ANYTHING
) -> tuple[Collection, str]:
    """Change title, crs, origin or frames. Raises NotFound, Conflict (the configuration cannot change),
    InvalidField.
    """
    config = checked(body)
    with database.write() as tx:
        changed = patch_in(tx, collection_id, body, config, preconditions)
        return changed.collection, changed.etag


def patch_in(
    tx: WriteTransaction, collection_id: str, body: CollectionPatch, config: Config, preconditions: Preconditions
) -> Ensured:
    """The same as `patch`, within a write transaction; `config` is the result of `checked`."""
    given = body.model_fields_set
    row = get_collection(tx, collection_id)
    preconditions.check(etag_of(row))
    if "config" in given and config != config_of(row):
        raise _other_config(row.id)
    changes: dict[str, Any] = {name: getattr(body, name) for name in ("title", "crs") if name in given}
    if "origin" in given:
        changes["origin_x"], changes["origin_y"] = body.origin or (None, None)
    changed = replace(row, **changes)
    if (changed.crs, changed.origin) != (row.crs, row.origin):
        check_default_frame(tx, changed, "/crs" if "crs" in given else "/origin")
    if set_frames(tx, changed, body.frames) or changed != row:
        collections = tx.collections
        collections.describe(changed)
        collections.advance(row.key)
        changed = get_collection(tx, collection_id)
    return Ensured(_full(tx, changed), etag_of(changed), created=False)


def place_frame(
    database: Storage, collection_id: str, frame_id: str, crs: str, origin: tuple[float, float] | None
) -> None:
    """Say where a map frame is on Earth; `origin`: its origin in the system, metres. Raises NotFound, InvalidField."""
    if frame_id == DEFAULT_FRAME:
        body = CollectionPatch(crs=crs, origin=origin)
    else:
        body = CollectionPatch(frames={frame_id: MapFrame(crs=crs, origin=origin)})
    patch(database, collection_id, body)


def delete(database: Storage, collection_id: str, preconditions: Preconditions = ANYTHING) -> None:
    """Delete a collection with everything in it. Raises NotFound and PreconditionFailed."""
    with database.write() as tx:
        delete_in(tx, collection_id, preconditions)


def delete_in(tx: WriteTransaction, collection_id: str, preconditions: Preconditions) -> StoredResponse:
    """The same as `delete`, within a write transaction. Returns the answer."""
    row = get_collection(tx, collection_id)
    preconditions.check(etag_of(row))
    tx.collections.delete(row.key)
    return NO_CONTENT


def get_collection(tx: ReadTransaction, collection_id: str) -> CollectionRecord:
    """The collection. Raises NotFound."""
    row = tx.collections.get(collection_id)
    if row is None:
        raise NotFound("collection", collection_id)
    return row


def etag_of(row: CollectionRecord) -> str:
    """Entity tag of a collection: every write raises its revision, and no key is used twice.

    The time of the last write is part of it, because a restored database reaches the same revision again.
    """
    return f"{row.key}-{row.revision}-{row.updated.timestamp() * 1e6:.0f}"


def read_config(values: dict[str, Any] | None) -> Config:
    """The method's configuration. Raises InvalidField."""
    try:
        return Config.from_dict(values or {})
    except ConfigError as error:
        raise InvalidField(str(error)[:500], code="config", pointer=pointer(["config", error.parameter])) from error


def _must_agree(tx: ReadTransaction, row: CollectionRecord, body: CollectionPut, config: Config) -> None:
    if body.config is not None and config != config_of(row):
        raise _other_config(row.id)
    for name, wanted, stored in (
        ("title", body.title, row.title),
        ("crs", body.crs, row.crs),
        ("origin", body.origin, row.origin),
    ):
        if wanted is not None and wanted != stored:
            raise Conflict(f"The collection {row.id!r} exists, with another {name}. Change it with PATCH.")
    must_agree(tx, row, body.frames)


def _other_config(collection_id: str) -> Conflict:
    return Conflict(
        f"The collection {collection_id!r} exists, with another configuration, and a configuration cannot be changed. "
        "Use another id, or delete the collection first."
    )


def _summary(row: CollectionRecord, totals: StandTotals) -> dict[str, Any]:
    return {
        "id": row.id,
        "title": row.title,
        "crs": row.crs,
        "origin": row.origin,
        "fingerprint": row.fingerprint,
        "revision": row.revision,
        "counts": Counts(submaps=row.submap_count, landmarks=row.landmark_count, polygons=row.polygon_count),
        "stands": StandCounts(stands=totals.stands, trees=totals.trees),
        "systems": totals.systems,
        "created": row.created,
        "updated": row.updated,
        "links": CollectionLinks(
            self=links.collection(row.id), submaps=links.submaps(row.id), queries=links.queries(row.id)
        ),
    }


def _full(tx: ReadTransaction, row: CollectionRecord) -> Collection:
    collections = tx.collections
    spatial = [
        SpatialExtent(frame_id=extent.frame_id, bbox=(extent.min_x, extent.min_y, extent.max_x, extent.max_y))
        for extent in collections.extents(row.key)
    ]
    return Collection(
        # Reported with the defaults of parameters that the stored configuration does not have.
        **_summary(row, collections.stand_totals([row])[row.key]),
        config=Config().to_dict() | row.config,
        frames={
            frame_id: MapFrame(crs=reference.crs, origin=reference.origin)
            for frame_id, reference in tx.map_frames(row).named().items()
        },
        extent=Extent(spatial=spatial, temporal=collections.interval(row.key)),
    )
