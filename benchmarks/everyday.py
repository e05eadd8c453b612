"""Describe, query and ingest at the size of one robot's day: 100-landmark observations of the paper's forest."""

import math
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from benchmarks.timing import milliseconds, side_by_side
from server.collections import crud
from server.schemas.collections import CollectionPut
from server.schemas.submaps import NamedSubmap
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps import bulk_ingest
from urquhart import SE2, Config, Features, Recognizer, describe
from urquhart.evaluation.simulation import Sensor, observe, paper_forest
from urquhart.features.describe import local_density
from urquhart.features.landmark_checks import check_landmarks
from urquhart.features.polygon_descriptor import describe_outlines
from urquhart.features.tessellation import tessellate

RADIUS = 50.0
SPACING = 50.0
CONFIG = Config()


@dataclass(frozen=True, slots=True)
class Forest:
    """The paper's forest cut into discs on a square grid, each in its own frame."""

    trees: NDArray[np.float64]
    poses: list[SE2]
    submaps: list[NDArray[np.float64]]

    @staticmethod
    def grow(side: float, rng: np.random.Generator) -> "Forest":
        trees = paper_forest(rng, side)
        centres = np.arange(RADIUS, side - RADIUS + 1.0, SPACING)
        poses = [SE2(float(x), float(y), 0.0) for x in centres for y in centres]
        return Forest(trees, poses, [observe(trees, pose, Sensor(RADIUS), rng).xy for pose in poses])

    def look(self, rng: np.random.Generator, sigma: float, detection: float) -> tuple[SE2, NDArray[np.float64]]:
        """A fresh observation: pose and landmarks."""
        low, high = self.trees.min(axis=0) + RADIUS, self.trees.max(axis=0) - RADIUS
        x, y = rng.uniform(low, high).tolist()
        pose = SE2(x, y, float(rng.uniform(-np.pi, np.pi)))
        return pose, observe(self.trees, pose, Sensor(RADIUS, sigma=sigma, detection=detection), rng).xy


def describe_cost(rng: np.random.Generator, repeats: int = 1500) -> dict[str, float]:
    """Milliseconds to describe 100 landmarks, by part, and the ratio to SciPy's Delaunay alone in the same run."""
    xy = rng.uniform(-RADIUS, RADIUS, (100, 2))
    features = describe(xy, CONFIG)
    landmarks, t, blob = features.landmarks, features.tessellation, features.pack()
    whole, delaunay, ratio = side_by_side(lambda: describe(xy, CONFIG), lambda: Delaunay(landmarks), repeats)
    return {
        "describe": whole,
        "Delaunay alone": delaunay,
        "ratio": ratio,
        "check": milliseconds(lambda: check_landmarks(xy), repeats),
        "tessellate": milliseconds(lambda: tessellate(landmarks), repeats),
        "descriptors": milliseconds(
            lambda: describe_outlines(landmarks, t.vertices, t.vertex_offsets, CONFIG.samples, CONFIG.squared), repeats
        ),
        "density": milliseconds(lambda: local_density(landmarks, t.triangles), repeats),
        "pack": milliseconds(features.pack, repeats),
        "unpack": milliseconds(lambda: Features.unpack(blob), repeats),
        "bytes": float(len(blob)),
    }


@dataclass(frozen=True, slots=True)
class QueryCost:
    """Medians over many queries: milliseconds in all and by stage, and how the answers came out."""

    total: float
    p95: float
    stages: dict[str, float]
    matched: int
    right: int
    asked: int


def query_cost(
    recognizer: Recognizer,
    forest: Forest,
    rng: np.random.Generator,
    *,
    sigma: float,
    detection: float,
    foreign: Forest | None = None,
    asked: int = 200,
) -> QueryCost:
    """Time queries in `forest`'s database with observations of it, or of `foreign`."""
    totals, by_stage = [], dict[str, list[float]]()
    matched = right = 0
    for _ in range(asked):
        pose, xy = (foreign or forest).look(rng, sigma, detection)
        start = time.perf_counter()
        found = recognizer.locate(xy)
        totals.append((time.perf_counter() - start) * 1e3)
        spent: dict[str, float] = {}
        for stage in found.stages:
            spent[stage.name] = spent.get(stage.name, 0.0) + stage.milliseconds
        for name, value in spent.items():
            by_stage.setdefault(name, []).append(value)
        if found.verdict == "matched":
            matched += 1
            best = found.candidates[0]
            shift, turn = (forest.poses[best.key] @ best.transform).distance(pose)
            right += int(foreign is None and shift < 1.0 and turn < math.radians(3.0))
    stages = {name: median(values) for name, values in by_stage.items()}
    return QueryCost(median(totals), float(np.percentile(totals, 95)), stages, matched, right, asked)


def build(forest: Forest) -> tuple[Recognizer, float, float]:
    """The recognizer of a forest, and seconds to describe and to index it."""
    start = time.perf_counter()
    features = [describe(xy, CONFIG) for xy in forest.submaps]
    described = time.perf_counter()
    recognizer = Recognizer(CONFIG)
    recognizer.add(enumerate(features))
    return recognizer, described - start, time.perf_counter() - described


def ingest_rate(forest: Forest, batch_size: int = 500) -> tuple[float, float]:
    """Submaps a second into a database file through the service's bulk path, and bytes on disk per submap."""

    def submaps() -> Iterator[NamedSubmap]:
        for i, xy in enumerate(forest.submaps):
            yield NamedSubmap(id=f"s{i}", xy=[tuple(point) for point in xy.tolist()])

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.db"
        database = Database(path)
        try:
            migrations_runner.upgrade(database)
            crud.ensure(database, "bench", CollectionPut())
            start = time.perf_counter()
            stored = sum(
                batch.created for batch in bulk_ingest.ingest_many(database, "bench", submaps(), batch_size=batch_size)
            )
            seconds = time.perf_counter() - start
        finally:
            database.dispose()
        return stored / seconds, path.stat().st_size / stored
