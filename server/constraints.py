"""Constraints between the submaps of a collection: found by looking each up, agreed from both sides, written out.

A constraint is from_T_to: it takes points of the submap `to` into the frame of `from`, p_from = R(yaw) p_to + t. That
is the pose of `to` seen from `from`, as an edge of a pose graph has it.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import orjson

from server.errors import InvalidField
from server.reading import submap_filter
from server.registry import get_collection
from server.schemas.candidates import CandidateAnswer
from server.schemas.constraints import ConstraintFormat, ConstraintsInput
from server.schemas.queries import Exclude, QueryInput
from server.store.database import Database
from server.store.submaps import SubmapFilter, Submaps
from server.store.tables import SubmapRow
from urquhart import SE2

_SHIFT: Final = 1.0
"""Metres, and"""
_TURN: Final = math.radians(5.0)
"""radians: two finds of a pair that are farther from each other than this contradict each other."""

Found = dict[str, Any]
"""A constraint as JSON: from, to, transform, inliers, rms, confidence, from_session, to_session."""


def chosen_submaps(body: ConstraintsInput) -> SubmapFilter:
    """Which submaps are looked up, `submap_ids` apart. Raises InvalidField."""
    bbox = None if body.bbox is None else ",".join(map(repr, body.bbox))
    try:
        return submap_filter(session=body.session, bbox=bbox, frame_id=body.frame_id, datetime_range=body.datetime)
    except InvalidField as error:  # here they are members, of the same names as the parameters of a listing
        raise InvalidField(str(error), code=error.code, pointer=f"/{error.parameter}") from error


def check_ids(database: Database, collection_id: str, body: ConstraintsInput) -> None:
    """Refuse submaps that are not there: who names them means them. Raises NotFound and InvalidField."""
    with database.read() as session:
        collection = get_collection(session, collection_id)
        there = Submaps(session, collection.key).keys(body.submap_ids or ())
    for number, name in enumerate(body.submap_ids or ()):
        if name not in there:
            raise InvalidField(f"there is no submap {name!r}", code="not_found", pointer=f"/submap_ids/{number}")


def question(row: SubmapRow, body: ConstraintsInput, most: int) -> QueryInput:
    """The query that looks a submap up among all others that it may be paired with; `most` candidates of any query."""
    exclude = Exclude()
    if body.exclude.within_seconds is not None and row.stamp is not None:
        exclude = Exclude(within_seconds=body.exclude.within_seconds)
    return QueryInput(submap_id=row.id, limit=min(body.per_submap, most), exclude=exclude, pairs=False)


def from_candidates(row: SubmapRow, candidates: Sequence[CandidateAnswer], body: ConstraintsInput) -> list[Found]:
    """Those candidates of a submap's look-up that are accepted and pass the gates, as constraints."""
    gates = body.gates
    return [
        {
            "from": one.submap_id,
            "to": row.id,
            "transform": one.transform.model_dump(),
            "inliers": one.inlier_count,
            "rms": one.rms,
            "confidence": one.confidence,
            "from_session": one.session,
            "to_session": row.session,
        }
        for one in candidates
        if one.refused is None
        and one.confidence >= gates.confidence
        and one.inlier_count >= gates.inliers
        and (gates.rms is None or one.rms <= gates.rms)
        and not (body.exclude.same_session and row.session is not None and one.session == row.session)
    ]


def agree(found: Iterable[Found]) -> tuple[list[Found], int]:
    """One constraint for each pair, the one with more inliers; and how many pairs contradict themselves, left out."""
    pairs: dict[tuple[str, str], Found | None] = {}
    contradictions = 0
    for one in found:
        pair = min(one["from"], one["to"]), max(one["from"], one["to"])
        other = pairs.get(pair)
        if pair not in pairs:
            pairs[pair] = one
        elif other is not None:
            mine, theirs = _pose(one), _pose(other)
            shift, turn = mine.distance(theirs if one["from"] == other["from"] else theirs.inverse())
            if shift > _SHIFT or turn > _TURN:
                pairs[pair], contradictions = None, contradictions + 1
            elif one["inliers"] > other["inliers"]:
                pairs[pair] = one
    return [one for one in pairs.values() if one is not None], contradictions


def write_out(found: Sequence[Found], wanted: ConstraintFormat, poses: Mapping[str, SE2]) -> bytes:
    """Constraints in a format; `poses` are those of submaps in a map, where g2o begins."""
    match wanted:
        case "json":
            return orjson.dumps({"constraints": list(found)})
        case "g2o":
            return _g2o(found, poses).encode()
        case "matrices":
            return "".join(map(_matrix, found)).encode()
        case _:
            return b"".join(orjson.dumps(one) + b"\n" for one in found)


def _g2o(found: Sequence[Found], poses: Mapping[str, SE2]) -> str:
    names = list(dict.fromkeys(name for one in found for name in (one["from"], one["to"])))
    numbers = {name: i for i, name in enumerate(names)}
    starts = _starts(found, names, poses)
    lines = [f"# {numbers[name]} {name}" for name in names]
    for name in names:
        pose = starts[name]
        lines.append(f"VERTEX_SE2 {numbers[name]} {pose.x!r} {pose.y!r} {pose.yaw!r}")
    for one in found:
        at = one["transform"]
        information = np.linalg.pinv(np.reshape(at["covariance"], (3, 3)), hermitian=True)
        upper = " ".join(repr(float(information[i, j])) for i in range(3) for j in range(i, 3))
        lines.append(
            f"EDGE_SE2 {numbers[one['from']]} {numbers[one['to']]} {at['x']!r} {at['y']!r} {at['yaw']!r} {upper}"
        )
    return "\n".join(lines) + "\n" if lines else ""


def _starts(found: Sequence[Found], names: Sequence[str], poses: Mapping[str, SE2]) -> dict[str, SE2]:
    """A pose for every submap: its own in the map, else along the constraints from one that has a pose, else 0."""
    beside: dict[str, list[tuple[str, SE2]]] = {name: [] for name in names}
    for one in found:
        beside[one["from"]].append((one["to"], _pose(one)))
        beside[one["to"]].append((one["from"], _pose(one).inverse()))
    starts: dict[str, SE2] = {}
    for root in sorted(names, key=lambda name: name not in poses):
        if root in starts:
            continue
        starts[root] = poses.get(root, SE2.identity())
        queue = deque([root])
        while queue:
            name = queue.popleft()
            for other, step in beside[name]:
                if other not in starts:
                    starts[other] = poses.get(other, starts[name] @ step)
                    queue.append(other)
    return starts


def _matrix(one: Found) -> str:
    at = one["transform"]
    c, s = math.cos(at["yaw"]), math.sin(at["yaw"])
    rows = [c, -s, 0.0, at["x"], s, c, 0.0, at["y"], 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    return f"{one['from']} {one['to']} {' '.join(map(repr, rows))}\n"


def _pose(one: Found) -> SE2:
    at = one["transform"]
    return SE2(at["x"], at["y"], at["yaw"])
