"""Delaunay triangles joined into Urquhart polygons (paper, section III and algorithm 1).

Each triangle loses its longest edge; triangles joined across lost edges form one face of the Urquhart graph. One pass
finds the faces (union-find over triangles), a second one walks along the boundary of each. Only interior faces that are
simple polygons are kept; the others are counted:

- A face with a side on the hull is left out: it changes as soon as the sensor sees one more tree.
- An edge with the same face on both sides (a dangling edge) bounds nothing and is removed.
- A face whose boundary is then not one simple cycle (it has a hole, or passes a vertex twice) is left out.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.budget import UNBOUNDED, Budget
from urquhart.features.delaunay import triangulate
from urquhart.features.quads import quads_of


@dataclass(frozen=True, slots=True, eq=False)
class Tessellation:
    """Triangles, quads and interior Urquhart polygons of one set of landmarks. Polygons are kept in ragged arrays.

    Attributes:
        triangles: (T, 3) int32, landmark indices, counter-clockwise.
        quads: (Q, 4) int32, landmark indices, counter-clockwise: pairs of triangles that share the edge between the
            first and the third landmark.
        hull: (H,) int32, landmark indices of the convex hull, counter-clockwise.
        vertices: (V,) int32, landmark indices of all polygons one after the other, each counter-clockwise from its
            lowest index.
        vertex_offsets: (P + 1,) int32; polygon i is `vertices[vertex_offsets[i]:vertex_offsets[i + 1]]`.
        members: (M,) int32, triangle indices of all polygons one after the other (paper, eq. 1: phi).
        member_offsets: (P + 1,) int32; polygon i joins `members[member_offsets[i]:member_offsets[i + 1]]`.
        hull_polygons: number of faces left out because they have a side on the hull.
        non_simple_faces: number of interior faces left out because their boundary is not one simple cycle.
        dangling_edges: number of edges removed because they have the same face on both sides.
    """

    triangles: NDArray[np.int32]
    quads: NDArray[np.int32]
    hull: NDArray[np.int32]
    vertices: NDArray[np.int32]
    vertex_offsets: NDArray[np.int32]
    members: NDArray[np.int32]
    member_offsets: NDArray[np.int32]
    hull_polygons: int
    non_simple_faces: int
    dangling_edges: int

    def __len__(self) -> int:
        return len(self.vertex_offsets) - 1

    def polygon(self, i: int) -> NDArray[np.int32]:
        """Landmark indices (n,) int32 of polygon `i`, counter-clockwise."""
        return self.vertices[self.vertex_offsets[i] : self.vertex_offsets[i + 1]]

    def polygon_triangles(self, i: int) -> NDArray[np.int32]:
        """Triangle indices (m,) int32 that make up polygon `i` (paper, eq. 1: phi)."""
        return self.members[self.member_offsets[i] : self.member_offsets[i + 1]]

    def vertex_counts(self) -> NDArray[np.int32]:
        """Number of vertices (P,) int32 of each polygon."""
        return np.diff(self.vertex_offsets)


def tessellate(landmarks: NDArray[np.float64], *, keep_hull: bool = False, budget: Budget = UNBOUNDED) -> Tessellation:
    """Tessellate checked landmarks (N, 2) float64, metres, centred near the origin.

    Args:
        keep_hull: keep polygons with a side on the hull, closed by that side. The paper discards them; the option
            exists to measure what that is worth.
        budget: when the work must end; by default never.

    Raises:
        LandmarkError: code `collinear`: the landmarks are so close to one line that no triangulation exists.
        DeadlinePassed: the deadline passed first.
        Abandoned: nobody waits for the result any more.
    """
    budget.check()
    triangles, neighbours = triangulate(landmarks)
    budget.check()
    vertices, vertex_offsets, members, member_offsets, hull, non_simple, dangling = join_triangles(
        landmarks, triangles, neighbours, keep_hull
    )
    quads = quads_of(landmarks, triangles, neighbours)
    outer = walk_hull(len(landmarks), triangles, neighbours)
    return Tessellation(
        triangles, quads, outer, vertices, vertex_offsets, members, member_offsets, hull, non_simple, dangling
    )


@kernel
def _find(parent: NDArray[np.int32], i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def _longest_edge(landmarks: NDArray[np.float64], triangles: NDArray[np.int32], t: int) -> int:
    """The longest edge of triangle `t`, by the vertex 0, 1 or 2 opposite to it.

    Ties (grids, equilateral plantings) go to the edge with the larger landmark indices, so that both triangles of an
    edge agree.
    """
    best, best_length, best_low, best_high = 0, -1.0, -1, -1
    for k in range(3):
        i, j = triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]
        low, high = min(i, j), max(i, j)
        dx, dy = landmarks[high, 0] - landmarks[low, 0], landmarks[high, 1] - landmarks[low, 1]
        length = dx * dx + dy * dy
        if length > best_length or (
            length == best_length and (high > best_high or (high == best_high and low > best_low))
        ):
            best, best_length, best_low, best_high = k, length, low, high
    return best


@kernel
def walk_hull(count: int, triangles: NDArray[np.int32], neighbours: NDArray[np.int32]) -> NDArray[np.int32]:
    """The convex hull (H,) int32 of `count` landmarks, counter-clockwise: all edges of (T, 3) without a neighbour."""
    following = np.full(count, -1, np.int32)
    sides, start = 0, -1
    for t in range(len(triangles)):
        for k in range(3):
            if neighbours[t, k] < 0:
                a = triangles[t, (k + 1) % 3]
                following[a] = triangles[t, (k + 2) % 3]
                sides += 1
                start = a
    hull = np.empty(sides, np.int32)
    v = start
    for i in range(sides):
        hull[i] = v
        v = following[v]
    return hull


class Faces(NamedTuple):
    """Faces of the Urquhart graph: triangles joined across dropped edges.

    Attributes:
        dropped: (T, 3) bool, whether the edge opposite to each vertex is dropped.
        face: (T,) int32, the face of each triangle; faces are numbered in the order of their first triangle.
        offsets: (F + 1,) int32, where the triangles of each face begin in `by_face`.
        by_face: (T,) int32, triangle indices by face, ascending.
    """

    dropped: NDArray[np.bool_]
    face: NDArray[np.int32]
    offsets: NDArray[np.int32]
    by_face: NDArray[np.int32]


@kernel
def find_faces(landmarks: NDArray[np.float64], triangles: NDArray[np.int32], neighbours: NDArray[np.int32]) -> Faces:
    """Drop each triangle's longest edge, and join the triangles on both sides of it by union-find (algorithm 1).

    `landmarks`: (N, 2), metres; `triangles`, `neighbours`: (T, 3), as `triangulate` returns them.
    """
    count = len(triangles)
    dropped = np.zeros((count, 3), np.bool_)
    for t in range(count):
        k = _longest_edge(landmarks, triangles, t)
        other = neighbours[t, k]
        if other >= 0:
            dropped[t, k] = True
            for m in range(3):
                if neighbours[other, m] == t:
                    dropped[other, m] = True

    parent = np.arange(count).astype(np.int32)
    for t in range(count):
        for k in range(3):
            if dropped[t, k]:
                a, b = _find(parent, t), _find(parent, neighbours[t, k])
                if a != b:
                    # The lower index is the root: faces come out in the order of their first triangle.
                    parent[max(a, b)] = min(a, b)

    face = np.empty(count, np.int32)
    faces = 0
    for t in range(count):
        root = _find(parent, t)
        if root == t:
            face[t] = faces
            faces += 1
        else:
            face[t] = face[root]

    offsets = np.zeros(faces + 1, np.int32)
    for t in range(count):
        offsets[face[t] + 1] += 1
    for f in range(faces):
        offsets[f + 1] += offsets[f]
    by_face = np.empty(count, np.int32)
    cursor = offsets[:-1].copy()
    for t in range(count):
        by_face[cursor[face[t]]] = t
        cursor[face[t]] += 1
    return Faces(dropped, face, offsets, by_face)


@kernel
def link_sides(
    f: int,
    triangles: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    faces: Faces,
    following: NDArray[np.int32],
    seen_in: NDArray[np.int32],
) -> tuple[bool, bool, int, int, int]:
    """Link the sides of face `f` into a walk along its boundary.

    `following`: (N,), filled with the landmark that comes after each one on the boundary; `seen_in`: (N,), updated, the
    last face whose boundary passed each landmark.

    Returns:
        Whether the face has a side on the hull; whether its boundary passes no landmark twice; the number of its sides;
        its lowest landmark index; and the number of edge sides with this face on both sides of the edge.
    """
    dropped, face, offsets, by_face = faces
    on_hull, simple, sides, start, dangling_sides = False, True, 0, len(following), 0
    for m in range(offsets[f], offsets[f + 1]):
        t = by_face[m]
        for k in range(3):
            other = neighbours[t, k]
            if other < 0:
                on_hull = True
            elif face[other] == f:
                if not dropped[t, k]:
                    dangling_sides += 1
                continue
            a, b = triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]
            if seen_in[a] == f:
                simple = False
            seen_in[a] = f
            following[a] = b
            sides += 1
            start = min(start, a)
    return on_hull, simple, sides, start, dangling_sides


@kernel
def join_triangles(
    landmarks: NDArray[np.float64], triangles: NDArray[np.int32], neighbours: NDArray[np.int32], keep_hull: bool
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], int, int, int]:
    """The last seven fields of a `Tessellation`: the interior Urquhart polygons (paper, algorithm 1).

    `landmarks`: (N, 2), metres; `triangles`, `neighbours`: (T, 3), as `triangulate` returns them.
    """
    faces = find_faces(landmarks, triangles, neighbours)
    offsets, by_face = faces.offsets, faces.by_face
    vertices = np.empty(3 * len(triangles), np.int32)
    vertex_offsets = np.zeros(len(offsets), np.int32)
    members = np.empty(len(triangles), np.int32)
    member_offsets = np.zeros(len(offsets), np.int32)
    following = np.empty(len(landmarks), np.int32)
    seen_in = np.full(len(landmarks), -1, np.int32)
    kept = hull = non_simple = dangling = 0
    for f in range(len(offsets) - 1):
        on_hull, simple, sides, start, dangling_sides = link_sides(f, triangles, neighbours, faces, following, seen_in)
        dangling += dangling_sides // 2
        if on_hull and not keep_hull:
            hull += 1
            continue
        first = vertex_offsets[kept]
        length, v = 0, start
        while simple and length < sides:
            vertices[first + length] = v
            length += 1
            v = following[v]
            if v == start:
                break
        if not simple or length != sides or v != start:
            non_simple += 1
            continue
        size = offsets[f + 1] - offsets[f]
        for m in range(size):
            members[member_offsets[kept] + m] = by_face[offsets[f] + m]
        vertex_offsets[kept + 1] = first + length
        member_offsets[kept + 1] = member_offsets[kept] + size
        kept += 1
    return (
        vertices[: vertex_offsets[kept]].copy(),
        vertex_offsets[: kept + 1].copy(),
        members[: member_offsets[kept]].copy(),
        member_offsets[: kept + 1].copy(),
        hull,
        non_simple,
        dangling,
    )
