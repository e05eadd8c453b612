import numpy as np
import pytest
from numpy.typing import ArrayLike

from urquhart.landmarks import LandmarkError, check_landmarks, width

SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]
BAD: dict[str, tuple[ArrayLike, str, tuple[int, ...]]] = {
    "none": ([], "too_few", ()),
    "one": ([[1.0, 2.0]], "too_few", ()),
    "two": ([[1.0, 2.0], [3.0, 4.0]], "too_few", ()),
    "words": ([["a", "b"]] * 4, "bad_shape", ()),
    "triples": (np.zeros((5, 3)), "bad_shape", ()),
    "ragged": ([[1.0, 2.0], [3.0]], "bad_shape", ()),
    "flat": ([1.0, 2.0, 3.0], "bad_shape", ()),
    "nan": ([*SQUARE, [np.nan, 1.0]], "not_finite", (4,)),
    "infinity": ([[1.0, -np.inf], *SQUARE], "not_finite", (0,)),
    "far": ([*SQUARE, [1e9, 0.0]], "out_of_range", (4,)),
    "twice": ([*SQUARE, [4.0, 4.0]], "duplicates", (2, 4)),
    "almost twice": ([*SQUARE, [4.0, 4.0005]], "duplicates", (2, 4)),
    "line": ([[float(i), 2.0 * i + 1.0] for i in range(9)], "collinear", ()),
    "vertical line": ([[7.0, float(i)] for i in range(9)], "collinear", ()),
    "almost a line": ([[float(i), 0.0004 * (i % 2)] for i in range(9)], "collinear", ()),
    "crowd": (np.random.default_rng(0).uniform(0.0, 5000.0, (20_001, 2)), "too_many", ()),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_landmarks_are_refused_with_the_reason(name: str) -> None:
    xy, code, indices = BAD[name]
    with pytest.raises(LandmarkError) as caught:
        check_landmarks(xy)
    assert caught.value.code == code
    assert caught.value.indices == indices
    assert len(str(caught.value)) > 20


def test_good_landmarks_come_back_as_they_are() -> None:
    checked = check_landmarks(SQUARE)
    assert checked.dtype == np.float64
    np.testing.assert_array_equal(checked, SQUARE)


def test_neighbours_just_over_the_resolution_are_two_trees() -> None:
    assert len(check_landmarks([*SQUARE, [4.0, 4.0011]])) == 5


def test_the_largest_submap_is_let_in() -> None:
    assert len(check_landmarks(np.random.default_rng(0).uniform(0.0, 5000.0, (20_000, 2)))) == 20_000


@pytest.mark.parametrize("angle", np.linspace(0.0, np.pi, 13).tolist())
def test_width_does_not_depend_on_direction(angle: float) -> None:
    strip = np.random.default_rng(1).uniform([0.0, 0.0], [100.0, 2.0], (200, 2))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    assert width(strip @ turn) == pytest.approx(width(strip), rel=1e-9)
