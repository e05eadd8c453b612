"""A map as documents: in numbers, its poses, its constraints, its trees."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import Final

import numpy as np

from server.maps.building import BuiltMap, map_pose_of
from server.queries.poses import flat
from server.schemas.common import write_stamp
from server.schemas.maps.answers import LandmarkEntry, MapContradiction, MapEdge, MapSubmapPose, MapSummary
from server.schemas.poses import PlacedPose
from urquhart.mapping.odometry.judging import Contradiction

_NAMED: Final = 6
"""Constraints that a sentence names."""


def summary_of(built: BuiltMap) -> MapSummary:
    """A map in numbers."""
    refused = Counter(built.poses.refusals)
    return MapSummary(
        submaps=len(built.chosen),
        parts=built.part_sizes,
        constraints=len(built.edges),
        contradicted=refused["contradicted"],
        unconfirmed=refused["unconfirmed"],
        undecided=refused["undecided"],
        contradictions=len(built.poses.contradictions),
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
                "id": None if edge.row is None else str(edge.row),
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


def contradictions_of(built: BuiltMap) -> Iterator[MapContradiction]:
    """Odometry that other constraints contradict."""
    for one in built.poses.contradictions:
        yield MapContradiction(
            odometry=list(one.edges),
            against=list(one.against),
            witnesses=one.witnesses,
            distance=round(one.sigmas, 2),
            outcome=one.outcome,
        )


def sentence_of(built: BuiltMap, one: Contradiction) -> str:
    """A contradiction in words, with the submaps that its odometry and the other side join."""
    odometry, against = (_pairs(built, numbers) for numbers in (one.edges, one.against))
    if not one.against:
        return f"odometry contradicts itself by {one.sigmas:.1f} standard deviations: {odometry}"
    verb = "is left out" if one.outcome == "refused" else "is contradicted"
    return (
        f"odometry {odometry} {verb}: {one.witnesses} independent ways say otherwise, by {one.sigmas:.1f} standard "
        f"deviations ({against})"
    )


def _pairs(built: BuiltMap, numbers: Sequence[int]) -> str:
    edges = [built.edges[number] for number in numbers[:_NAMED]]
    more = f" and {len(numbers) - _NAMED} more" if len(numbers) > _NAMED else ""
    return ", ".join(f"{edge.first or 'map'} - {edge.second}" for edge in edges) + more


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
