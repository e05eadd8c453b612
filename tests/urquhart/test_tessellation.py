import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.urquhart import forests
from tests.urquhart.oracle import urquhart_polygons
from urquhart.config import Config
from urquhart.features.describe import describe
from urquhart.features.tessellation import Tessellation, tessellate


def polygons(tessellation: Tessellation) -> set[tuple[int, ...]]:
    return {tuple(tessellation.polygon(i).tolist()) for i in range(len(tessellation))}


def area(points: NDArray[np.float64]) -> float:
    x, y = points.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize("seed", range(4))
def test_agrees_with_the_faces_of_the_urquhart_graph(seed: int) -> None:
    """Two thousand sets in all, near-degenerate ones among them, against an oracle that shares no code."""
    kinds: dict[str, int] = {}
    for kind, points in forests.all_kinds(seed, each=70):
        landmarks = points - points.mean(axis=0)
        tessellation = tessellate(landmarks)
        expected, non_simple, dangling = urquhart_polygons(landmarks, tessellation.triangles)
        assert polygons(tessellation) == expected, kind
        assert tessellation.non_simple_faces == non_simple, kind
        assert tessellation.dangling_edges == dangling, kind
        kinds[kind] = kinds.get(kind, 0) + len(expected)
    assert all(kinds[kind] > 0 for kind in ("uniform", "clustered", "grid", "lattice")), kinds


def test_golden_square_grid_gives_its_inner_cells() -> None:
    """Each cell of a square grid is two triangles with the diagonal dropped; outer cells touch the hull."""
    points = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0)), axis=-1).reshape(-1, 2)
    tessellation = tessellate(points - 2.0)
    assert len(tessellation) == 4
    assert tessellation.hull_polygons == 12
    assert set(tessellation.vertex_counts().tolist()) == {4}
    assert sorted(len(tessellation.polygon_triangles(i)) for i in range(4)) == [2, 2, 2, 2]


def test_golden_dangling_edge_is_removed() -> None:
    """A tree alone in the middle of a ring hangs on one edge inside the ring's face."""
    angle = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    inner = 10.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    outer = 24.0 * np.column_stack([np.cos(angle + 0.2), np.sin(angle + 0.2)])
    points = np.concatenate([inner, outer, [[1.0, 0.3]]])
    tessellation = tessellate(points - points.mean(axis=0))
    assert (0, 1, 2, 3, 4, 5, 6, 7) in polygons(tessellation)
    assert tessellation.dangling_edges >= 1


@pytest.mark.parametrize("seed", range(20))
def test_polygons_are_counter_clockwise_and_made_of_their_triangles(seed: int) -> None:
    landmarks = forests.uniform(np.random.default_rng(seed)) - 40.0
    tessellation = tessellate(landmarks)
    assert len(tessellation) > 5
    used: list[int] = []
    for i in range(len(tessellation)):
        members = tessellation.polygon_triangles(i)
        used += members.tolist()
        whole = area(landmarks[tessellation.polygon(i)])
        assert whole > 0.0
        assert whole == pytest.approx(sum(area(landmarks[t]) for t in tessellation.triangles[members]))
        # No landmark but its own lies in a polygon without dangling edges: n vertices make n - 2 triangles.
        assert len(members) >= len(tessellation.polygon(i)) - 2
    assert len(used) == len(set(used))


@pytest.mark.parametrize("seed", range(20))
def test_polygons_move_with_the_landmarks_and_keep_their_names(seed: int) -> None:
    rng = np.random.default_rng(seed)
    landmarks = forests.uniform(rng) - 40.0
    before = polygons(tessellate(landmarks))
    pose = forests.pose(rng, -50.0, 50.0)
    assert polygons(tessellate(pose.apply(landmarks))) == before

    order = rng.permutation(len(landmarks))
    back = {tuple(sorted(order[list(p)].tolist())) for p in polygons(tessellate(landmarks[order]))}
    assert back == {tuple(sorted(p)) for p in before}


@pytest.mark.parametrize("seed", range(10))
def test_dropping_a_landmark_leaves_polygons_far_from_it_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    landmarks = forests.uniform(rng, 120, 100.0) - 50.0
    gone = int(np.argmin((landmarks**2).sum(axis=1)))
    before = polygons(tessellate(landmarks))
    kept = np.delete(np.arange(len(landmarks)), gone)
    after = {tuple(kept[list(p)].tolist()) for p in polygons(tessellate(landmarks[kept]))}
    touched = {p for p in before if gone in p or p not in after}
    assert all(np.min(np.linalg.norm(landmarks[list(p)] - landmarks[gone], axis=1)) < 45.0 for p in touched)
    assert len(before & after) > 0.5 * len(before)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1e-7, 1e-2))
def test_jitter_far_below_the_spacing_never_breaks_it(seed: int, jitter: float) -> None:
    """Almost collinear, almost cocircular: whatever Delaunay makes of it, the faces are still right."""
    rng = np.random.default_rng(seed)
    points = forests.grid(rng)
    landmarks = points + rng.normal(0.0, jitter, points.shape) - points.mean(axis=0)
    tessellation = tessellate(landmarks)
    expected, non_simple, dangling = urquhart_polygons(landmarks, tessellation.triangles)
    assert polygons(tessellation) == expected
    assert (tessellation.non_simple_faces, tessellation.dangling_edges) == (non_simple, dangling)


def test_hull_polygons_can_be_kept() -> None:
    landmarks = forests.uniform(np.random.default_rng(3)) - 40.0
    inner, every = tessellate(landmarks), tessellate(landmarks, keep_hull=True)
    assert polygons(inner) < polygons(every)
    assert len(every) + every.non_simple_faces == len(inner) + inner.non_simple_faces + inner.hull_polygons
    assert every.hull_polygons == 0


def test_quads_share_their_diagonal() -> None:
    landmarks = forests.uniform(np.random.default_rng(4)) - 40.0
    tessellation = tessellate(landmarks)
    triangles = {frozenset(t) for t in tessellation.triangles.tolist()}
    assert len(tessellation.quads) > len(tessellation.triangles)
    for a, b, c, d in tessellation.quads.tolist():
        assert frozenset((a, b, c)) in triangles
        assert frozenset((a, c, d)) in triangles
    assert (np.array([area(landmarks[q]) for q in tessellation.quads]) > 0.0).all()


def test_hull_encloses_every_landmark() -> None:
    for _, points in forests.all_kinds(seed=2, each=5):
        landmarks = points - points.mean(axis=0)
        hull = landmarks[tessellate(landmarks).hull]
        assert area(hull) > 0.0
        edges = np.roll(hull, -1, axis=0) - hull
        for corner, edge in zip(hull, edges, strict=True):
            offset = landmarks - corner
            assert (edge[0] * offset[:, 1] - edge[1] * offset[:, 0] >= -1e-6).all()


def test_projected_coordinates_give_the_same_tessellation() -> None:
    """UTM northings: centring in float64 comes before anything else."""
    landmarks = forests.uniform(np.random.default_rng(5))
    near, far = describe(landmarks, Config()), describe(landmarks + np.array([432_000.0, 5_310_000.0]), Config())
    assert polygons(near.tessellation) == polygons(far.tessellation)
    np.testing.assert_allclose(near.descriptors, far.descriptors, atol=1e-4)
