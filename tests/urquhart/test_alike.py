"""Collections in which one place is stored twice, or two places look alike, or a query covers more than one."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart import forests
from urquhart import SE2, Config, Recognizer, describe
from urquhart.evaluation.simulation import Sensor, observe, paper_forest, plantation

CONFIG = Config()
FOREST = paper_forest(np.random.default_rng(0), 300.0)


def stored(*submaps: NDArray[np.float64]) -> Recognizer:
    recognizer = Recognizer(CONFIG)
    recognizer.add((key, describe(xy, CONFIG)) for key, xy in enumerate(submaps))
    return recognizer


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_place_that_is_stored_twice_is_matched_and_neither_copy_rivals_the_other(noise: float) -> None:
    """Only trees say where a submap is: with the same trees it is the same place, wherever it was posted."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        pose = forests.pose(rng, 100.0, 200.0)
        xy = observe(FOREST, SE2(150.0, 150.0, 0.0), Sensor(60.0, sigma=0.05), rng).xy
        far = SE2(5000.0, -3000.0, 2.0).apply(xy + rng.normal(0.0, noise, xy.shape))
        found = stored(xy, far).locate(
            observe(FOREST, SE2(0.1 * pose.x + 135.0, 0.1 * pose.y + 135.0, pose.yaw), Sensor(40.0, sigma=0.05), rng).xy
        )
        assert found.verdict == "matched"
        assert found.rivals == ()
        assert {candidate.key for candidate in found.candidates} == {0, 1}
        one, two = sorted(found.candidates, key=lambda candidate: candidate.key)
        shift, turn = (SE2(5000.0, -3000.0, 2.0) @ one.transform).distance(two.transform)
        assert shift < 0.2
        assert turn < 0.01


def test_a_stand_whose_core_was_copied_is_matched_where_its_surroundings_are_right() -> None:
    for seed in range(10):
        rng = np.random.default_rng([seed, 1])
        xy = observe(FOREST, SE2(150.0, 150.0, 0.0), Sensor(50.0, sigma=0.03), rng).xy
        other = paper_forest(rng, 100.0) - 50.0
        reach, away = np.hypot(*xy.T), np.hypot(*other.T)
        copy = np.concatenate([xy[reach < 35.0], other[(away >= 35.0) & (away < 50.0)]])
        found = stored(copy, xy).locate(observe(FOREST, SE2(150.0, 150.0, 1.0), Sensor(50.0, sigma=0.05), rng).xy)
        if found.verdict == "matched":
            assert found.candidates[0].key == 1
            assert found.candidates[0].transform.distance(SE2(0.0, 0.0, 1.0))[0] < 0.5


@pytest.mark.parametrize("apart", [70.0, 110.0, 140.0])
def test_a_query_that_covers_two_submaps_is_matched_to_one_of_them(apart: float) -> None:
    """The other claims other trees and is no rival."""
    for seed in range(10):
        rng = np.random.default_rng([seed, 2])
        poses = [SE2(150.0 + x, 150.0, float(rng.uniform(-3.0, 3.0))) for x in (-0.5 * apart, 0.5 * apart)]
        recognizer = stored(
            *(observe(FOREST, pose, Sensor(35.0, sigma=0.05, detection=0.95), rng).xy for pose in poses)
        )
        truth = SE2(150.0, 150.0, float(rng.uniform(-3.0, 3.0)))
        found = recognizer.locate(observe(FOREST, truth, Sensor(60.0, sigma=0.05, detection=0.95), rng).xy)
        assert found.verdict == "matched"
        assert found.rivals == ()
        best = found.candidates[0]
        assert (poses[best.key] @ best.transform).distance(truth)[0] < 0.5


def crossing(rng: np.random.Generator, jitter: float) -> NDArray[np.float64]:
    """Four blocks of an orchard, 28 m square, and the lanes between them, 6 m wide."""
    return np.concatenate(
        [
            plantation(28.0, 28.0, rng, spacing=(2.5, 3.5), jitter=jitter, survival=0.97) + [x, y]
            for x in (0.0, 34.0)
            for y in (0.0, 34.0)
        ]
    )


def at_crossings(jitter: float, *, here: bool) -> tuple[int, int]:
    """Right and wrong matches of 30 at a crossing of lanes; `here`: whether it is stored, or only one alike."""
    right = wrong = 0
    for seed in range(30):
        rng = np.random.default_rng([seed, 55])
        one, two = crossing(rng, jitter), crossing(rng, jitter)
        x, y = rng.uniform(24.0, 38.0, 2).tolist()
        places = [(two, SE2(31.0, 31.0, 0.3)), (one, SE2(31.0, 31.0, 2.3))]
        recognizer = stored(
            *(
                observe(trees, pose, Sensor(16.0, sigma=0.03, detection=0.98), rng).xy
                for trees, pose in places[: 1 + here]
            )
        )
        pose = SE2(x, y, float(rng.uniform(-3.0, 3.0)))
        found = recognizer.locate(observe(one, pose, Sensor(16.0, sigma=0.03, detection=0.98), rng).xy)
        if found.verdict == "matched":
            best = found.candidates[0]
            is_it = best.key == 1 and (places[1][1] @ best.transform).distance(pose)[0] < 1.0
            right += is_it
            wrong += not is_it
    return right, wrong


@pytest.mark.parametrize(("jitter", "least"), [(0.06, 15), (0.1, 25)])
def test_of_two_crossings_planted_alike_the_right_one_is_told(jitter: float, least: int) -> None:
    right, wrong = at_crossings(jitter, here=True)
    assert wrong == 0
    assert right >= least


def test_a_crossing_that_is_not_stored_is_not_taken_for_one_planted_alike() -> None:
    assert [at_crossings(jitter, here=False)[1] for jitter in (0.0, 0.03, 0.06)] == [0, 0, 0]
