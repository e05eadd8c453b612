"""Several keyframes in a row as one query: what they decide that one of them leaves open, and what is false."""

from collections import Counter
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from benchmarks.pool import Pool
from urquhart import SE2, Config, Recognizer
from urquhart.evaluation.simulation import Sensor, observe, paper_forest, plantation
from urquhart.features.describe import describe
from urquhart.features.keyframes import Keyframe, join_keyframes

SIDE: Final = 200.0
STORED: Final = Sensor(30.0, sigma=0.05, detection=0.95)
STEP: Final = 6.0
"""Metres between keyframes."""
ODOMETRY: Final = (0.1, 0.1, 0.015)
"""Metres and radians: standard deviations of a step of odometry."""
STANDS: Final = {"forest": None, "rows, jitter 0.3 m": (0.3, 0.9), "rows, jitter 0.15 m": (0.15, 0.95)}
RADII: Final = (9.0, 12.0)
VIEWS: Final = (1, 3, 5)
SEQUENCES: Final = 20
"""Of each stand."""


@dataclass(frozen=True, slots=True)
class SequenceJob:
    """One stand, and whether the sequences are from it or from another stand of its kind."""

    stand: str
    radius: float
    inside: bool
    seed: int


def run_job(job: SequenceJob) -> dict[str, float]:
    """Ask for sequences: how often each number of views is matched, rightly or not, or ambiguous."""
    rng = np.random.default_rng([job.seed, round(job.radius), len(job.stand)])
    stands = []
    for _ in range(2):
        planted = STANDS[job.stand]
        stands.append(
            paper_forest(rng, SIDE)
            if planted is None
            else plantation(SIDE, SIDE, rng, jitter=planted[0], survival=planted[1])
        )
    recognizer, places = Recognizer(Config()), dict[int, SE2]()
    steps = np.arange(STORED.radius, SIDE - STORED.radius + 1.0, 20.0)
    for number, (x, y) in enumerate((float(x), float(y)) for x in steps for y in steps):
        places[number] = SE2(x, y, float(rng.uniform(-np.pi, np.pi)))
        seen = observe(stands[0], places[number], STORED, rng)
        recognizer.add([(number, describe(seen.xy, Config()))])
    counts = Counter[str]()
    sensor = Sensor(job.radius, sigma=0.1, detection=0.9)
    for _ in range(SEQUENCES):
        x, y = rng.uniform(50.0, SIDE - 50.0, 2).tolist()
        start, at, views = SE2(x, y, float(rng.uniform(-np.pi, np.pi))), SE2.identity(), list[Keyframe]()
        for number in range(max(VIEWS)):
            if number:
                error = rng.normal(size=3) * ODOMETRY
                at = at @ SE2(STEP + error[0], error[1], error[2])
            place = start @ SE2(STEP * number, 0.0, 0.0)
            views.append(Keyframe(observe(stands[0 if job.inside else 1], place, sensor, rng).xy, at))
        for count in VIEWS:
            found = recognizer.locate(join_keyframes(views[:count]).xy)
            verdict = str(found.verdict)
            if verdict == "matched":
                best = found.candidates[0]
                shift, turn = (places[best.key] @ best.transform).distance(start)
                verdict = "right" if job.inside and shift < 1.5 and turn < 0.1 else "wrong"
            counts[f"{verdict} {count}"] += 1
    return {name: float(counts[name]) for name in (f"{v} {n}" for v in ("right", "wrong", "ambiguous") for n in VIEWS)}


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Every stand and radius, with sequences from it and from another one of its kind."""
    cells = [(stand, radius, inside) for stand in STANDS for radius in RADII for inside in (True, False)]
    jobs = [SequenceJob(*cell, seed + k) for cell in cells for k in range(1 if quick else 3)]
    results = pool.map(run_job, jobs, "sequences")
    rows = []
    for cell in cells:
        some = [r for job, r in zip(jobs, results, strict=True) if (job.stand, job.radius, job.inside) == cell]
        row: dict[str, Any] = {"stand": cell[0], "radius": cell[1], "inside": cell[2]}
        rows.append(row | {name: sum(one[name] for one in some) for name in some[0]} | {"count": SEQUENCES * len(some)})
    return {"rows": rows}
