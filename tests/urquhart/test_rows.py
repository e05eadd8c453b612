"""Plantations: trees in rows look alike everywhere, and a pose that is one row off explains nearly as much."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart import forests
from urquhart import SE2, Config, Recognition, Recognizer, describe
from urquhart.simulation import observe, plantation

SIDE = 90.0
CENTRES = [SE2(x, y, 0.4 * k) for k, (x, y) in enumerate((x, y) for x in range(20, 90, 12) for y in range(20, 90, 12))]


def stored(trees: NDArray[np.float64], poses: Sequence[SE2], radius: float, rng: np.random.Generator) -> Recognizer:
    recognizer = Recognizer(Config())
    recognizer.add(
        (key, describe(observe(trees, pose, radius, rng, sigma=0.03, detection=0.98).xy, Config()))
        for key, pose in enumerate(poses)
    )
    return recognizer


def is_right(found: Recognition, poses: Sequence[SE2], truth: SE2) -> bool:
    best = found.candidates[0]
    shift, turn = (poses[best.key] @ best.transform).distance(truth)
    return shift < 1.0 and turn < 0.05


@pytest.mark.parametrize(
    ("spacing", "jitter", "survival", "least", "most"),
    [
        # Planted by machine: nothing tells one row from the next, and it is said so.
        ((3.0, 3.0), 0.0, 1.0, 0, 0),
        ((2.5, 3.5), 0.0, 0.97, 0, 2),
        ((3.0, 3.0), 0.03, 0.97, 0, 10),
        # Planted by hand: ten centimetres of each tree are enough.
        ((3.0, 3.0), 0.1, 0.97, 15, 20),
        ((2.5, 3.5), 0.15, 0.95, 18, 20),
        ((2.0, 4.0), 0.2, 0.9, 18, 20),
    ],
)
def test_in_rows_what_is_matched_is_right(
    spacing: tuple[float, float], jitter: float, survival: float, least: int, most: int
) -> None:
    rng = np.random.default_rng(5)
    trees = plantation(SIDE, SIDE, rng, spacing=spacing, jitter=jitter, survival=survival)
    recognizer = stored(trees, CENTRES, 20.0, rng)
    right = 0
    for _ in range(20):
        pose = forests.pose(rng, 20.0, 70.0)
        found = recognizer.recognize(observe(trees, pose, 20.0, rng, sigma=0.05, detection=0.95).xy)
        if found.verdict == "matched":
            assert is_right(found, CENTRES, pose)
            assert found.rivals == ()
            right += 1
        else:
            assert found.reason in ("runner_up_too_close", "below_gate")
    assert least <= right <= most


def test_what_is_ambiguous_names_rivals_that_are_elsewhere() -> None:
    rng = np.random.default_rng(6)
    trees = plantation(SIDE, SIDE, rng, jitter=0.03, survival=0.97)
    recognizer, ambiguous = stored(trees, CENTRES, 20.0, rng), 0
    for _ in range(10):
        found = recognizer.recognize(observe(trees, forests.pose(rng, 25.0, 65.0), 20.0, rng, sigma=0.05).xy)
        if found.verdict != "ambiguous":
            continue
        ambiguous += 1
        best, evidence = found.candidates[0], [rival.evidence for rival in found.rivals]
        assert evidence
        assert evidence == sorted(evidence, reverse=True)
        assert found.margin == pytest.approx(best.evidence - evidence[0])
        for rival in found.rivals:
            shift, turn = (CENTRES[rival.key] @ rival.transform).distance(CENTRES[best.key] @ best.transform)
            assert shift > 1.0 or turn > 0.05
    assert ambiguous >= 5


def corners(jitter: float, seed: int) -> tuple[NDArray[np.float64], list[SE2], SE2, np.random.Generator]:
    """An orchard without a gap, sensors at two opposite corners, and one at the first of them again."""
    rng = np.random.default_rng([seed, 3])
    trees = plantation(150.0, 150.0, rng, spacing=(5.0, 5.0), jitter=jitter, survival=1.0)
    turns = rng.uniform(-3.0, 3.0, 3).tolist()
    return trees, [SE2(0.0, 0.0, turns[0]), SE2(145.0, 145.0, turns[1])], SE2(0.0, 0.0, turns[2]), rng


def wrong_at_corners(jitter: float, *, here: bool) -> int:
    """Wrong matches of 24 at a corner; `here`: whether it is stored, or only the opposite one."""
    wrong = 0
    for seed in range(24):
        trees, poses, pose, rng = corners(jitter, seed)
        known = poses if here else poses[1:]
        found = stored(trees, known, 40.0, rng).recognize(
            observe(trees, pose, 40.0, rng, sigma=0.03, detection=0.98).xy
        )
        wrong += found.verdict == "matched" and not is_right(found, known, pose)
    return wrong


@pytest.mark.parametrize("jitter", [0.3, 0.2, 0.1])
def test_the_corner_of_an_orchard_is_not_taken_for_the_opposite_one(jitter: float) -> None:
    assert wrong_at_corners(jitter, here=True) == 0


def test_the_corner_of_a_tight_orchard_is_not_taken_for_the_opposite_one() -> None:
    assert wrong_at_corners(0.03, here=True) == 0


@pytest.mark.parametrize("jitter", [0.3, 0.2])
def test_a_corner_that_is_not_stored_is_not_taken_for_one_that_is(jitter: float) -> None:
    assert wrong_at_corners(jitter, here=False) == 0


def test_a_tight_corner_that_is_not_stored_is_not_taken_for_one_that_is() -> None:
    assert wrong_at_corners(0.03, here=False) == 0
