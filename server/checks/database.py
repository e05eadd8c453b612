"""Check that the database agrees with itself. Read-only: derived data are rebuilt and compared."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import urquhart
from server.store.codec import digest, unpack_attributes, unpack_diameters, unpack_ids, unpack_positions
from server.store.records import CollectionRecord
from server.store.schema_version import expected_revision
from server.store.sqlite.database import Database
from server.store.sqlite.file_checks import broken_invariants, file_faults
from server.store.sqlite.upgrade import migrations_runner
from server.store.storage import ReadTransaction
from server.store.submap_records import SubmapWhole
from urquhart import Config, ConfigError, Features, FeaturesError, LandmarkError


@dataclass(frozen=True, slots=True)
class Discrepancy:
    """Something that does not agree: where (a collection, a submap in it, or "" for the file), and what."""

    where: str
    what: str


def discrepancies(database: Database) -> Iterator[Discrepancy]:
    """Everything that does not agree: file and schema, then, in one read view, counts, revisions and features.

    Nothing is changed. Features are unpacked and compared with those rebuilt from the stored landmarks and diameters.
    Raises StorageError if the file cannot be read at all, DatabaseTooNew, NotADatabase.
    """
    revision, expected = migrations_runner.current_revision(database), expected_revision()
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
        broken = True
        yield Discrepancy("", f"the schema differs from what this version needs: {difference}")
    if broken:
        return  # what follows relies on the rules of the tables
    with database.read_connection() as connection:
        for where, what in broken_invariants(connection):
            yield Discrepancy(where, what)
    with database.read() as tx:
        for collection in tx.collections.all():
            yield from _collection(tx, collection)


def file_discrepancies(database: Database, *, quick: bool = False) -> Iterator[Discrepancy]:
    """What SQLite itself finds wrong: pages, types and rules of rows, references to rows that are not there.

    `quick` leaves out whether indexes agree with their tables. Raises StorageError.
    """
    with database.read_connection() as connection:
        for fault in file_faults(connection, quick=quick):
            yield Discrepancy("", fault)


def _collection(tx: ReadTransaction, collection: CollectionRecord) -> Iterator[Discrepancy]:
    try:
        config = Config.from_dict(collection.config)
    except ConfigError as error:
        yield Discrepancy(collection.id, f"the configuration cannot be used: {error}")
        return
    if config.fingerprint() != collection.fingerprint:
        yield Discrepancy(
            collection.id, f"the fingerprint is {collection.fingerprint}, the configuration's is {config.fingerprint()}"
        )
    yield from _totals(tx, collection)
    for row in tx.submaps(collection.key).every(SubmapWhole):
        where = f"{collection.id}/{row.id}"
        if row.revision > collection.revision:
            yield Discrepancy(where, f"revision {row.revision} is beyond the collection's {collection.revision}")
        if digest(row.landmarks) != row.landmarks_hash:
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


def _totals(tx: ReadTransaction, collection: CollectionRecord) -> Iterator[Discrepancy]:
    counted = tx.submaps(collection.key).totals()
    kept = (collection.submap_count, collection.landmark_count, collection.polygon_count)
    for name, there, said in zip(("submaps", "landmarks", "polygons"), counted, kept, strict=True):
        if there != said:
            yield Discrepancy(collection.id, f"holds {there} {name}, its row says {said}")
    indexed = tx.features(collection.key)
    if indexed.deleted_and_there():
        yield Discrepancy(collection.id, "submaps are noted as deleted that are there")
    last_deletion = indexed.last_deletion()
    if last_deletion > collection.revision:
        yield Discrepancy(collection.id, f"a deletion is of revision {last_deletion}, after {collection.revision}")
    last_query = tx.queries(collection.key).last_number()
    if last_query > collection.query_sequence:
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
