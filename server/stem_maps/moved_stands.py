"""A stand moved in its map: the poses of all its submaps, turned and shifted together in one transaction."""

import math

import numpy as np

from server.collections.crud import get_collection
from server.errors import Conflict, InvalidField, NotFound
from server.index.row_decoding import config_of
from server.resources.idempotency import IdempotencyKey, StoredResponse, find_response, store_response
from server.resources.preconditions import ANYTHING, Preconditions
from server.schemas.collections import StandMove
from server.schemas.common import to_json
from server.schemas.poses import MapPose
from server.schemas.submaps import SubmapPatch
from server.stem_maps.stored_stands import find
from server.store.records import CollectionRecord
from server.store.storage import Storage, WriteTransaction
from server.store.submap_records import Place, SubmapContent
from server.submaps.preparation import patched
from server.submaps.writes import check_place, store
from urquhart import SE2


def move_stand(
    database: Storage,
    collection_id: str,
    name: str,
    move: StandMove,
    preconditions: Preconditions = ANYTHING,
    idempotency_key: IdempotencyKey | None = None,
) -> StoredResponse:
    """Move a stand. Returns the answer: the stand as it is then.

    Submaps that were taken out of the stand, or have no pose in the map, stay where they are. Indexing the stand's file
    again puts it where the file says.

    Raises NotFound, Conflict (its submaps are in several map frames, or in none), InvalidField (it would lie outside of
    its system's area), PreconditionFailed, KeyReused and StorageError; then nothing is moved.
    """
    with database.write() as tx:
        collection = get_collection(tx, collection_id)
        operation = f"patchStand {collection.key} {name}"
        response = find_response(tx, idempotency_key, operation)
        if response is not None:
            return response
        before = find(tx, collection, name)
        if before is None:
            raise NotFound("stand", name)
        preconditions.check(before.etag)
        _move(tx, collection, name, move)
        after = find(tx, collection, name)
        assert after is not None
        answer = StoredResponse(200, {"ETag": f'"{after.etag}"'}, to_json(after))
        return store_response(tx, idempotency_key, operation, answer)


def _move(tx: WriteTransaction, collection: CollectionRecord, name: str, move: StandMove) -> None:
    stand = tx.stands(collection.key).get(name)
    assert stand is not None  # it was found in this transaction
    submaps, config = tx.submaps(collection.key), config_of(collection)
    rows = submaps.some(sorted(tx.stands(collection.key).members(stand.key).values()), SubmapContent)
    placed = [(row, row.place) for row in rows if row.place is not None]
    frames = sorted({place.map_frame_id for _, place in placed})
    if len(frames) != 1:
        where = "have no pose in a map" if not frames else f"are in {len(frames)} map frames, such as {frames[0]!r}"
        raise Conflict(f"The submaps of the stand {name!r} {where}, so it cannot be moved as one thing.")
    frame_T_before = _motion(move, [place for _, place in placed])
    identities = submaps.identities([row.id for row, _ in placed])
    pairs = []
    for row, place in placed:
        record = patched(row, SubmapPatch(map_pose=_moved(place, frame_T_before)), None, config)
        try:
            check_place(tx, collection, record.place)
        except InvalidField as error:
            raise InvalidField(str(error), code=error.code, pointer="/shift") from error
        pairs.append((identities[row.id], record))
    store(tx, collection, pairs)
    tx.stands(collection.key).touch(stand.key)


def _motion(move: StandMove, places: list[Place]) -> SE2:
    """frame_T_before: what takes points of the map frame, as they lie now, to where they are to lie."""
    if move.about is not None:
        about = np.array(move.about)
    else:
        low = np.min([(place.map_min_x, place.map_min_y) for place in places], axis=0)
        high = np.max([(place.map_max_x, place.map_max_y) for place in places], axis=0)
        about = (low + high) / 2.0
    return SE2.shift(about + np.array(move.shift)) @ SE2(0.0, 0.0, move.yaw) @ SE2.shift(-about)


def _moved(place: Place, frame_T_before: SE2) -> MapPose:
    """The pose of a submap after the motion; its covariance, along the axes of the map, turns with it."""
    pose = frame_T_before @ SE2(place.map_x, place.map_y, place.map_yaw)
    covariance = None
    if place.map_covariance is not None:
        turn = np.eye(3)
        cosine, sine = math.cos(frame_T_before.yaw), math.sin(frame_T_before.yaw)
        turn[:2, :2] = [[cosine, -sine], [sine, cosine]]
        known = np.asarray(place.map_covariance, dtype=np.float64).reshape(3, 3)
        covariance = (turn @ known @ turn.T).ravel().tolist()
    return MapPose(frame_id=place.map_frame_id, x=pose.x, y=pose.y, yaw=pose.yaw, covariance=covariance)
