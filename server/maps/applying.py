"""Poses of many submaps written in one transaction: all or none, under one new revision."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from server.collections.crud import get_collection
from server.collections.georeference import check_place
from server.errors import Conflict
from server.index.row_decoding import config_of
from server.maps.building import BuiltMap, map_pose_of
from server.maps.documents import sentence_of
from server.schemas.poses import MapPose
from server.schemas.submaps import SubmapPatch
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction, WriteTransaction
from server.store.submap_records import SubmapContent, SubmapFilter
from server.submaps.preparation import patched
from server.submaps.writes import store

_NAMED = 5
"""Ids that an error names."""


@dataclass(frozen=True, slots=True)
class NewPose:
    """A pose to write into a submap; None removes the one that it has.

    `content_revision`: of the landmarks that the pose is for.
    """

    map_pose: MapPose | None
    content_revision: int


def apply_map(tx: WriteTransaction, collection_id: str, built: BuiltMap) -> int:
    """Write the poses of a map into its submaps. Returns the new revision of the collection: the map's version.

    Submaps that nothing connects lose a pose in a frame that the map rewrites, because that frame moves.

    Raises NotFound and Conflict (submaps changed, a frame that other submaps are in, or a map that contradicts itself);
    then nothing is written.
    """
    _check_contradictions(built)
    collection = get_collection(tx, collection_id)
    frames = {frame for frame in built.frames if frame is not None}
    _check_frames(tx, collection, built, frames)
    moves = dict[str, NewPose]()
    for number, one in enumerate(built.chosen):
        frame = built.frames[built.poses.part[number]]
        if frame is not None:
            moves[one.id] = NewPose(map_pose_of(built, number), one.content_revision)
        elif one.place is not None and one.place.map_frame_id in frames:
            moves[one.id] = NewPose(None, one.content_revision)
    return write_poses(tx, collection, moves)


def write_poses(tx: WriteTransaction, collection: CollectionRecord, moves: Mapping[str, NewPose]) -> int:
    """Write poses into submaps by id. Returns the revision. Raises Conflict and InvalidField; then none is written."""
    submaps, config = tx.submaps(collection.key), config_of(collection)
    identities = submaps.identities(list(moves))
    rows = {row.id: row for row in submaps.some([one.key for one in identities.values()], SubmapContent)}
    changed = [name for name, new in moves.items() if _is_other(rows.get(name), new)]
    if changed:
        raise Conflict(
            f"{len(changed)} submaps were deleted or got other landmarks since the map was begun, such as "
            f"{_list(changed)}. No pose was written: build the map again."
        )
    references = tx.map_frames(collection).some({new.map_pose.frame_id for new in moves.values() if new.map_pose})
    pairs = []
    for name, new in moves.items():
        record = patched(rows[name], SubmapPatch(map_pose=new.map_pose), None, config)
        check_place(record.place, references.get(record.place.map_frame_id) if record.place else None)
        pairs.append((identities[name], record))
    store(tx, collection, pairs)
    written = tx.collections.get(collection.id)
    assert written is not None
    return written.revision


def _is_other(row: SubmapContent | None, new: NewPose) -> bool:
    return row is None or row.content_revision != new.content_revision


def _check_contradictions(built: BuiltMap) -> None:
    """Raise Conflict if nothing tells which side of a contradiction is wrong: the map may be wrong there."""
    open_ones = [one for one in built.poses.contradictions if one.outcome == "undecided"]
    if open_ones:
        others = f" There are {len(open_ones) - 1} more such contradictions." if len(open_ones) > 1 else ""
        raise Conflict(
            f"The map contradicts itself, and nothing tells which side is wrong: {sentence_of(built, open_ones[0])}."
            f"{others} No pose was written: leave out or correct the wrong side, or enlarge its covariance."
        )


def _check_frames(tx: ReadTransaction, collection: CollectionRecord, built: BuiltMap, frames: set[str]) -> None:
    """Raise Conflict if a frame that the map makes exists already, with other submaps or with a place on Earth."""
    mine = {one.key for one in built.chosen}
    for frame in sorted(frames - {built.prior_frame}):
        others = tx.submaps(collection.key).matching(SubmapFilter(map_frame_id=frame)) - mine
        if others:
            raise Conflict(
                f"{len(others)} submaps that are not in this map have poses in the map frame {frame!r}, and would no "
                "longer fit. Choose another map_frame_id, or all submaps of that frame."
            )
        if tx.map_frames(collection).some([frame]):
            raise Conflict(
                f"The map frame {frame!r} has a coordinate reference system, but nothing says where this map is on "
                "Earth. Choose another map_frame_id, or use_map_poses."
            )


def _list(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names[:_NAMED]))
