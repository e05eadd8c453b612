"""One map frame laid onto another by the matches between their submaps, and its submaps moved there."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import orjson

from server.collections.crud import get_collection
from server.constraints.extraction import is_best, pose_of
from server.constraints.formats import uncertainty_of
from server.errors import Conflict, InvalidField
from server.maps.applying import NewPose, write_poses
from server.queries.poses import flat, middle_answer, place_pose
from server.schemas.constraints import ConstraintsInput
from server.schemas.maps.merges import MergeInput, MergePair, MergeSummary
from server.schemas.poses import MapPose
from server.store.repositories.maps.constraint_records import ConstraintFilter, StoredConstraint
from server.store.storage import ReadTransaction, WriteTransaction
from server.store.submap_records import SubmapFilter, SubmapMetadata
from urquhart import SE2
from urquhart.mapping.frames.joint import FrameMatches, JoinedFrames, join_frames
from urquhart.pose_covariance import PoseUncertainty, compose


@dataclass(frozen=True, slots=True, eq=False)
class Merge:
    """Two frames, the matches between them, and how they lie to each other.

    Attributes:
        moving: the submaps that have a pose in the frame `from`, by id.
        rows: the matches, in the order in which `joined` tells of them; of each, the submap of `from` and that of `to`.
    """

    body: MergeInput
    moving: dict[str, SubmapMetadata]
    rows: Sequence[tuple[StoredConstraint, str, str]]
    joined: JoinedFrames


def searched(body: MergeInput) -> ConstraintsInput:
    """The search for the matches of a merge."""
    return ConstraintsInput(
        frame_id=body.from_, gates=body.gates, per_submap=body.per_submap, changed_only=body.changed_only
    )


def check_frames(tx: ReadTransaction, collection_id: str, body: MergeInput) -> None:
    """Refuse what cannot be merged. Raises NotFound, InvalidField and Conflict."""
    collection = get_collection(tx, collection_id)
    if body.from_ == body.to:
        raise InvalidField("is the frame `from` itself", code="same_frame", pointer="/to")
    submaps = tx.submaps(collection.key)
    for name, frame in (("from", body.from_), ("to", body.to)):
        if not submaps.matching(SubmapFilter(map_frame_id=frame)):
            raise InvalidField(f"no submap has a pose in the map frame {frame!r}", code="not_found", pointer=f"/{name}")
    if tx.map_frames(collection).some([body.from_]):
        raise Conflict(
            f"The map frame {body.from_!r} has a coordinate reference system, which its submaps would lose in "
            f"{body.to!r}. Merge the other way round: from {body.to!r} to {body.from_!r}."
        )
    stands = [one.name for one in tx.stands(collection.key).page() if one.frame_id == body.from_]
    if stands:
        raise Conflict(
            f"The map frame {body.from_!r} is that of the stand {stands[0]!r}, whose submaps stay where its file says. "
            f"Merge the other way round: from {body.to!r} to {body.from_!r}."
        )


def merge(tx: ReadTransaction, collection_id: str, body: MergeInput, search: str) -> Merge:
    """How the two frames lie to each other, by the matches that the collection keeps. Raises NotFound and others."""
    check_frames(tx, collection_id, body)
    key = get_collection(tx, collection_id).key
    moving, staying = (_placed(tx, key, frame) for frame in (body.from_, body.to))
    rows = []
    for row in tx.constraints(key).page(ConstraintFilter(kind="match", search=search)):
        if not row.stale:
            if row.from_id in staying and row.to_id in moving:
                rows.append((row, row.to_id, row.from_id))
            elif row.from_id in moving and row.to_id in staying:
                rows.append((row, row.from_id, row.to_id))
    joined = join_frames(_matches(rows, moving, staying))
    return Merge(body, moving, rows, joined)


def apply_merge(tx: WriteTransaction, collection_id: str, made: Merge) -> int:
    """Write the poses of the submaps of `from` in `to`. Returns the new revision of the collection.

    Raises Conflict (the verdict is another than `joined`, or submaps changed) and others; then nothing is written.
    """
    collection, body, joined = get_collection(tx, collection_id), made.body, made.joined
    if joined.verdict != "joined" or joined.pose is None or joined.uncertainty is None:
        raise Conflict(
            f"The map frame {body.from_!r} cannot be laid onto {body.to!r}: {_why(made)}. No submap was moved."
        )
    check_frames(tx, collection_id, body)
    now = _placed(tx, collection.key, body.from_)
    if {name: row.revision for name, row in now.items()} != {name: row.revision for name, row in made.moving.items()}:
        raise Conflict(
            f"Submaps of the map frame {body.from_!r} were stored, moved or deleted since the merge was begun. No "
            "submap was moved: merge again."
        )
    moves = {}
    for name, row in made.moving.items():
        assert row.place is not None
        pose, covariance = place_pose(row.place), None
        there = joined.pose @ pose
        if row.place.map_covariance is not None:
            own = PoseUncertainty.about_point(np.zeros(2), pose, np.reshape(row.place.map_covariance, (3, 3)))
            frame = joined.uncertainty.origin_covariance(joined.pose)
            covariance = flat(compose(joined.pose, frame, pose, own).origin_covariance(there))
        new = MapPose(frame_id=body.to, x=there.x, y=there.y, yaw=there.yaw, covariance=covariance)
        moves[name] = NewPose(new, row.content_revision)
    return write_poses(tx, collection, moves)


def lines_of_merge(made: Merge) -> Iterator[bytes]:
    """A line for how the frames lie to each other, then one for each match; `of` says which it is."""
    yield _line("merge", summary_of(made).model_dump(mode="json", by_alias=True))
    for pair in pairs_of(made):
        yield _line("pair", pair.model_dump(mode="json", by_alias=True))


def summary_of(made: Merge) -> MergeSummary:
    """How the frames lie to each other."""
    joined = made.joined
    told: dict[str, Any] | None = None
    if joined.verdict == "joined" and joined.pose is not None and joined.uncertainty is not None:
        pose = joined.pose
        told = {"x": pose.x, "y": pose.y, "yaw": pose.yaw, "middle": middle_answer(joined.uncertainty)}
        told["covariance"] = flat(joined.uncertainty.origin_covariance(pose))
    used = int(joined.kept.sum()) if joined.verdict == "joined" else 0
    return MergeSummary.model_validate(
        {
            "from": made.body.from_,
            "to": made.body.to,
            "verdict": joined.verdict,
            "transform": told,
            "agreeing": joined.agreeing,
            "used": used,
            "refused": len(made.rows) - used,
            "submaps": len(made.moving),
        }
    )


def pairs_of(made: Merge) -> Iterator[MergePair]:
    """What became of each match."""
    joined = made.joined
    reason: Literal["contradicted", "unconfirmed"] = "contradicted" if joined.verdict == "joined" else "unconfirmed"
    for number, (row, moving, staying) in enumerate(made.rows):
        x, y, yaw = joined.offsets[number].tolist()
        yield MergePair(
            id=str(row.key),
            from_submap=moving,
            to_submap=staying,
            refused=None if joined.verdict == "joined" and joined.kept[number] else reason,
            shift=math.hypot(x, y),
            turn=abs(yaw),
            distance=float(joined.distances[number]),
        )


def _why(made: Merge) -> str:
    agreeing = f"{made.joined.agreeing} of {len(made.rows)} matches agree and have no submap in common"
    if made.joined.verdict == "unconnected":
        return f"{agreeing}, and it takes 4"
    return f"{agreeing}, but more than half as many agree on another pose"


def _placed(tx: ReadTransaction, collection_key: int, frame: str) -> dict[str, SubmapMetadata]:
    submaps = tx.submaps(collection_key)
    rows = submaps.some(sorted(submaps.matching(SubmapFilter(map_frame_id=frame))), SubmapMetadata)
    return {row.id: row for row in rows}


def _matches(
    rows: Sequence[tuple[StoredConstraint, str, str]],
    moving: dict[str, SubmapMetadata],
    staying: dict[str, SubmapMetadata],
) -> FrameMatches:
    numbers = [{name: number for number, name in enumerate(some)} for some in (staying, moving)]
    poses, about, own, shared = np.empty((len(rows), 3)), np.empty((len(rows), 2)), [], []
    for number, (row, mover, stayer) in enumerate(rows):
        match = pose_of(row.content)
        uncertainty = uncertainty_of(row.content, match)
        if row.from_id == mover:  # the match is mover_T_stayer
            turned = PoseUncertainty.about_point(uncertainty.target, match.inverse(), _turned(uncertainty, match))
            match, uncertainty = match.inverse(), turned
        to_place, from_place = staying[stayer].place, moving[mover].place
        assert to_place is not None and from_place is not None
        to_T_stayer, from_T_mover = place_pose(to_place), place_pose(from_place)
        to_T_from = to_T_stayer @ match @ from_T_mover.inverse()
        poses[number] = to_T_from.x, to_T_from.y, to_T_from.yaw
        about[number] = from_T_mover.apply(uncertainty.source[None])[0]
        own.append(_rotated(uncertainty.covariance, to_T_stayer.yaw))
        shared.append(
            _at(to_place.map_covariance, to_T_stayer, uncertainty.target, 0.0)
            + _at(from_place.map_covariance, from_T_mover, uncertainty.source, to_T_from.yaw)
        )
    shape = (len(rows), 3, 3)
    return FrameMatches(
        np.array([numbers[0][stayer] for _, _, stayer in rows], np.int64),
        np.array([numbers[1][mover] for _, mover, _ in rows], np.int64),
        poses,
        about,
        np.array(own, np.float64).reshape(shape),
        np.array(shared, np.float64).reshape(shape),
        np.array([not is_best(row.content) for row, _, _ in rows], np.bool_),
    )


def _at(covariance: Sequence[float] | None, pose: SE2, point: Any, turn: float) -> Any:
    """The covariance (3, 3) of a submap's pose about a point (2,) of the submap, along axes turned by `turn`, radians.

    0 if it is unknown.
    """
    if covariance is None:
        return np.zeros((3, 3))
    given = PoseUncertainty.about_point(np.zeros(2), pose, np.reshape(covariance, (3, 3)))
    return _rotated(given.covariance_about(pose, np.asarray(point, np.float64)), turn)


def _turned(uncertainty: PoseUncertainty, pose: SE2) -> Any:
    """The covariance (3, 3) of the inverse of a pose, about the middle of the trees, axes of the pose's source."""
    return _rotated(uncertainty.covariance, -pose.yaw)


def _rotated(covariance: Any, yaw: float) -> Any:
    """A covariance (3, 3) along axes turned by `yaw`, radians."""
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return turn @ covariance @ turn.T


def _line(of: str, document: dict[str, Any]) -> bytes:
    return orjson.dumps({"of": of} | document) + b"\n"
