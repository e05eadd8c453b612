import math

import numpy as np
import pytest

from urquhart import SE2
from urquhart.evaluation.scores import (
    ROTATION,
    TRANSLATION,
    Alignment,
    Outcomes,
    alignment_errors,
    is_right,
    mean_outcome,
    outcomes_by_threshold,
    pose_errors,
    score,
)


def test_precision_recall_and_f1_of_counts() -> None:
    outcomes = Outcomes(6, 2, 4)
    assert outcomes.precision == 0.75
    assert outcomes.recall == 0.6
    assert outcomes.f1 == pytest.approx(2 * 6 / (2 * 6 + 2 + 4))
    assert outcomes + Outcomes(1, 1, 1) == Outcomes(7, 3, 5)


def test_nothing_reported_is_precise_and_finds_nothing() -> None:
    silent = Outcomes(0, 0, 5)
    assert (silent.precision, silent.recall, silent.f1) == (1.0, 0.0, 0.0)
    assert Outcomes(0, 0, 0).recall == 1.0
    assert Outcomes(0, 3, 0).f1 == 0.0


def test_pairs_are_counted_as_the_paper_says() -> None:
    reported = np.array([True, True, False, False, True])
    right = np.array([True, False, True, False, True])
    positive = np.array([True, True, True, False, False])
    # The last is right and far apart: a true positive all the same. The third is right but was not said.
    assert score(reported, right, positive) == Outcomes(2, 1, 1)


def test_higher_thresholds_report_fewer_pairs() -> None:
    rng = np.random.default_rng(0)
    strength, right, positive = rng.integers(0, 50, 400), rng.random(400) < 0.6, rng.random(400) < 0.5
    outcomes = outcomes_by_threshold(strength.astype(np.float64), right, positive, range(0, 60, 5))
    said = [o.true_positives + o.false_positives for o in outcomes]
    assert said == sorted(said, reverse=True)
    assert said[0] == 400
    assert said[-1] == 0
    missed = [o.false_negatives for o in outcomes]
    assert missed == sorted(missed)


@pytest.mark.parametrize("seed", range(5))
def test_pose_errors_are_those_of_se2(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found, truth = rng.uniform(-9.0, 9.0, (2, 40, 3))
    shift, turn = pose_errors(found, truth)
    for k in range(40):
        expected = SE2(*found[k].tolist()).distance(SE2(*truth[k].tolist()))
        assert (shift[k], turn[k]) == pytest.approx(expected)
    assert (turn <= math.pi).all()


def test_the_bounds_are_the_paper_s() -> None:
    truth = np.zeros((5, 3))
    found = np.array(
        [
            [0.99 * TRANSLATION, 0.0, 0.0],
            [1.01 * TRANSLATION, 0.0, 0.0],
            [0.0, 0.0, 0.99 * ROTATION + 4.0 * math.pi],
            [0.0, 0.0, -1.01 * ROTATION],
            [math.nan, 0.0, 0.0],
        ]
    )
    assert is_right(found, truth).tolist() == [True, False, True, False, False]
    assert pytest.approx(10.0) == TRANSLATION**2
    assert pytest.approx(20.0) == math.degrees(ROTATION)


def test_alignment_is_nothing_for_a_true_transform_and_knows_no_frame() -> None:
    rng = np.random.default_rng(1)
    second, truth = rng.uniform(-30.0, 30.0, (25, 2)), SE2(4.0, -7.0, 2.0)
    first = truth.apply(second)
    np.testing.assert_allclose(alignment_errors(first, second, truth), 0.0, atol=1e-12)
    off = SE2(truth.x + 0.3, truth.y - 0.4, truth.yaw)
    np.testing.assert_allclose(alignment_errors(first, second, off), 0.5, atol=1e-12)
    move = SE2(-100.0, 20.0, 0.7)
    np.testing.assert_allclose(
        alignment_errors(move.apply(first), second, move @ off), alignment_errors(first, second, off), atol=1e-9
    )


def test_alignment_over_distances() -> None:
    three = Alignment.over(np.array([0.1, 0.5, 0.3]))
    assert three.mean == pytest.approx(0.3)
    assert (three.least, three.most, three.pairs) == (0.1, 0.5, 3)
    empty = Alignment.over(np.empty(0))
    assert math.isnan(empty.mean)
    assert empty.pairs == 0


def test_cells_count_alike_in_a_mean() -> None:
    precision, recall, f1 = mean_outcome([Outcomes(100, 0, 0), Outcomes(0, 0, 10)])
    assert (precision, recall, f1) == (1.0, 0.5, 0.5)
