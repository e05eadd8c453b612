import pickle
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from urquhart.features.landmark_checks import MAXIMUM, LandmarkError, check_landmarks, thin, width

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


@pytest.mark.parametrize(
    "make", [np.asfortranarray, lambda xy: xy[::2], lambda xy: np.frombuffer(xy.tobytes()).reshape(-1, 2)]
)
def test_what_is_checked_is_of_one_type_to_the_compiler(make: Callable[[NDArray[np.float64]], ArrayLike]) -> None:
    """A kernel is compiled again, which takes seconds, for an array that cannot be written or lies otherwise."""
    xy = np.random.default_rng(0).uniform(0.0, 10.0, (10, 2))
    checked = check_landmarks(make(xy))
    assert checked.flags.c_contiguous
    assert checked.flags.writeable
    checked[0] = 99.0  # a copy: the caller's landmarks stay what they are
    assert (xy < 99.0).all()


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


def test_a_point_gives_way_to_the_first_kept_one_near_it() -> None:
    """As the search through all pairs has it, on sets dense enough for chains of close points."""
    for seed in range(300):
        rng = np.random.default_rng(seed)
        xy = rng.uniform(-0.5, 0.5, (int(rng.integers(1, 60)), 2)) * rng.choice([0.002, 0.01, 0.05])
        if seed % 3 == 0:
            xy = np.round(xy, 3)
        wanted = np.full(len(xy), -1, np.int64)
        for i in range(len(xy)):
            near = [j for j in range(i) if wanted[j] < 0 and np.hypot(*(xy[i] - xy[j])) <= 1e-3]
            wanted[i] = near[0] if near else -1
        np.testing.assert_array_equal(thin(xy, 1e-3), wanted)


@pytest.mark.parametrize("kind", ["equal", "pairs", "patch", "far"])
def test_memory_for_the_search_for_duplicates_grows_with_the_landmarks_only(kind: str) -> None:
    """Twenty thousand equal points have two hundred million pairs: none of them may be written down."""
    rng = np.random.default_rng(0)
    xy = {
        "equal": np.ones((MAXIMUM, 2)),
        "pairs": np.repeat(rng.uniform(0.0, 400.0, (MAXIMUM // 2, 2)), 2, axis=0),
        "patch": rng.uniform(0.0, 0.02, (MAXIMUM, 2)),
        "far": np.full((MAXIMUM, 2), 1e8),
    }[kind]
    tracemalloc.start()
    with pytest.raises(LandmarkError, match="keep one of each") as caught:
        check_landmarks(xy)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert caught.value.code == "duplicates"
    assert caught.value.indices[0] == 0
    assert peak < 500 * MAXIMUM


def test_the_error_reaches_another_process_as_it_was() -> None:
    with pytest.raises(LandmarkError) as caught:
        check_landmarks([*SQUARE, [4.0, 4.0]])
    again = pickle.loads(pickle.dumps(caught.value))
    assert (again.code, str(again), again.indices) == ("duplicates", str(caught.value), (2, 4))
