"""Stem diameters: they help where they tell trees apart, and do no harm where they do not."""

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart import SE2, Config, Features, LandmarkError, Recognizer, describe
from urquhart.evaluation.simulation import Sensor, SimulatedObservation, observe, paper_forest, plantation
from urquhart.verify.diameters import score_diameter_pairs, standardize_diameters

CONFIG = Config()
POSE = SE2(60.0, 55.0, 0.3)
ELSEWHERE = SE2(61.0, 57.0, -2.0)


def stems(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Diameters, metres: as wide a spread as in an uneven-aged stand."""
    return np.exp(rng.normal(np.log(0.25), 0.45, count))


def measured(
    seen: SimulatedObservation, diameters: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    return diameters[seen.trees] * np.exp(rng.normal(0.0, 0.08, len(seen.trees)))


def observations(
    forest: NDArray[np.float64], seed: int, sigma: float = 0.1
) -> tuple[SimulatedObservation, SimulatedObservation, NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    diameters = stems(len(forest), rng)
    stored = observe(forest, POSE, Sensor(25.0, sigma=sigma, detection=0.95), rng)
    asked = observe(forest, ELSEWHERE, Sensor(25.0, sigma=sigma, detection=0.95), rng)
    return stored, asked, measured(stored, diameters, rng), measured(asked, diameters, rng)


def collection(stored: SimulatedObservation, diameters: NDArray[np.float64] | None) -> Recognizer:
    recognizer = Recognizer(CONFIG)
    recognizer.add([(0, describe(stored.xy, CONFIG, diameters))])
    return recognizer


@pytest.fixture(scope="module")
def forest() -> NDArray[np.float64]:
    return paper_forest(np.random.default_rng(5), 120.0)


def test_true_diameters_add_evidence_in_any_unit(forest: NDArray[np.float64]) -> None:
    stored, asked, there, here = observations(forest, 1)
    without = collection(stored, None).locate(asked.xy)
    metres = collection(stored, there).locate(asked.xy, diameters=here)
    inches = collection(stored, there).locate(asked.xy, diameters=here / 0.0254)
    assert metres.verdict == inches.verdict == without.verdict == "matched"
    assert metres.candidates[0].evidence > without.candidates[0].evidence + 5.0
    assert inches.candidates[0].evidence == pytest.approx(metres.candidates[0].evidence, abs=1e-3)


def test_diameters_on_one_side_or_of_a_few_trees_change_nothing(forest: NDArray[np.float64]) -> None:
    stored, asked, there, here = observations(forest, 2)
    few = np.full(len(here), np.nan)
    few[:5] = here[:5]
    evidence = collection(stored, None).locate(asked.xy).candidates[0].evidence
    for recognizer, diameters in (
        (collection(stored, None), here),
        (collection(stored, there), None),
        (collection(stored, there), few),
        (collection(stored, there), np.full(len(here), 0.3)),
    ):
        assert recognizer.locate(asked.xy, diameters=diameters).candidates[0].evidence == evidence


def test_shuffled_diameters_cost_a_right_pose_almost_nothing(forest: NDArray[np.float64]) -> None:
    for seed in range(5):
        stored, asked, there, here = observations(forest, seed)
        mixed = np.random.default_rng(seed).permutation(here)
        without = collection(stored, None).locate(asked.xy)
        shuffled = collection(stored, there).locate(asked.xy, diameters=mixed)
        assert shuffled.verdict == without.verdict == "matched"
        assert shuffled.candidates[0].evidence > without.candidates[0].evidence - 1.0


def test_shuffled_diameters_never_make_a_wrong_match() -> None:
    rng = np.random.default_rng(3)
    rows = plantation(90.0, 90.0, rng, jitter=0.15, survival=0.95)
    others = plantation(90.0, 90.0, rng, jitter=0.15, survival=0.95)
    diameters = stems(max(len(rows), len(others)), rng)
    stored = observe(rows, SE2(45.0, 45.0, 0.0), Sensor(20.0, sigma=0.1), rng)
    recognizer = collection(stored, measured(stored, diameters, rng))
    for _ in range(40):
        asked = observe(
            others, SE2(*rng.uniform((30.0, 30.0, -3.0), (60.0, 60.0, 3.0)).tolist()), Sensor(20.0, sigma=0.1), rng
        )
        found = recognizer.locate(asked.xy, diameters=rng.permutation(measured(asked, diameters, rng)))
        assert found.verdict != "matched"


def test_diameters_tell_the_rows_of_a_plantation_apart() -> None:
    """In a near-perfect lattice positions leave it open which row is which; stems of two species do not."""
    rng = np.random.default_rng(8)
    rows = plantation(120.0, 110.0, rng, jitter=0.05, survival=0.97)
    ambiguous = matched = 0
    for seed in range(8):
        stored, asked, there, here = observations(rows, seed, sigma=0.1)
        without = collection(stored, None).locate(asked.xy)
        found = collection(stored, there).locate(asked.xy, diameters=here)
        truth = POSE.inverse() @ ELSEWHERE
        for answer in (without, found):
            if answer.verdict == "matched":
                shift, turn = answer.candidates[0].transform.distance(truth)
                assert shift < 1.0
                assert turn < 0.05
        ambiguous += without.verdict == "ambiguous"
        matched += found.verdict == "matched"
    assert ambiguous >= 4
    assert matched >= 6


def test_evidence_from_unrelated_diameters_is_a_fair_bet() -> None:
    """A likelihood ratio has mean 1 under chance, and large ones are as rare as they must be."""
    rng = np.random.default_rng(4)
    pairs = np.arange(40)
    evidence = []
    for _ in range(2000):
        (a, spread_a), (b, spread_b) = (standardize_diameters(stems(40, rng).astype(np.float32)) for _ in range(2))
        evidence.append(score_diameter_pairs(a, spread_a, b, spread_b, pairs, pairs))
    values = np.array(evidence)
    assert values.min() > np.log(0.5) - 1e-9
    assert (values > 3.0).mean() < 2.0 * np.exp(-3.0)


def test_diameters_survive_packing_and_bad_ones_are_refused(forest: NDArray[np.float64]) -> None:
    stored, _, there, _ = observations(forest, 6)
    there[3] = np.nan
    features = describe(stored.xy, CONFIG, there)
    np.testing.assert_array_equal(Features.unpack(features.pack()).diameters, features.diameters)
    assert len(Features.unpack(describe(stored.xy, CONFIG).pack()).diameters) == 0
    for bad, code in (([1.0], "bad_diameters"), ("x", "bad_diameters"), (np.zeros(len(there)), "bad_diameters")):
        with pytest.raises(LandmarkError) as raised:
            describe(stored.xy, CONFIG, bad)
        assert raised.value.code == code
