import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urquhart.se2 import SE2, fit, wrap

transforms = st.builds(SE2, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi))
POINTS = np.random.default_rng(0).uniform(-50.0, 50.0, (12, 2))


@given(transforms, transforms)
def test_chaining_is_applying_one_after_the_other(a: SE2, b: SE2) -> None:
    np.testing.assert_allclose((a @ b).apply(POINTS), a.apply(b.apply(POINTS)), atol=1e-8)


@given(transforms)
def test_inverse_undoes(a: SE2) -> None:
    np.testing.assert_allclose(a.inverse().apply(a.apply(POINTS)), POINTS, atol=1e-8)
    shift, turn = (a @ a.inverse()).distance(SE2.identity())
    assert shift < 1e-8
    assert turn < 1e-12


def test_golden_quarter_turn() -> None:
    """Counter-clockwise: x goes to y."""
    moved = SE2(10.0, 20.0, math.pi / 2).apply(np.array([[1.0, 0.0], [0.0, 1.0]]))
    np.testing.assert_allclose(moved, [[10.0, 21.0], [9.0, 20.0]], atol=1e-12)


@pytest.mark.parametrize(("angle", "expected"), [(3.5 * math.pi, -0.5 * math.pi), (-math.pi, math.pi), (0.0, 0.0)])
def test_angles_wrap_into_one_turn(angle: float, expected: float) -> None:
    assert wrap(angle) == pytest.approx(expected)


@given(transforms)
def test_fit_recovers_a_transform(a: SE2) -> None:
    rows = np.arange(len(POINTS))
    shift, turn = SE2(*fit(POINTS, a.apply(POINTS), rows, rows)).distance(a)
    assert shift < 1e-7
    assert turn < 1e-10


def test_fit_takes_only_the_pairs_it_is_given() -> None:
    a = SE2(3.0, -2.0, 0.7)
    target = a.apply(POINTS)[::-1].copy()
    target[0] += 100.0
    pairs = np.arange(11)
    shift, _ = SE2(*fit(POINTS, target, pairs, 11 - pairs)).distance(a)
    assert shift < 1e-9
