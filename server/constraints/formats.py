"""Constraints as JSON, as 4 x 4 matrices, and as g2o files that GTSAM and g2o can read.

GTSAM's reader skips all edges after a comment, and neither reader knows names. So vertices and edges come first, and
after them, as comments, the name of each vertex.
"""

import math
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray

from server.constraints.extraction import Found, pose_of
from server.errors import InvalidField
from server.queries.poses import place_pose
from server.schemas.maps.constraint_rows import StoredFormat
from server.store.submap_records import Place
from urquhart import SE2
from urquhart.pose_covariance import PoseUncertainty

_NAMED: Final = 10
"""Map frames that an error message names."""


@dataclass(frozen=True, slots=True)
class StoredSubmap:
    """A submap that is stored now: the revision of its landmarks, its pose in a map, and when it was observed."""

    content_revision: int
    place: Place | None
    stamp: datetime | None = None


def is_stale(one: Found, known: Mapping[str, StoredSubmap]) -> bool:
    """Whether a submap of a constraint was deleted, or has other landmarks than those that were compared.

    `known`: the present submaps, by id. Results of older versions have no revisions: then only deleted submaps are
    known to make a constraint stale.
    """
    for end in ("from", "to"):
        there, compared = known.get(one[end]), one.get(f"{end}_revision")
        if there is None or (compared is not None and there.content_revision != compared):
            return True
    return False


def write_out(
    found: Sequence[Found], wanted: StoredFormat, known: Mapping[str, StoredSubmap], frame_id: str | None = None
) -> bytes:
    """Constraints, each with `stale`, in a format. `known` and `frame_id` decide where g2o vertices start, see
    `_starts`.

    Raises InvalidField if no submap of the constraints has a pose in `frame_id`.
    """
    if wanted == "json":
        return orjson.dumps({"constraints": list(found)})
    if wanted == "ndjson":
        return b"".join(orjson.dumps(one) + b"\n" for one in found)
    fresh = [one for one in found if not one["stale"]]
    if wanted == "matrices":
        return "".join(map(_matrix, fresh)).encode()
    if wanted in ("tum", "kitti"):
        return trajectory(fresh, known, frame_id, stamped=wanted == "tum").encode()
    places = {name: there.place for name, there in known.items() if there.place is not None}
    return _g2o(fresh, len(found) - len(fresh), places, frame_id, at_trees=wanted == "g2o_middle").encode()


def _g2o(found: Sequence[Found], stale: int, places: Mapping[str, Place], frame_id: str | None, at_trees: bool) -> str:
    names = list(dict.fromkeys(name for one in found for name in (one["from"], one["to"])))
    numbers = {name: i for i, name in enumerate(names)}
    origins = _middles(found, names) if at_trees else dict.fromkeys(names, np.zeros(2))
    frame, starts, groups = _starts(found, names, places, frame_id)
    lines = [_vertex(numbers[name], starts[name] @ SE2.shift(origins[name])) for name in names]
    lines += [_edge(one, numbers, origins) for one in found]
    for name in names:
        x, y = origins[name].tolist()
        lines.append(f"# {numbers[name]} {name}" + (f" {x!r} {y!r}" if at_trees else ""))
    for group, placed in groups:
        where = f"in the frame {frame!r}" if placed else "in no map frame: the first one is at 0 0 0"
        lines.append(f"## component of {len(group)} vertices from {numbers[group[0]]} on, {where}")
    if stale:
        lines.append(f"## left out as stale: {stale} constraints")
    return "\n".join(lines) + "\n" if lines else ""


def trajectory(
    found: Sequence[Found], known: Mapping[str, StoredSubmap], frame_id: str | None, *, stamped: bool
) -> str:
    """The pose of each submap of the constraints, in the order of their stamps: TUM with its stamp, or KITTI without.

    Submaps without a stamp come last in KITTI. Raises InvalidField if there is no common frame, or TUM is wanted and a
    submap has no stamp.
    """
    names = list(dict.fromkeys(name for one in found for name in (one["from"], one["to"])))
    places = {name: there.place for name, there in known.items() if there.place is not None}
    _, starts, groups = _starts(found, names, places, frame_id)
    if len(groups) > 1 and not all(placed for _, placed in groups):
        raise InvalidField(
            f"these constraints connect {len(groups)} groups of submaps that have no common frame: build and apply a "
            "map, or write g2o",
            code="frames",
            parameter="format",
        )
    stamps = {name: known[name].stamp for name in names}
    bare = [name for name in names if stamps[name] is None]
    if stamped and bare:
        raise InvalidField(
            f"{len(bare)} submaps have no stamp, such as {bare[0]!r}, and TUM needs one for each pose: write kitti",
            code="no_stamp",
            parameter="format",
        )
    order = sorted(names, key=lambda name: math.inf if (at := stamps[name]) is None else at.timestamp())
    lines = list[str]()
    for name in order:
        pose, at = starts[name], stamps[name]
        if stamped and at is not None:
            half = 0.5 * pose.yaw
            lines.append(f"{at.timestamp():.6f} {pose.x!r} {pose.y!r} 0 0 0 {math.sin(half)!r} {math.cos(half)!r}\n")
        else:
            c, s = math.cos(pose.yaw), math.sin(pose.yaw)
            lines.append(f"{c!r} {-s!r} 0 {pose.x!r} {s!r} {c!r} 0 {pose.y!r} 0 0 1 0\n")
    return "".join(lines)


