"""Check that index and database agree: the list of segments, their files, and the rows. Read-only, in one read view."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from server.checks.database import Discrepancy
from server.index.index_folder import IndexFolder
from server.index.live_index import assemble
from server.index.row_decoding import config_of
from server.store.records import CollectionRecord, SegmentRecord, trusted
from server.store.storage import ReadTransaction, Storage
from urquhart.index.segment import Segment
from urquhart.index.segment_file import SegmentDamaged


def index_discrepancies(database: Storage) -> Iterator[Discrepancy]:
    """Everything that is wrong with the segments: gaps, damaged or missing files, submaps that are missing or should
    not be there.

    None of it makes an answer wrong, because a segment that cannot be used is rebuilt. Raises StorageError.
    """
    folder = IndexFolder(database)
    with database.read() as tx:
        ids = [collection_id for _, collection_id, _ in tx.collections.revisions()]
    for collection_id in ids:
        for what in _current(database, folder, collection_id):
            yield Discrepancy(collection_id, what)


def _current(database: Storage, folder: IndexFolder, collection_id: str) -> list[str]:
    """What is wrong with the segments of a collection, in one read view.

    A running service may merge segments and remove their files after the read view was opened. If a segment with a
    fault is no longer listed, another read view is opened.
    """
    while True:
        with database.read() as tx:
            collection = tx.collections.get(collection_id)
            if collection is None:
                return []
            chain = tx.segments(collection.key).chain()
            wrong = list(_collection(tx, folder, collection))
        if not wrong:
            return wrong
        with database.read() as tx:
            listed = set(tx.segments(collection.key).chain())
        if set(chain) <= listed:
            return wrong


def _collection(tx: ReadTransaction, folder: IndexFolder, collection: CollectionRecord) -> Iterator[str]:
    config, described = config_of(collection), tx.features(collection.key)
    chain = tx.segments(collection.key).chain()
    if trusted(chain) < len(chain):
        yield f"the segments leave a gap before {chain[trusted(chain)].name}"
        return
    rows = described.content_revisions(0)
    keys = np.array(sorted(rows), np.int64)
    revisions = np.array([rows[key] for key in keys.tolist()], np.int64)
    segments = []
    for listed in chain:
        try:
            segment = folder.open(listed, collection.key, config)
            if segment.file is not None:
                segment.file.check()
            size = folder.file(listed.name).stat().st_size
        except (SegmentDamaged, OSError) as error:
            yield f"segment {listed.name} cannot be used: {error}"
            return
        if size != listed.size:
            yield f"segment {listed.name} has {size} bytes, {listed.size} are listed"
        yield from _contents(segment, listed, keys, revisions)
        segments.append(segment)
    covered = chain[-1].revision if chain else 0
    gone = np.concatenate([keys[revisions > covered], np.array(described.deleted_since(0), np.int64)])
    living = [part.segment.keys[part.alive > 0] for part in assemble(segments, gone)]
    held = np.concatenate([*living, keys[revisions > covered]])
    yield from _difference("the index", held, keys)
    if len(np.unique(held)) < len(held):
        yield "a submap lives in two segments"
    if len(keys) != collection.submap_count:
        yield f"the index holds {len(keys)} submaps of {collection.submap_count}"


def _contents(
    segment: Segment, listed: SegmentRecord, keys: NDArray[np.int64], revisions: NDArray[np.int64]
) -> Iterator[str]:
    """Whether a segment contains what it is listed for, and besides only submaps that were changed or deleted since."""
    expected = keys[(revisions > listed.since) & (revisions <= listed.revision)]
    changed = keys[revisions > listed.revision]
    held = segment.keys[~np.isin(segment.keys, changed) & np.isin(segment.keys, keys)]
    yield from _difference(f"segment {listed.name}", held, expected)


def _difference(what: str, held: NDArray[np.int64], expected: NDArray[np.int64]) -> Iterator[str]:
    lacking, beyond = np.setdiff1d(expected, held), np.setdiff1d(held, expected)
    if len(lacking):
        yield f"{what} lacks {len(lacking)} submaps, the first of key {lacking[0]}"
    if len(beyond):
        yield f"{what} holds {len(beyond)} submaps that it should not, the first of key {beyond[0]}"
