import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart import forests
from urquhart import Config, Features, describe
from urquhart.quad_index import STEP, QuadHits, QuadIndex
from urquhart.quads import align_quads, measure

Measured = tuple[NDArray[np.float32], NDArray[np.float32]]


def described(seed: int) -> Features:
    return describe(forests.uniform(np.random.default_rng(seed), 60, 60.0), Config())


def measured(features: Features) -> Measured:
    return measure(features.landmarks, features.tessellation.quads)


def brute_force(stored: dict[int, Measured], query: Measured, tolerance: float) -> set[tuple[int, int, int, bool]]:
    found = set()
    for key, (lengths, _) in stored.items():
        kept = np.round(lengths / STEP) * STEP
        for q, wanted in enumerate(query[0]):
            for turned in (False, True):
                reading = wanted[[2, 3, 0, 1, 4]] if turned else wanted
                for ordinal in np.flatnonzero((np.abs(kept - reading) <= tolerance).all(axis=1)).tolist():
                    found.add((q, key, ordinal, turned))
    return found


def as_set(hits: QuadHits) -> set[tuple[int, int, int, bool]]:
    return set(zip(hits.quads.tolist(), hits.keys.tolist(), hits.ordinals.tolist(), hits.turned.tolist(), strict=True))


@pytest.mark.parametrize("tolerance", [0.1, 0.3, 0.5])
def test_finds_exactly_what_brute_force_finds(tolerance: float) -> None:
    stored = {key: measured(described(key)) for key in range(25)}
    index = QuadIndex()
    for key, values in stored.items():
        index.add([(key, *values)])
    seen = described(7).landmarks
    query = measured(describe(seen + np.random.default_rng(0).normal(0.0, 0.05, seen.shape), Config()))
    hits = index.search(*query, tolerance, 10**9)
    expected = brute_force(stored, query, tolerance)
    # float32 and whole centimetres: a length that lies on the tolerance to the last digit may fall either way.
    assert len(as_set(hits) ^ expected) <= 2 + len(expected) // 1000
    assert len(hits.quads) == len(as_set(hits))
    assert len(hits.quads) > 0


def test_removed_submaps_are_never_found_and_go_with_the_next_merge() -> None:
    index = QuadIndex()
    total = 0
    for key in range(30):
        index.add([(key, *measured(described(key)))])
        total += len(described(key).tessellation.quads)
    assert len(index) == total
    assert index.remove({3, 4, 5, 99}) == 3
    query = measured(described(4))
    assert not {3, 4, 5} & set(index.search(*query, 0.5, 10**9).keys.tolist())
    index.add([(key, *measured(described(key))) for key in range(100, 140)])
    assert len(index) < total + sum(len(described(key).tessellation.quads) for key in range(100, 140))
    assert not {3, 4, 5} & set(index.search(*query, 0.5, 10**9).keys.tolist())


def test_past_the_limit_the_commonest_shapes_go_first() -> None:
    index = QuadIndex()
    index.add([(key, *measured(described(key))) for key in range(20)])
    query = measured(described(0))
    every = index.search(*query, 0.5, 10**9)
    few = index.search(*query, 0.5, 50)
    assert len(few.quads) == 50 < len(every.quads)
    commonness = np.bincount(every.quads, minlength=len(query[0]))
    assert commonness[few.quads].max() <= np.sort(commonness[every.quads])[50]


def test_an_empty_index_finds_nothing() -> None:
    assert len(QuadIndex().search(*measured(described(0)), 0.5, 100).quads) == 0


@pytest.mark.parametrize("seed", range(10))
def test_a_hit_is_a_full_transform(seed: int) -> None:
    """Every quad of a moved copy finds itself, with the rotation and the alignment of the motion."""
    rng = np.random.default_rng(seed)
    original = described(seed)
    motion = forests.pose(rng, -30.0, 30.0)
    moved = describe(motion.apply(original.landmarks), Config())
    index = QuadIndex()
    index.add([(1, *measured(moved))])
    hits = index.search(*measured(original), 0.02, 10**9)
    transforms, misfit = align_quads(
        original.landmarks,
        original.tessellation.quads,
        moved.landmarks,
        moved.tessellation.quads,
        hits.quads,
        hits.ordinals,
        hits.turned,
    )
    right = misfit < 0.02
    assert len(set(hits.quads[right].tolist())) == len(original.tessellation.quads)
    turn = (transforms[right, 2] - motion.yaw + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(turn).max() < 1e-6
    free = (hits.rotations[right] - motion.yaw + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(free).max() < 1e-3
