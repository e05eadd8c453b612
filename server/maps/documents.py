"""A map as documents: in numbers, its poses, its constraints, its trees."""

import math
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np

from server.maps.applying import map_pose_of
from server.maps.building import BuiltMap
from server.queries.poses import flat
from server.schemas.common import write_stamp
from server.schemas.maps.answers import LandmarkEntry, MapEdge, MapSubmapPose, MapSummary
from server.schemas.poses import PlacedPose


def summary_of(built: BuiltMap) -> MapSummary:
    """A map in numbers."""
    refused = Counter(built.poses.refusals)
    return MapSummary(
        submaps=len(built.chosen),
        parts=built.part_sizes,
        constraints=len(built.edges),
        contradicted=refused["contradicted"],
        unconfirmed=refused["unconfirmed"],
        covariance_scale=round(built.poses.scale, 2),
        trees=len(built.trees),
        noise=round(built.trees.noise, 4),
    )


def poses_of(built: BuiltMap) -> Iterator[MapSubmapPose]:
    """The pose of each submap."""
    for number, one in enumerate(built.chosen):
        pose = map_pose_of(built, number)
        yield MapSubmapPose(
            id=one.id,
            session=one.session,
            part=built.part_numbers[built.poses.part[number]],
            map_pose=None
            if pose is None
            else PlacedPose(frame_id=pose.frame_id, x=pose.x, y=pose.y, yaw=pose.yaw, covariance=pose.covariance),
        )


def edges_of(built: BuiltMap) -> Iterator[MapEdge]:
    """What became of each constraint."""
    poses = built.poses
    for number, edge in enumerate(built.edges):
        known = math.isfinite(poses.distances[number])
        x, y, yaw = poses.offsets[number].tolist()
        yield MapEdge.model_validate(
            {
                "kind": edge.kind,
                "from": edge.first,
                "to": edge.second,
                "refused": poses.refusals[number],
                "shift": math.hypot(x, y) if known else None,
                "turn": abs(yaw) if known else None,
                "distance": float(poses.distances[number]) if known else None,
                "support": int(poses.support[number]),
            }
        )


def trees_of(built: BuiltMap) -> Iterator[LandmarkEntry]:
    """Each tree."""
    trees = built.trees
    for number in range(len(trees)):
        x, y = trees.xy[number].tolist()
        yield LandmarkEntry(
            id=number + 1,
            part=built.part_numbers[trees.part[number]],
            x=x,
            y=y,
            covariance=flat(trees.covariances[number]),
            dbh_cm=_known(trees.diameters[number]),
            height_m=_known(trees.heights[number]),
            observed=int(trees.counts[number]),
            missed=int(trees.missed[number]),
            first_seen=_stamp(trees.first_seen[number]),
            last_seen=_stamp(trees.last_seen[number]),
        )


def _known(value: np.float64) -> float | None:
    return None if np.isnan(value) else round(float(value), 3)


def _stamp(seconds: np.float64) -> str | None:
    return None if np.isnan(seconds) else write_stamp(datetime.fromtimestamp(float(seconds), UTC))
