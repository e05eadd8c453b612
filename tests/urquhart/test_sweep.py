"""The sweep finds a pattern when no feature of it is whole."""

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart import SE2, Config, Recognizer, describe
from urquhart.pairing import Pattern
from urquhart.simulation import Observation, observe, paper_forest
from urquhart.sweep import find_peaks, sweep
from urquhart.verification import LOOSE, REACH, pattern

CONFIG = Config()
NEAR = REACH * CONFIG.sigma


@pytest.fixture(scope="module")
def forest() -> NDArray[np.float64]:
    return paper_forest(np.random.default_rng(1), 400.0)


def laid(seen: Observation) -> tuple[Pattern, SE2]:
    features = describe(seen.xy, CONFIG)
    return pattern(features, NEAR), SE2.shift(features.origin)


def two(forest: NDArray[np.float64], seed: int, **noise: float) -> tuple[Observation, Observation, SE2]:
    rng = np.random.default_rng(seed)
    first = SE2(200.0, 200.0, float(rng.uniform(-3.0, 3.0)))
    second = SE2(220.0, 185.0, float(rng.uniform(-3.0, 3.0)))
    here, there = (observe(forest, pose, 50.0, rng, **noise) for pose in (first, second))
    return here, there, first.inverse() @ second


@pytest.mark.parametrize(
    "noise",
    [
        {},
        {"sigma": 0.2, "detection": 0.6},
        {"sigma": 0.4, "detection": 0.8},
        {"sigma": 0.1, "detection": 0.9, "clutter": 1.0},
    ],
)
def test_the_true_pose_is_the_highest_peak(forest: NDArray[np.float64], noise: dict[str, float]) -> None:
    right = 0
    for seed in range(6):
        here, there, truth = two(forest, seed, **noise)
        (submap, to_submap), (query, to_query) = laid(here), laid(there)
        peaks = sweep(query, submap, 8, LOOSE * NEAR)
        shift, turn = SE2(*peaks[0].tolist()).distance(to_submap.inverse() @ truth @ to_query)
        right += shift < 1.0 and turn < 0.05
    assert right >= 5


def test_peaks_are_distinct_places_and_the_order_of_landmarks_is_no_matter(forest: NDArray[np.float64]) -> None:
    here, there, _ = two(forest, 3, sigma=0.2, detection=0.8)
    peaks = find_peaks(there.xy, here.xy, 1.0, 16)
    assert 1 < len(peaks) <= 16
    for i, peak in enumerate(peaks):
        for other in peaks[:i]:
            shift, turn = SE2(*peak.tolist()).distance(SE2(*other.tolist()))
            assert shift > 1.0 or turn > 0.02
    mixed = find_peaks(there.xy, here.xy[np.random.default_rng(0).permutation(len(here.xy))], 1.0, 16)
    np.testing.assert_allclose(mixed[0], peaks[0])


@pytest.mark.parametrize("count", [3, 5, 20])
@pytest.mark.parametrize("scale", [0.01, 1.0, 1e4])
def test_odd_inputs_give_few_or_no_peaks_and_no_crash(count: int, scale: float) -> None:
    rng = np.random.default_rng(count)
    first, second = scale * rng.uniform(-1.0, 1.0, (count, 2)), scale * rng.uniform(-1.0, 1.0, (count, 2))
    for query, submap in ((first, second), (first, first), (first * [1.0, 1e-4], second)):
        peaks = find_peaks(query - query.mean(axis=0), submap - submap.mean(axis=0), 1.0, 4)
        assert peaks.shape[1] == 3
        assert len(peaks) <= 4
        assert np.isfinite(peaks).all()


def test_a_stand_half_seen_on_both_sides_is_recognised_by_it(forest: NDArray[np.float64]) -> None:
    levels = []
    for seed in range(8):
        here, there, truth = two(forest, seed, sigma=0.2, detection=0.6)
        recognizer = Recognizer(CONFIG)
        recognizer.add([(0, describe(here.xy, CONFIG))])
        found = recognizer.recognize(there.xy)
        if recognizer.check(there.xy, 0, truth).verdict == "matched":
            assert found.verdict == "matched"
            assert found.candidates[0].transform.distance(truth)[0] < 1.0
            levels.append(found.candidates[0].level)
    assert "sweep" in levels
