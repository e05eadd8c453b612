import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from urquhart.features.polygon_descriptor import describe_outlines, describe_triangles, dimension
from urquhart.se2 import SE2


def describe_one(outline: NDArray[np.float64], samples: int = 20, squared: bool = False) -> NDArray[np.float32]:
    vertices, offsets = np.arange(len(outline), dtype=np.int32), np.array([0, len(outline)], np.int32)
    row: NDArray[np.float32] = describe_outlines(outline, vertices, offsets, samples, squared)[0]
    return row


def reference(outline: NDArray[np.float64], samples: int, squared: bool) -> NDArray[np.float64]:
    """The letter read line by line: centroid of the vertices, M points by arc length, distances, |DFT| of all M."""
    centroid = outline.mean(axis=0)
    outline = np.roll(outline, -int(np.argmax(np.linalg.norm(outline - centroid, axis=1))), axis=0)
    closed = np.concatenate([outline, outline[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = arc[-1] * np.arange(samples) / samples
    points = np.column_stack([np.interp(at, arc, closed[:, k]) for k in range(2)])
    distance = np.linalg.norm(points - centroid, axis=1)
    return np.abs(np.fft.fft(distance**2 if squared else distance))


def star(seed: int, count: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    radius = rng.uniform(3.0, 9.0, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


shapes = st.builds(star, st.integers(0, 10_000), st.integers(3, 14))


@settings(max_examples=150, deadline=None)
@given(shapes, shapes, st.sampled_from([10, 20, 21, 32, 64]), st.booleans())
def test_distances_equal_those_of_the_paper(
    a: NDArray[np.float64], b: NDArray[np.float64], samples: int, squared: bool
) -> None:
    """Half the spectrum, weighted, stands for all of it."""
    assert len(describe_one(a, samples)) == dimension(samples)
    ours = np.linalg.norm(describe_one(a, samples, squared) - describe_one(b, samples, squared))
    letter = np.linalg.norm(reference(a, samples, squared) - reference(b, samples, squared))
    assert ours == pytest.approx(letter, rel=1e-4, abs=1e-3)


@settings(max_examples=100, deadline=None)
@given(shapes, st.floats(-np.pi, np.pi), st.floats(-200.0, 200.0), st.booleans())
def test_rotation_and_translation_change_nothing(
    outline: NDArray[np.float64], yaw: float, shift: float, squared: bool
) -> None:
    moved = SE2(shift, -0.5 * shift, yaw).apply(outline)
    row = describe_one(outline, 20, squared)
    np.testing.assert_allclose(describe_one(moved, 20, squared), row, atol=1e-5 * float(row[0]))


@settings(max_examples=200, deadline=None)
@given(shapes, st.integers(1, 13), st.booleans())
def test_where_the_list_of_vertices_starts_changes_nothing(
    outline: NDArray[np.float64], shift: int, squared: bool
) -> None:
    row = describe_one(outline, 20, squared)
    rolled = describe_one(np.roll(outline, shift % len(outline), axis=0), 20, squared)
    np.testing.assert_allclose(rolled, row, atol=1e-5 * float(row[0]))


@pytest.mark.parametrize("samples", [20, 64])
def test_rectangles_have_several_farthest_corners(samples: int) -> None:
    rectangle = np.array([[0.0, 0.0], [7.3, 0.0], [7.3, 4.1], [0.0, 4.1]])
    for shift in range(4):
        for yaw in (0.0, 0.3, 1.9):
            moved = np.roll(SE2(3.0, 1.0, yaw).apply(rectangle), shift, axis=0)
            np.testing.assert_allclose(describe_one(moved, samples), describe_one(rectangle, samples), atol=1e-4)


def test_a_shift_by_whole_samples_is_exact() -> None:
    square = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [0.0, 5.0]])
    for shift in range(4):
        np.testing.assert_allclose(describe_one(np.roll(square, shift, axis=0)), describe_one(square), atol=1e-5)


def test_reading_backwards_changes_nothing() -> None:
    outline = star(5, 7)
    np.testing.assert_allclose(describe_one(outline[::-1].copy()), describe_one(outline), atol=1e-4)


def test_golden_square() -> None:
    """A 2 m square: centroid distances at corners and mid-sides are sqrt(2) and 1, eight samples alternate."""
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    row = describe_one(square, samples=8)
    expected = np.zeros(5)
    expected[0] = 4.0 * (np.sqrt(2.0) + 1.0)
    expected[4] = 4.0 * (np.sqrt(2.0) - 1.0)
    np.testing.assert_allclose(row, expected, atol=1e-6)
    np.testing.assert_allclose(describe_one(square, samples=8, squared=True)[[0, 4]], [12.0, 4.0], atol=1e-6)


def test_triangles_are_outlines_of_three() -> None:
    landmarks = star(1, 6)
    triangles = np.array([[0, 1, 2], [2, 4, 5]], np.int32)
    rows = describe_triangles(landmarks, triangles, 20, False)
    for row, triangle in zip(rows, triangles, strict=True):
        np.testing.assert_allclose(row, describe_one(landmarks[triangle]), atol=1e-5)
