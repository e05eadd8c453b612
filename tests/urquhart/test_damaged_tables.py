"""Tables whose content is wrong, as in a file that was damaged: nothing is read or written out of bounds."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import urquhart
from tests.urquhart.tables import described, shard_of, stand

SCRIPT = """
import pickle
import sys
import numpy as np
from urquhart.propose.quad_consensus import QuadConsensus
from urquhart.index.quad_search import QuadShard
from urquhart.index.quad_table import QuadTable, count_living, measure_quads, merge_tables

sound, landmarks, quads = pickle.load(open(sys.argv[1], "rb"))
rng = np.random.default_rng(0)
whole = np.iinfo(sound.table.starts.dtype)


def damaged():
    codes, starts, words = sound.table.codes, sound.table.starts, sound.table.words
    anything = rng.integers(0, 1 << 64, len(words), np.uint64)
    chosen = rng.random(len(words)) < 0.1
    yield codes, starts, np.where(chosen, words | np.uint64(0x1FFFFFF << 39), words)
    yield codes, starts, np.where(chosen, anything, words)
    yield codes, starts, anything
    yield codes, starts, np.full_like(words, np.iinfo(np.uint64).max)
    for bounds in ((whole.min, whole.max), (0, 3 * len(words)), (0, len(words))):
        yield codes, rng.integers(*bounds, len(starts), starts.dtype, endpoint=True), words
        some = np.where(rng.random(len(starts)) < 0.1, rng.integers(*bounds, len(starts), starts.dtype), starts)
        yield codes, some, words
    yield codes, starts[::-1].copy(), words
    yield codes, np.full_like(starts, whole.max), words
    yield codes, np.full_like(starts, whole.min), words
    yield codes, starts + starts.dtype.type(1000), words
    for low, high in ((-(1 << 63), (1 << 63) - 1), (0, 1 << 60), (int(codes.min()), int(codes.max()))):
        yield rng.integers(low, high, len(codes), np.int64, endpoint=True), starts, words
        yield np.sort(rng.integers(low, high, len(codes), np.int64, endpoint=True)), starts, words
    yield codes[::-1].copy(), starts, words
    yield rng.permutation(codes), starts, words
    for _ in range(6):
        yield np.where(rng.random(len(codes)) < 0.5, rng.permutation(codes), codes), starts, words
    yield np.full_like(codes, codes[0]), starts, words
    yield codes, starts, words[: len(words) // 2].copy()


def look(shards, tolerance):
    search = QuadConsensus(shards, measure_quads(landmarks, quads), tolerance, 100_000)
    search.advance(0.5)
    search.advance()
    best = search.leaders(5, 4)
    assert ((best.slots >= 0) & (best.slots < sum(len(shard.alive) for shard in shards))).all()
    assert np.isfinite(best.poses[:, 0]).all()
    assert np.isfinite(best.scores).all()
    slots, rotations = search.turns(20)
    assert np.isfinite(rotations).all()
    return best.slots.tolist()


slots = np.array([2, -1, 0], np.int32)
cases = 0
for codes, starts, words in damaged():
    bad = QuadTable(codes, starts, words)
    for tolerance in (0.1, 0.75):
        look([QuadShard(bad, sound.scales, sound.alive)], tolerance)
        # A sound table beside it is searched as ever.
        assert 3 in look([QuadShard(bad, sound.scales, sound.alive), sound], tolerance)
    merged = merge_tables([(bad, slots), (sound.table, slots)])
    assert len(merged.starts) == len(merged.codes) + 1
    assert merged.starts[-1] == len(merged.words)
    assert ((merged.words >> np.uint64(39)) < 3).all()
    cases += 1
# The bounds are really watched: a kernel that is given too short an array says so.
whole = sound.table
try:
    count_living(whole.codes, whole.arrays, slots, np.zeros(1, np.int64))
except IndexError:
    print("watched", cases)
"""


def test_damaged_tables_are_searched_and_merged_within_bounds(tmp_path: Path) -> None:
    # A cache of its own, kept for the next run: what is compiled without watching bounds would be loaded otherwise. The
    # tables are built here, by kernels that are compiled already.
    cache = Path(urquhart.__file__).parent / "__pycache__" / "watched"
    watched = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(cache)}
    query = stand(0)
    tables = tmp_path / "tables"
    sound = shard_of([query, described(1), stand(2)])
    tables.write_bytes(pickle.dumps((sound, query.landmarks, query.tessellation.quads)))
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, tables], capture_output=True, text=True, env=watched, timeout=280
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["watched", "30"]
