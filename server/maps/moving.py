"""Poses that a caller has optimised itself, written into many submaps at once: all or none."""

from collections.abc import Sequence

from server.collections.crud import get_collection
from server.collections.georeference import check_place
from server.errors import InvalidField, PreconditionFailed
from server.index.row_decoding import config_of
from server.resources.idempotency import IdempotencyKey, StoredResponse, find_response, store_response
from server.schemas.common import to_json
from server.schemas.maps.answers import PosesAnswer
from server.schemas.maps.request import PoseMove
from server.schemas.submaps import SubmapPatch
from server.store.storage import Storage
from server.store.submap_records import SubmapContent
from server.submaps.preparation import patched
from server.submaps.writes import store


def move_submaps(
    database: Storage, collection_id: str, moves: Sequence[PoseMove], idempotency_key: IdempotencyKey | None
) -> StoredResponse:
    """Write poses in one transaction, under one new revision. Returns the answer.

    Raises NotFound (the collection), InvalidField (a submap that does not exist or comes twice, a pose outside of its
    map's area), PreconditionFailed, KeyReused and StorageError; then nothing is written.
    """
    with database.write() as tx:
        collection = get_collection(tx, collection_id)
        operation = f"postPoses {collection.key}"
        response = find_response(tx, idempotency_key, operation)
        if response is not None:
            return response
        submaps, config = tx.submaps(collection.key), config_of(collection)
        identities = submaps.identities([move.id for move in moves])
        rows = {row.id: row for row in submaps.some([one.key for one in identities.values()], SubmapContent)}
        references = tx.map_frames(collection).some({move.map_pose.frame_id for move in moves if move.map_pose})
        pairs, known = [], set[str]()
        for number, move in enumerate(moves):
            row = rows.get(move.id)
            if row is None or move.id in known:
                fault = "comes twice" if row is not None else "is none of the submaps of this collection"
                code = "repeated" if row is not None else "not_found"
                raise InvalidField(f"{move.id!r} {fault}", code=code, pointer=f"/poses/{number}/id")
            known.add(move.id)
            if move.if_match not in (None, row.etag):
                raise PreconditionFailed(
                    f'if_match of {move.id!r} does not hold: its ETag is now "{row.etag}". No pose was written.',
                    row.etag,
                )
            record = patched(row, SubmapPatch(map_pose=move.map_pose), None, config)
            try:
                check_place(record.place, references.get(record.place.map_frame_id) if record.place else None)
            except InvalidField as error:
                raise error.below(f"/poses/{number}") from error
            pairs.append((identities[move.id], record))
        changed = sum(identity.etag != record.etag for identity, record in pairs)
        store(tx, collection, pairs)
        written = get_collection(tx, collection_id)
        answer = PosesAnswer(map_version=written.revision, changed=changed)
        return store_response(tx, idempotency_key, operation, StoredResponse(200, {}, to_json(answer)))
