"""One map from submaps and the constraints between them: optimised poses, and one entry for each tree."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from server.constraints.extraction import is_best, pose_of
from server.constraints.formats import uncertainty_of
from server.constraints.rows import uncertainty_of_odometry
from server.errors import InvalidField, OptimiserMissing
from server.maps.selection import ChosenSubmap, numbers_of
from server.queries.poses import flat, place_pose
from server.schemas.maps.request import MapInput
from server.schemas.poses import MapPose
from server.store.repositories.maps.constraint_records import StoredConstraint
from urquhart import SE2
from urquhart.mapping.consistency import MAPPING, MappingNumbers
from urquhart.mapping.graph_solver import MissingOptimiser, optimiser
from urquhart.mapping.landmark_map import LandmarkMap, build_landmark_map
from urquhart.mapping.optimisation import OptimisedPoses, optimise
from urquhart.mapping.pose_graph import MAP, PoseConstraint, PoseConstraints
from urquhart.pose_covariance import PoseUncertainty

Solve = Callable[[int, PoseConstraints, MappingNumbers], OptimisedPoses]
EdgeKind = Literal["match", "odometry", "prior"]
_EXACT: Final = np.diag([1e-6, 1e-6, 1e-10])
"""Square metres and radians, added to the covariance of a prior: nobody knows a pose better than to a millimetre."""


@dataclass(frozen=True, slots=True)
class GraphEdge:
    """A constraint of a map: where it comes from, the submaps that it joins (None for the map frame), and its key if
    the collection keeps it.
    """

    kind: EdgeKind
    first: str | None
    second: str
    row: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class BuiltMap:
    """A map.

    Attributes:
        chosen: its submaps.
        edges: its constraints, in the order in which `poses` tells of them.
        poses: of the submaps.
        trees: of the map.
        part_numbers: for each part of `poses`, its number from 1 by size, the largest first.
        frames: for each part of `poses`, the map frame of its poses; None for a submap that nothing connects, unless it
            is the only one.
        prior_frame: the map frame of the priors; None without priors.
    """

    chosen: Sequence[ChosenSubmap]
    edges: Sequence[GraphEdge]
    poses: OptimisedPoses
    trees: LandmarkMap
    part_numbers: Sequence[int]
    frames: Sequence[str | None]
    prior_frame: str | None

    @property
    def part_sizes(self) -> list[int]:
        """Number of submaps of each part, the largest first."""
        return sorted(np.bincount(self.poses.part).tolist(), reverse=True)


def check_optimiser() -> None:
    """Raise OptimiserMissing if GTSAM is not installed."""
    try:
        optimiser()
    except MissingOptimiser as error:
        raise OptimiserMissing(str(error)) from error


def build(
    chosen: Sequence[ChosenSubmap], kept: Sequence[StoredConstraint], body: MapInput, solve: Solve = optimise
) -> BuiltMap:
    """Build a map of submaps from constraints. Those that are stale, or lead to other submaps, are left out.

    `solve`: `optimise`, or what calls it elsewhere. Raises InvalidField (odometry or priors that cannot be used),
    OptimiserMissing, and what `solve` raises.
    """
    check_optimiser()
    numbers = numbers_of(chosen, body)
    edges, constraints = list[GraphEdge](), list[PoseConstraint]()
    for edge, constraint in (*_odometry(body, numbers), *_kept(kept, numbers)):
        edges.append(edge)
        constraints.append(constraint)
    prior_frame = None
    if body.use_map_poses:
        prior_frame = _prior_frame(chosen)
        for edge, constraint in _priors(chosen, prior_frame):
            edges.append(edge)
            constraints.append(constraint)
    wanted = MAPPING._replace(agreeing=body.agreeing)
    poses = solve(len(chosen), PoseConstraints.of(constraints), wanted)
    trees = build_landmark_map([one.mapped for one in chosen], poses, body.association)
    part_numbers, frames = _frames(poses, body.map_frame_id, prior_frame)
    return BuiltMap(chosen, edges, poses, trees, part_numbers, frames, prior_frame)


def _odometry(body: MapInput, numbers: dict[str, int]) -> list[tuple[GraphEdge, PoseConstraint]]:
    made = []
    for number, edge in enumerate(body.odometry):
        uncertainty = uncertainty_of_odometry(edge, f"/odometry/{number}")
        ends, pose = (numbers[edge.from_], numbers[edge.to]), SE2(edge.x, edge.y, edge.yaw)
        made.append(
            (GraphEdge("odometry", edge.from_, edge.to), PoseConstraint(*ends, pose, uncertainty, trusted=True))
        )
    return made


def _kept(kept: Sequence[StoredConstraint], numbers: dict[str, int]) -> list[tuple[GraphEdge, PoseConstraint]]:
    return [
        (GraphEdge(one.kind, one.from_id, one.to_id, one.key), constraint_of(one, numbers))
        for one in kept
        if not one.stale and one.from_id in numbers and one.to_id in numbers
    ]


def constraint_of(one: StoredConstraint, numbers: Mapping[str, int]) -> PoseConstraint:
    """A stored constraint between the numbers of its submaps."""
    pose, is_odometry = pose_of(one.content), one.kind == "odometry"
    return PoseConstraint(
        numbers[one.from_id],
        numbers[one.to_id],
        pose,
        uncertainty_of(one.content, pose),
        trusted=is_odometry,
        secondary=not is_odometry and not is_best(one.content),
    )


def _prior_frame(chosen: Sequence[ChosenSubmap]) -> str:
    """The map frame of the priors. Raises InvalidField if there is none, or more than one."""
    frames = Counter(
        one.place.map_frame_id for one in chosen if one.place is not None and one.place.map_covariance is not None
    )
    if not frames:
        raise InvalidField(
            "none of the chosen submaps has a map pose with a covariance", code="no_priors", pointer="/use_map_poses"
        )
    if len(frames) > 1:
        names = ", ".join(map(repr, sorted(frames)[:5]))
        raise InvalidField(
            f"the chosen submaps have map poses with covariances in {len(frames)} map frames ({names}), and how these "
            "lie to each other is not known: choose one of them with frame_id",
            code="frames",
            pointer="/use_map_poses",
        )
    return next(iter(frames))


def _priors(chosen: Sequence[ChosenSubmap], frame: str) -> list[tuple[GraphEdge, PoseConstraint]]:
    made = []
    for number, one in enumerate(chosen):
        place = one.place
        if place is not None and place.map_covariance is not None and place.map_frame_id == frame:
            pose, covariance = place_pose(place), np.reshape(place.map_covariance, (3, 3)) + _EXACT
            uncertainty = PoseUncertainty.about_point(np.zeros(2), pose, covariance)
            made.append((GraphEdge("prior", None, one.id), PoseConstraint(MAP, number, pose, uncertainty)))
    return made


def _frames(poses: OptimisedPoses, name: str, prior_frame: str | None) -> tuple[list[int], list[str | None]]:
    """The number of each part by size, and the map frame of its poses."""
    sizes = np.bincount(poses.part, minlength=len(poses.in_map))
    order = np.argsort(-sizes, kind="stable").tolist()
    part_numbers, frames = [0] * len(sizes), list[str | None]([None] * len(sizes))
    given = 0 if name != prior_frame else 1
    for rank, part in enumerate(order, start=1):
        part_numbers[part] = rank
        if poses.in_map[part]:
            frames[part] = prior_frame
        elif sizes[part] > 1 or len(poses.part) == 1:
            given += 1
            frames[part] = name if given == 1 else f"{name}.{given}"
    return part_numbers, frames


def map_pose_of(built: BuiltMap, number: int) -> MapPose | None:
    """The pose of a submap in the map, with its covariance about the submap's origin; None if nothing connects it."""
    frame = built.frames[built.poses.part[number]]
    if frame is None:
        return None
    pose = built.poses.pose(number)
    covariance = flat(built.poses.uncertainty(number).origin_covariance(pose))
    return MapPose(frame_id=frame, x=pose.x, y=pose.y, yaw=pose.yaw, covariance=covariance)
