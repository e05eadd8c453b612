"""Several views of one place make one observation: what one view leaves open, three decide."""

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart import SE2, Config, Recognizer
from urquhart.evaluation.simulation import Sensor, observe, plantation
from urquhart.features.describe import describe
from urquhart.features.keyframes import Keyframe, join_keyframes

SIDE = 160.0
ODOMETRY = np.array([0.1, 0.1, 0.015])


def trees(seed: int) -> NDArray[np.float64]:
    return plantation(SIDE, SIDE, np.random.default_rng(seed), jitter=0.15, survival=0.95)


def views(stand: NDArray[np.float64], rng: np.random.Generator) -> tuple[SE2, list[Keyframe]]:
    """Three views of 9 m, 6 m apart, with odometry between them; world_T_first, and the views."""
    x, y = rng.uniform(40.0, SIDE - 40.0, 2).tolist()
    start, at = SE2(x, y, float(rng.uniform(-np.pi, np.pi))), SE2.identity()
    seen = []
    for number in range(3):
        if number:
            error = rng.normal(size=3) * ODOMETRY
            at = at @ SE2(6.0 + error[0], error[1], error[2])
        found = observe(stand, start @ SE2(6.0 * number, 0.0, 0.0), Sensor(9.0, sigma=0.1, detection=0.9), rng)
        seen.append(Keyframe(found.xy, at))
    return start, seen


def test_three_views_decide_what_one_leaves_ambiguous() -> None:
    rng = np.random.default_rng(5)
    stand, recognizer, places = trees(5), Recognizer(Config()), {}
    for number, (x, y) in enumerate((x, y) for x in np.arange(30, SIDE, 25.0) for y in np.arange(30, SIDE, 25.0)):
        places[number] = SE2(float(x), float(y), float(rng.uniform(-3.0, 3.0)))
        stored = observe(stand, places[number], Sensor(30.0, sigma=0.05, detection=0.95), rng)
        recognizer.add([(number, describe(stored.xy, Config()))])
    one, three = Counter[str](), Counter[str]()
    for _ in range(12):
        start, seen = views(stand, rng)
        one[recognizer.locate(seen[0].xy).verdict] += 1
        found = recognizer.locate(join_keyframes(seen).xy)
        three[found.verdict] += 1
        if found.verdict == "matched":
            best = found.candidates[0]
            shift, turn = (places[best.key] @ best.transform).distance(start)
            assert shift < 1.0 and turn < 0.1
    assert one["ambiguous"] >= 10 and three["matched"] > one["matched"] + 1
    # Another stand with the same rows is not taken for this one.
    assert "matched" not in {recognizer.locate(join_keyframes(views(trees(6), rng)[1]).xy).verdict for _ in range(12)}


def test_a_tree_counts_once_and_trees_of_one_view_never_become_one() -> None:
    base = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [4.0, 4.0], [8.0, 1.0], [8.3, 1.0]])
    shift = SE2(0.3, -0.2, 0.01)
    joined = join_keyframes([Keyframe(base, SE2.identity()), Keyframe(base, shift, np.full(6, 0.3))])
    assert joined.xy == pytest.approx(base, abs=0.05)  # odometry that is off is corrected by the trees
    assert joined.seen.tolist() == [2] * 6 and joined.first.tolist() == [[0, i] for i in range(6)]
    assert joined.diameters is not None and joined.diameters == pytest.approx(np.full(6, 0.3))
    far = join_keyframes([Keyframe(base, SE2.identity()), Keyframe(base, SE2(2.0, 0.0, 0.0))])
    assert len(far.xy) > 6 and far.diameters is None  # too far off to be corrected: the trees stay apart


@pytest.mark.parametrize("count", [0, 1])
def test_one_view_or_none_stays_as_it_is(count: int) -> None:
    xy = np.array([[1.0, 2.0], [3.0, 5.0]])
    joined = join_keyframes([Keyframe(xy, SE2(1.0, 0.0, np.pi / 2))] * count)
    assert joined.xy == pytest.approx(np.array([[-1.0, 1.0], [-4.0, 3.0]])[: 2 * count])
