"""Table II: submaps of a track merged in the order they were made, on real stem maps.

Each submap is matched with the map merged so far, which is described again every time; submaps in a row are known
to overlap, so no global gate is asked (as in the paper), and what RANSAC finds is taken. Measured are the true pairs of
trees in consecutive submaps: the distance that the alignment leaves between them, and how far the transform is from the
one that the true pairs themselves give.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.attempts import Verifier, agree
from benchmarks.paper.methods import Glarot, Li, Method, Paper, Points, Robust
from benchmarks.paper.tracks import LEVELS, MAPS, TrackSubmap, cut, read_maps, sensor_range
from benchmarks.pool import Pool
from urquhart import SE2, Config
from urquhart.evaluation.scores import Alignment, alignment_errors
from urquhart.mapping.map_merging import MergedMap, merge
from urquhart.paper.glarot import GlarotConfig

METHODS: Final = ("true pairs", "paper", "glarot-local", "li", "robust")
"""`true pairs` merges by the trees' identities: what the procedure itself allows."""
VERIFIED: Final = ("paper", "glarot-local", "li")
"""Methods that are also run with verification behind their RANSAC: the pose refined on all landmarks, and refused below
the gate; its submap is then left out."""
REACH: Final = 0.6
"""Ranges: how far GLARE looks about a tree. 30 m of 50 m in the simulation; a stand seen to 12 m needs less."""
PICTURED: Final = "lansing"
"""The map whose merged landmarks are drawn."""
OFF: Final = 1.0
"""Metres: a step whose true pairs stay farther apart on average is wrong, not merely inexact."""


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """The map so far: landmarks (L, 2), metres, map frame, and which tree (L,) each is (first member's)."""

    landmarks: Points
    trees: NDArray[np.int64]


Align = Callable[[Known, TrackSubmap], SE2 | None]
"""map_T_submap of the next submap, from the map so far."""


@dataclass(frozen=True, slots=True)
class Job:
    """One track through one file of a map at one level of noise, merged with one method."""

    level: str
    name: str
    part: int
    seed: int
    method: str
    verified: bool


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One submap joined to the map: (K,) metres left between its true pairs with the submap before; pose errors."""

    errors: NDArray[np.float64]
    reference: NDArray[np.float64]
    shift: float
    turn: float


@dataclass(frozen=True, slots=True, eq=False)
class Merging:
    """A track merged: its steps (None where no transform was found), how many trees were seen, landmarks of the map
    (L, 2), metres, in the first submap's frame, and how many of them hold one tree only.

    `alone` counts consecutive submaps matched with each other instead of with the map: asked and right. One wrong step
    spoils the map for those behind it; this tells what a method does when it starts clean every time.
    """

    steps: list[Step | None]
    alone: tuple[int, int]
    trees: int
    landmarks: Points
    pure: int


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Every map that is there, every method."""
    maps, missing = read_maps(("lansing", "bei") if quick else tuple(MAPS))
    seeds = (seed,) if quick else (seed, seed + 1, seed + 2)
    ways = [(method, False) for method in METHODS] + [(method, True) for method in VERIFIED]
    jobs = [
        Job(level, name, part, s, method, verified)
        for level in LEVELS
        for name, parts in maps.items()
        for part in range(len(parts))
        for s in seeds
        for method, verified in ways
    ]
    results = pool.map(run_job, jobs, "Table II")
    levels: dict[str, Any] = {}
    for level in LEVELS:
        levels[level] = {}
        for name in maps:
            levels[level][name] = {}
            for method, verified in ways:
                asked = (level, name, method, verified)
                chosen = [
                    r for j, r in zip(jobs, results, strict=True) if (j.level, j.name, j.method, j.verified) == asked
                ]
                levels[level][name][f"{method}, verified" if verified else method] = summary(chosen)
    sizes = {
        name: {"trees": [len(trees) for trees in parts], "range": [sensor_range(trees) for trees in parts]}
        for name, parts in maps.items()
    }
    picture = {}
    for job, result in zip(jobs, results, strict=True):
        if (job.level, job.name, job.seed, job.verified) == (list(LEVELS)[-1], PICTURED, seed, False):
            picture[job.method] = np.round(result.landmarks, 1).tolist()
    return {"seeds": list(seeds), "maps": sizes, "levels": levels, "missing": missing, "picture": picture}


def run_job(job: Job) -> Merging:
    """Cut the track and merge it."""
    maps, _ = read_maps((job.name,))
    trees = maps[job.name][job.part]
    submaps = cut(trees, *LEVELS[job.level], np.random.default_rng([job.seed, 7, job.part]))
    rng = np.random.default_rng([job.seed, 8, job.part])
    reach = REACH * sensor_range(trees)
    return merge_track(submaps, aligner(job.method, job.verified, Config(), reach, rng), rng)


