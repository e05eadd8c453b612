"""Check that the database agrees with itself. Read-only: derived data are rebuilt and compared."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from sqlalchemy import func, select
from sqlalchemy.orm import Session

import urquhart
from server.checks.row_invariants import row_violations
from server.store import migrations_runner
from server.store.codec import digest, unpack_attributes, unpack_diameters, unpack_ids, unpack_positions
from server.store.sqlite.database import Database
from server.store.tables import CollectionRow, DeletionRow, QueryRow, SubmapRow
from urquhart import Config, ConfigError, Features, FeaturesError, LandmarkError

_BATCH = 200


@dataclass(frozen=True, slots=True)
class Discrepancy:
    """Something that does not agree: where (a collection, a submap in it, or "" for the file), and what."""

    where: str
    what: str


def discrepancies(database: Database) -> Iterator[Discrepancy]:
    """Everything that does not agree, in one snapshot: file, schema, counts, revisions, features. Nothing is changed.

    Features are unpacked and compared with those rebuilt from the stored landmarks and diameters. Raises StorageError
    if the file cannot be read at all, DatabaseTooNew, NotADatabase.
    """
    revision, expected = migrations_runner.current_revision(database), migrations_runner.expected_revision()
    if revision != expected:
        yield Discrepancy("", f"the schema is {revision}, this version needs {expected}; run `urquhart db upgrade`")
        return
    broken = False
    for finding in file_discrepancies(database):
        broken = True
        yield finding
    if broken:
        return  # what follows would read the damaged pages
    for difference in migrations_runner.drift(database):
        yield Discrepancy("", f"the schema differs from what this version needs: {difference}")
    with database.read() as session:
        unreadable = False
        for impossible in row_violations(session):
            unreadable = unreadable or impossible.unreadable
            yield Discrepancy(impossible.where, impossible.what)
        if unreadable:
            return  # what follows would fail on them
        for collection in session.scalars(select(CollectionRow).order_by(CollectionRow.key)).all():
            yield from _collection(session, collection)


def file_discrepancies(database: Database, *, quick: bool = False) -> Iterator[Discrepancy]:
    """What SQLite itself finds wrong with the file. `quick` skips the comparison of indexes with their tables.

    Raises StorageError.
    """
    check = "PRAGMA quick_check" if quick else "PRAGMA integrity_check"
    with database.read() as session:
        connection, broken = session.connection(), False
        for (line,) in connection.exec_driver_sql(check).all():
            if line != "ok":
                broken = True
                yield Discrepancy("", f"integrity check: {line}")
        if broken:
            return
        for table, row, parent, _ in connection.exec_driver_sql("PRAGMA foreign_key_check").all():
            yield Discrepancy("", f"row {row} of {table} belongs to a row of {parent} that is not there")


def _collection(session: Session, collection: CollectionRow) -> Iterator[Discrepancy]:
    try:
        config = Config.from_dict(collection.config)
    except ConfigError as error:
        yield Discrepancy(collection.id, f"the configuration cannot be used: {error}")
        return
    if config.fingerprint() != collection.fingerprint:
        yield Discrepancy(
            collection.id, f"the fingerprint is {collection.fingerprint}, the configuration's is {config.fingerprint()}"
        )
    yield from _totals(session, collection)
    rows = select(
        SubmapRow.id,
        SubmapRow.landmark_count,
        SubmapRow.polygon_count,
        SubmapRow.counts,
        SubmapRow.landmarks_hash,
        SubmapRow.landmarks,
        SubmapRow.landmark_ids,
        SubmapRow.attributes,
        SubmapRow.features,
        SubmapRow.revision,
        SubmapRow.content_revision,
    ).where(SubmapRow.collection_key == collection.key)
    for row in session.execute(rows.execution_options(yield_per=_BATCH)):
        where = f"{collection.id}/{row.id}"
        if not 0 < row.content_revision <= row.revision <= collection.revision:
            yield Discrepancy(
                where,
                f"revisions {row.content_revision}, {row.revision} do not fit the collection's {collection.revision}",
            )
        if len(row.landmarks) != 16 * row.landmark_count or digest(row.landmarks) != row.landmarks_hash:
            yield Discrepancy(where, "the landmarks are not those that were stored")
            continue
        try:
            ids = unpack_ids(row.landmark_ids, row.landmark_count)
            lists = [ids, *unpack_attributes(row.attributes).values()]
            counted = all(isinstance(values, list) and len(values) == row.landmark_count for values in lists)
            unpack_diameters(row.attributes)
        except (ValueError, TypeError, OverflowError) as error:
            yield Discrepancy(where, f"ids or attributes cannot be read: {error}")
            continue
        if not counted or len(set(ids)) < len(ids):
            yield Discrepancy(where, "ids or attributes are not one for each landmark")
            continue
        for what in _features(row.features, row.landmarks, row.attributes, row.counts, row.polygon_count, config):
            yield Discrepancy(where, what)


def _totals(session: Session, collection: CollectionRow) -> Iterator[Discrepancy]:
    counted = session.execute(
        select(
            func.count(),
            func.coalesce(func.sum(SubmapRow.landmark_count), 0),
            func.coalesce(func.sum(SubmapRow.polygon_count), 0),
        ).where(SubmapRow.collection_key == collection.key)
    ).one()
    kept = (collection.submap_count, collection.landmark_count, collection.polygon_count)
    for name, there, said in zip(("submaps", "landmarks", "polygons"), counted, kept, strict=True):
        if there != said:
            yield Discrepancy(collection.id, f"holds {there} {name}, its row says {said}")
    ghosts = select(func.count()).where(
        DeletionRow.collection_key == collection.key, DeletionRow.submap_key.in_(select(SubmapRow.key))
    )
    if session.scalar(ghosts):
        yield Discrepancy(collection.id, "submaps are noted as deleted that are there")
    last_deletion = session.scalar(
        select(func.max(DeletionRow.revision)).where(DeletionRow.collection_key == collection.key)
    )
    if (last_deletion or 0) > collection.revision:
        yield Discrepancy(collection.id, f"a deletion is of revision {last_deletion}, after {collection.revision}")
    last_query = session.scalar(select(func.max(QueryRow.number)).where(QueryRow.collection_key == collection.key))
    if (last_query or 0) > collection.query_sequence:
        yield Discrepancy(
            collection.id, f"query {last_query} is stored, but the last number is {collection.query_sequence}"
        )


def _features(
    blob: bytes, landmarks: bytes, attributes: bytes | None, counts: dict[str, int], polygons: int, config: Config
) -> Iterator[str]:
    try:
        stored = Features.unpack(blob)
    except FeaturesError as error:
        yield f"the features cannot be unpacked: {error}"
        return
    try:
        made = urquhart.describe(unpack_positions(landmarks), config, unpack_diameters(attributes))
    except LandmarkError as error:
        yield f"the landmarks cannot be described: {error}"
        return
    if stored.fingerprint != made.fingerprint:
        yield f"the features have fingerprint {stored.fingerprint}, the collection's are {made.fingerprint}"
        return
    if stored.counts() != counts or len(stored.tessellation) != polygons:
        yield f"the features count {stored.counts()}, the row says {counts}"
    same = (
        np.array_equal(stored.landmarks, made.landmarks)
        and np.array_equal(stored.origin, made.origin)
        and np.array_equal(stored.diameters, made.diameters, equal_nan=True)
        and np.array_equal(stored.tessellation.triangles, made.tessellation.triangles)
        and np.array_equal(stored.tessellation.vertices, made.tessellation.vertices)
        and np.array_equal(stored.tessellation.vertex_offsets, made.tessellation.vertex_offsets)
        and np.array_equal(stored.tessellation.members, made.tessellation.members)
        and np.array_equal(stored.tessellation.member_offsets, made.tessellation.member_offsets)
        and np.allclose(stored.density, made.density, rtol=1e-4)
        and stored.descriptors.shape == made.descriptors.shape
        and np.allclose(stored.descriptors, made.descriptors, rtol=1e-4, atol=1e-4)
    )
    if not same:
        yield "the features are not those of the landmarks"
