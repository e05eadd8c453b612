"""After a warm-up everything that a look-up may need has been compiled."""

import subprocess
import sys

WARM = """
import sys
import tempfile
from pathlib import Path
import numpy as np
from numba.core.dispatcher import Dispatcher
from urquhart import SE2, Config, Features, Prior, Recognizer, describe, warm_up
from urquhart.warming import compile_largest, warm_up_paper
from urquhart.index.collection_index import CollectionIndex, LiveSegment
from urquhart.index.segment import merge_segments
from urquhart.evaluation.simulation import Sensor, observe, paper_forest, plantation

def compiled():
    modules = [m for name, m in list(sys.modules.items()) if name.startswith("urquhart")]
    kernels = {id(k): k for m in modules for k in vars(m).values() if isinstance(k, Dispatcher)}
    return {k.__name__: len(k.signatures) for k in kernels.values() if k.__module__ != "urquhart.evaluation.simulation"}

warm_up(Config())
warm_up_paper(Config())
before = compiled()
compile_largest()
assert compiled() == before, "the second process compiles for types that nobody calls"
rng = np.random.default_rng(0)
for trees, radius in ((plantation(90.0, 90.0, rng), 20.0), (paper_forest(rng, 250.0), 40.0)):
    middle = float(np.median(trees))
    recognizer = Recognizer(Config())
    few = Config(survey=12)  # a survey tries all of some collections, and a part of others
    surveyed = Recognizer(few)
    for key in range(12):
        features = describe(observe(trees, SE2(middle + key, middle, 0.0), Sensor(radius), rng).xy, Config())
        recognizer.add([(key, Features.unpack(features.pack()) if key % 2 else features)])
        surveyed.add([(key, features)])
    alone = Recognizer(Config())
    alone.add([(0, features)])
    for sigma in (0.05, 0.3, 2.0):
        xy = observe(trees, SE2(middle, middle, 1.0), Sensor(radius, sigma, 0.8), rng).xy
        surveyed.locate(xy)
        for method in ("robust", "paper"):
            recognizer.locate(xy, method=method, exclude=[3])
            recognizer.locate(xy.tolist(), method=method)
            # Nor is what cannot be written: positions as they are read from a database.
            recognizer.locate(np.frombuffer(xy.tobytes()).reshape(-1, 2), method=method)
            alone.locate(xy, method=method)
        for thick in (None, rng.uniform(10.0, 50.0, len(xy))):
            prior = Prior.with_sigma(middle, middle, 0.5, 1.0)
            here = {key: SE2(middle + key, middle, 0.0) for key in range(12)}
            recognizer.recognize_within(describe(xy, Config(), thick), prior, here)
    # What is mapped from a file is no other type to the compiler.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.segment"
        parts = recognizer.index.live_segments
        mapped = merge_segments([(part.segment, part.alive) for part in parts], path)
        index = CollectionIndex(Config(), (LiveSegment.of(mapped),)).with_changes(removed=[5])
        stored = Recognizer(Config(), index, recognizer._held[1])
        for sigma in (0.05, 2.0):
            xy = observe(trees, SE2(middle, middle, 1.0), Sensor(radius, sigma, 0.8), rng).xy
            for method in ("robust", "paper"):
                stored.locate(xy, method=method, only=range(9))
        merge_segments([(mapped, index.live_segments[0].alive)], path)
print({name: (before.get(name), count) for name, count in compiled().items() if before.get(name) != count})
"""


def test_after_the_warm_up_no_query_waits_for_the_compiler() -> None:
    done = subprocess.run([sys.executable, "-c", WARM], capture_output=True, text=True, check=True, timeout=240)
    assert done.stdout.strip() == "{}"