def aligner(method: str, verified: bool, config: Config, reach: float, rng: np.random.Generator) -> Align:
    """How a method joins a submap to the map so far; `reach` (metres) is GLARE's."""
    if method == "true pairs":

        def cheat(known: Known, submap: TrackSubmap) -> SE2 | None:
            _, first, second = np.intersect1d(known.trees, submap.trees, return_indices=True)
            return _fit(known.landmarks, submap.xy, first, second, config, rng)

        return cheat
    if method == "robust":
        robust = Robust(config)

        def ask(known: Known, submap: TrackSubmap) -> SE2 | None:
            answer = robust.answer(submap.xy, robust.describe(known.landmarks))
            return answer.transform if answer.matched else None

        return ask
    glarot = Glarot(GlarotConfig(reach=reach))
    methods: dict[str, Method] = {"paper": Paper(config), "glarot-local": glarot, "li": Li((100.0,))}
    chosen = methods[method]

    def match(known: Known, submap: TrackSubmap) -> SE2 | None:
        second, first = chosen.match(chosen.describe(submap.xy), chosen.describe(known.landmarks), rng)[method]
        found = _fit(known.landmarks, submap.xy, first, second, config, rng)
        if found is None or not verified:
            return found
        pose, passed = Verifier([known.landmarks, submap.xy], config).refine(0, 1, found)
        return pose if passed else None

    return match


def merge_track(submaps: Sequence[TrackSubmap], align: Align, rng: np.random.Generator) -> Merging:
    """Join submaps one after the other; one without a transform is left out, and so is the step after it."""
    poses: list[SE2 | None] = [SE2.identity()]
    placed = [0]
    known, _ = _merge(submaps, poses, placed)
    steps: list[Step | None] = []
    for k in range(1, len(submaps)):
        pose = align(known, submaps[k])
        poses.append(pose)
        if pose is not None:
            placed.append(k)
            known, _ = _merge(submaps, poses, placed)
        before = poses[k - 1]
        relative = None if pose is None or before is None else before.inverse() @ pose
        steps.append(None if relative is None else judge(submaps[k - 1], submaps[k], relative, rng))
    known, pure = _merge(submaps, poses, placed)
    trees = len(np.unique(np.concatenate([submaps[k].trees for k in placed])))
    return Merging(steps, _one_by_one(submaps, align, rng), trees, known.landmarks, pure)


def _one_by_one(submaps: Sequence[TrackSubmap], align: Align, rng: np.random.Generator) -> tuple[int, int]:
    right = 0
    for before, after in pairwise(submaps):
        relative = align(Known(before.xy, before.trees), after)
        right += relative is not None and bool(judge(before, after, relative, rng).errors.mean() < OFF)
    return len(submaps) - 1, right


def judge(first: TrackSubmap, second: TrackSubmap, first_T_second: SE2, rng: np.random.Generator) -> Step:
    """A transform between consecutive submaps against the one that their true pairs give by the same RANSAC.

    As in the paper, the pairs looked at are those that RANSAC calls inliers of the true transform.
    """
    _, a, b = np.intersect1d(first.trees, second.trees, return_indices=True)
    config = Config()
    consensus = agree(second.xy, first.xy, (b, a), config, rng)
    if consensus is None:
        raise ValueError("consecutive submaps share no trees: the track is cut too coarsely")
    mine, theirs = first.xy[a[consensus.inliers]], second.xy[b[consensus.inliers]]
    shift, turn = first_T_second.distance(consensus.transform)
    # The frames' origins lie at the start of each stretch, so a rotation error does not hide in a far translation.
    return Step(
        alignment_errors(mine, theirs, first_T_second),
        alignment_errors(mine, theirs, consensus.transform),
        shift,
        math.degrees(turn),
    )


def summary(merged: Sequence[Merging]) -> dict[str, Any]:
    """Figures of several tracks pooled: errors over all true pairs of all steps that were made."""
    steps = [step for merging in merged for step in merging.steps]
    made = [step for step in steps if step is not None]
    errors = Alignment.over(np.concatenate([np.empty(0), *(step.errors for step in made)]))
    reference = Alignment.over(np.concatenate([np.empty(0), *(step.reference for step in made)]))
    right = [step for step in made if step.errors.mean() < OFF]
    return {
        "steps": len(steps),
        "made": len(made),
        "right": len(right),
        "alone": sum(merging.alone[1] for merging in merged),
        "mean": errors.mean,
        "least": errors.least,
        "most": errors.most,
        "reference_mean": reference.mean,
        "reference_most": reference.most,
        "pairs": errors.pairs,
        "translation": float(np.mean([step.shift for step in made])) if made else math.nan,
        "rotation": float(np.mean([step.turn for step in made])) if made else math.nan,
        "trees": sum(merging.trees for merging in merged),
        "landmarks": sum(len(merging.landmarks) for merging in merged),
        "pure": sum(merging.pure for merging in merged),
    }


def _fit(
    first: Points,
    second: Points,
    pairs_first: NDArray[np.int64],
    pairs_second: NDArray[np.int64],
    config: Config,
    rng: np.random.Generator,
) -> SE2 | None:
    consensus = agree(second, first, (pairs_second, pairs_first), config, rng)
    return None if consensus is None else consensus.transform


def _merge(submaps: Sequence[TrackSubmap], poses: Sequence[SE2 | None], placed: Sequence[int]) -> tuple[Known, int]:
    """The map of the submaps placed so far, and how many of its landmarks hold one tree only."""
    known = [(submaps[k], pose) for k in placed if (pose := poses[k]) is not None]
    merged: MergedMap = merge([submap.xy for submap, _ in known], [pose for _, pose in known])
    starts = np.cumsum([0, *(len(submap.xy) for submap, _ in known)])
    trees = np.concatenate([submap.trees for submap, _ in known])[starts[merged.submaps] + merged.indices]
    first, last = np.minimum.reduceat(trees, merged.offsets[:-1]), np.maximum.reduceat(trees, merged.offsets[:-1])
    return Known(merged.landmarks, trees[merged.offsets[:-1]]), int((first == last).sum())
