"""What an index holds and what it answers, in a form that two of them can be compared by."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from tests.urquhart.tables import decode
from urquhart import SE2, Config, Features, Recognition, Recognizer, describe
from urquhart.evaluation.simulation import Sensor, observe, paper_forest
from urquhart.index.collection_index import CollectionIndex, LiveSegment
from urquhart.index.segment import Segment
from urquhart.index.submap_collection import FeatureMemory

CONFIG = Config()
FOREST = paper_forest(np.random.default_rng(3), 300.0)


def place(key: int, seed: int = 0) -> Features:
    """One of 36 overlapping submaps of a forest by key, seen again with every seed."""
    pose = SE2(60.0 + 36.0 * (key % 6), 60.0 + 36.0 * (key // 6 % 6), 0.4 * key)
    rng = np.random.default_rng([key, seed])
    return describe(observe(FOREST, pose, Sensor(36.0, sigma=0.05, detection=0.95), rng).xy, CONFIG)


def observations(count: int) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    """What is seen from somewhere in that forest; the last two from outside of it."""
    seen = []
    for seed in range(count):
        rng = np.random.default_rng(100 + seed)
        x, y, yaw = rng.uniform((60.0, 60.0, -3.0), (240.0, 240.0, 3.0)).tolist()
        forest = FOREST if seed < count - 2 else paper_forest(rng, 300.0)
        seen.append(observe(forest, SE2(x, y, yaw), Sensor(36.0, sigma=0.15, detection=0.9), rng).xy)
    return seen


def contents(index: CollectionIndex) -> tuple[list[int], Counter[tuple[int, ...]], Counter[tuple[int, int, bytes]]]:
    """Keys, quads and polygons of all that lives, wherever it lies."""
    quads, polygons = Counter[tuple[int, ...]](), Counter[tuple[int, int, bytes]]()
    for part in index.live_segments:
        keys = part.segment.keys.tolist()
        for *quad, slot in decode(part.segment.quads).rows():
            if part.alive[slot]:
                quads[(keys[slot], *quad)] += 1
        for count, partition in part.segment.polygons.items():
            rows = partition.rows()
            for row, owner in enumerate(partition.owners.tolist()):
                if part.alive[owner]:
                    polygons[keys[owner], count, partition.outlines[row].tobytes() + rows[row].tobytes()] += 1
    return sorted(index), quads, polygons


def of_segments(segments: Iterable[Segment], config: Config = CONFIG) -> CollectionIndex:
    """An index over all of these segments."""
    return CollectionIndex(config, tuple(LiveSegment.of(segment) for segment in segments))


def over(index: CollectionIndex, features: dict[int, Features]) -> Recognizer:
    """A recognizer over an index, with features kept elsewhere."""
    return Recognizer(index.config, index, FeatureMemory(features))


def outline(found: Recognition) -> tuple[object, ...]:
    """An answer but for its times."""
    return (
        found.verdict,
        found.reason,
        found.lead,
        [(c.key, c.level, c.support, c.evidence, c.query_indices.tobytes()) for c in found.candidates],
        [(stage.name, stage.counts) for stage in found.stages],
    )


def answers(recognizer: Recognizer, seen: Sequence[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]) -> list[object]:
    """What is answered to each observation."""
    return [outline(recognizer.locate(xy, limit=8)) for xy in seen]


def conclusions(
    recognizer: Recognizer, seen: Sequence[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]
) -> list[tuple[object, ...]]:
    """The same without what depends on the order of the search, which what is dead has a say in."""
    told: list[tuple[object, ...]] = []
    for xy in seen:
        found = recognizer.locate(xy)
        best = found.candidates[:1] if found.verdict == "matched" else ()
        told.append((found.verdict, *((c.key, round(c.evidence, 6), c.query_indices.tobytes()) for c in best)))
    return told