def _vertex(number: int, pose: SE2) -> str:
    return f"VERTEX_SE2 {number} {pose.x!r} {pose.y!r} {pose.yaw!r}"


def _edge(one: Found, numbers: Mapping[str, int], origins: Mapping[str, NDArray[np.float64]]) -> str:
    """An edge between vertices at `origins` (2,), metres, in their submaps' frames."""
    pose, origin = pose_of(one), origins[one["to"]]
    at = SE2.shift(origins[one["from"]]).inverse() @ pose @ SE2.shift(origin)
    information = uncertainty_of(one, pose).source_information(pose, origin)
    upper = " ".join(repr(float(information[i, j])) for i in range(3) for j in range(i, 3))
    return f"EDGE_SE2 {numbers[one['from']]} {numbers[one['to']]} {at.x!r} {at.y!r} {at.yaw!r} {upper}"


def uncertainty_of(one: Found, pose: SE2) -> PoseUncertainty:
    """The uncertainty of the pose of a constraint."""
    at = one["transform"]
    middle = at.get("middle")
    if (
        middle is None
    ):  # stored by earlier versions: about the origin, where the information is poor if the trees are far away
        return PoseUncertainty.about_point(np.zeros(2), pose, np.reshape(at["covariance"], (3, 3)))
    source, target = np.array(middle["source"]), np.array(middle["target"])
    covariance, information = (np.reshape(middle[name], (3, 3)) for name in ("covariance", "information"))
    return PoseUncertainty(source, target, covariance, information)


def _middles(found: Sequence[Found], names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """For each submap a point among its trees (2,), metres, in its frame: the mean of the middles of its
    constraints.
    """
    points: dict[str, list[Any]] = {name: [] for name in names}
    for one in found:
        uncertainty = uncertainty_of(one, pose_of(one))
        points[one["from"]].append(uncertainty.target)
        points[one["to"]].append(uncertainty.source)
    return {name: np.mean(some, axis=0) for name, some in points.items()}


def _starts(
    found: Sequence[Found], names: Sequence[str], places: Mapping[str, Place], frame_id: str | None
) -> tuple[str | None, dict[str, SE2], list[tuple[list[str], bool]]]:
    """The map frame in which vertices start, the pose of each, and the components with whether each has a pose there.

    The frame is `frame_id`, by default the one that most of the submaps have a pose in. Submaps with a pose in it start
    there, all others along the constraints from those. A component without any starts at 0. Poses in other frames are
    ignored, because the relation of the frames is unknown.
    """
    frames = Counter(places[name].map_frame_id for name in names if name in places)
    if frame_id is not None and names and frame_id not in frames:
        there = ", ".join(map(repr, sorted(frames)[:_NAMED])) or "none"
        raise InvalidField(
            f"no submap of these constraints has a pose in the map frame {frame_id!r}; the frames they have poses in: "
            f"{there}",
            code="not_found",
            parameter="frame_id",
        )
    frame = frame_id or min(frames, key=lambda one: (-frames[one], one), default=None)
    beside: dict[str, list[tuple[str, SE2]]] = {name: [] for name in names}
    for one in found:
        beside[one["from"]].append((one["to"], pose_of(one)))
        beside[one["to"]].append((one["from"], pose_of(one).inverse()))
    starts = {n: place_pose(places[n]) for n in names if n in places and places[n].map_frame_id == frame}
    placed = set(starts)
    _spread(starts, deque(starts), beside)
    for name in names:
        if name not in starts:
            starts[name] = SE2.identity()
            _spread(starts, deque([name]), beside)
    return frame, starts, [(group, not placed.isdisjoint(group)) for group in _components(names, beside)]


def _spread(starts: dict[str, SE2], queue: deque[str], beside: Mapping[str, Sequence[tuple[str, SE2]]]) -> None:
    """Give a pose to everything without one that constraints reach from the submaps in the queue."""
    while queue:
        name = queue.popleft()
        for other, step in beside[name]:
            if other not in starts:
                starts[other] = starts[name] @ step
                queue.append(other)


def _components(names: Sequence[str], beside: Mapping[str, Sequence[tuple[str, SE2]]]) -> list[list[str]]:
    groups, seen = list[list[str]](), set[str]()
    for name in names:
        if name in seen:
            continue
        seen.add(name)
        group = [name]
        for member in group:
            for other, _ in beside[member]:
                if other not in seen:
                    seen.add(other)
                    group.append(other)
        groups.append(group)
    return groups


def _matrix(one: Found) -> str:
    at = pose_of(one)
    c, s = math.cos(at.yaw), math.sin(at.yaw)
    rows = [c, -s, 0.0, at.x, s, c, 0.0, at.y, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    return f"{one['from']} {one['to']} {' '.join(map(repr, rows))}\n"
