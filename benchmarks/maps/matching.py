"""Submaps matched with each other as the service does, and what a map of them is worth against the truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from urquhart import SE2, Config, Recognizer, describe
from urquhart.mapping.landmark_map import Association, MappedSubmap, build_landmark_map
from urquhart.mapping.optimisation import OptimisedPoses, optimise
from urquhart.mapping.pose_graph import PoseConstraint, PoseConstraints

Points = NDArray[np.float64]
PER_SUBMAP = 10
"""Candidates of each submap, as in the service."""
WRONG = (1.0, np.radians(5.0))
"""Metres and radians: a match that is farther off is a false one."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownSubmap:
    """A submap whose truth is known: landmarks (N, 2), metres, its frame; the tree (N,) of each; world_T_submap."""

    xy: Points
    trees: NDArray[np.int64]
    pose: SE2


@dataclass(frozen=True, slots=True, eq=False)
class MatchedSubmaps:
    """The matches of submaps, and which of them (E,) are false."""

    constraints: PoseConstraints
    false: NDArray[np.bool_]


def match_all(submaps: Sequence[KnownSubmap]) -> MatchedSubmaps:
    """Look each submap up in all others; one match for each pair, the one with more inliers."""
    config = Config()
    features = [describe(one.xy, config) for one in submaps]
    recognizer = Recognizer(config)
    recognizer.add(enumerate(features))
    best: dict[tuple[int, int], tuple[tuple[int, int], PoseConstraint]] = {}
    for number, one in enumerate(features):
        found = recognizer.recognize(one, exclude=[number], limit=PER_SUBMAP)
        found = recognizer.compare_each(one, found)
        for rank, candidate in enumerate(found.candidates if found.verdict == "matched" else ()):
            if candidate.refused is not None:
                continue
            constraint = PoseConstraint(
                candidate.key, number, candidate.transform, candidate.uncertainty, secondary=rank > 0
            )
            pair, worth = (
                (min(candidate.key, number), max(candidate.key, number)),
                (-min(rank, 1), len(candidate.residuals)),
            )
            if pair not in best or worth > best[pair][0]:
                best[pair] = worth, constraint
    constraints = [constraint for _, constraint in best.values()]
    return MatchedSubmaps(
        PoseConstraints.of(constraints), np.array([_is_false(submaps, one) for one in constraints], bool)
    )


def _is_false(submaps: Sequence[KnownSubmap], one: PoseConstraint) -> bool:
    """Whether the trees of the second submap come to lie elsewhere."""
    truth = submaps[one.first].pose.inverse() @ submaps[one.second].pose
    middle = submaps[one.second].xy.mean(axis=0)[None]
    shift = float(np.hypot(*(truth.apply(middle) - one.pose.apply(middle))[0]))
    return shift > WRONG[0] or truth.distance(one.pose)[1] > WRONG[1]


def map_figures(
    submaps: Sequence[KnownSubmap], matched: MatchedSubmaps, association: Association = "joint"
) -> tuple[dict[str, float], OptimisedPoses]:
    """A map of the submaps in figures, and its poses."""
    poses = optimise(len(submaps), matched.constraints)
    kept = np.array([reason is None for reason in poses.refusals], np.bool_)
    built = build_landmark_map([MappedSubmap(one.xy) for one in submaps], poses, association)
    pairs = zip(built.submaps.tolist(), built.indices.tolist(), strict=True)
    true_trees = np.array([submaps[s].trees[i] for s, i in pairs], np.int64)
    largest = int(np.argmax(np.bincount(poses.part)))
    chosen = np.flatnonzero(built.part == largest)
    entries = [true_trees[built.offsets[k] : built.offsets[k + 1]] for k in chosen.tolist()]
    entries = [entry for entry in entries if (entry >= 0).any()]
    main = [int(np.bincount(entry[entry >= 0]).argmax()) for entry in entries]
    there = len(np.unique([tree for tree in chain.from_iterable(entries) if tree >= 0]))
    return {
        "submaps": float(len(submaps)),
        "largest": float(np.bincount(poses.part).max()),
        "matches": float(len(kept)),
        "false": float(matched.false.sum()),
        "false_kept": float((matched.false & kept).sum()),
        "right_refused": float((~matched.false & ~kept).sum()),
        "scale": poses.scale,
        "trees": float(there),
        "doubled": float(len(main) - len(set(main))),
        "lost": float(there - len(set(main))),
        "mixed": float(sum(len(set(entry.tolist())) > 1 for entry in entries)),
        "error": _pose_error(submaps, poses, largest),
    }, poses


def _pose_error(submaps: Sequence[KnownSubmap], poses: OptimisedPoses, part: int) -> float:
    """Metres by which the trees of the part are off on average, in the frame of its first submap."""
    numbers = np.flatnonzero(poses.part == part).tolist()
    origin = submaps[numbers[0]].pose @ poses.pose(numbers[0]).inverse()
    off = [
        np.hypot(*((origin @ poses.pose(k)).apply(submaps[k].xy) - submaps[k].pose.apply(submaps[k].xy)).T).mean()
        for k in numbers
        if len(submaps[k].xy)
    ]
    return float(np.mean(off))
