"""The paper's polygon descriptor (section IV-B): distances from the centroid along the perimeter, and their DFT.

The descriptor takes M points at equal arc length along the outline, their distances (or squared distances) from the
centroid of the vertices, and the magnitude of the discrete Fourier transform of this row. Distances are invariant to
rotation and translation. The magnitude is invariant to the starting point only if that moves by whole samples, because
corners fall between samples. So the walk always begins at the vertex farthest from the centroid.

The input is real, so the transform is symmetric. Only its M // 2 + 1 distinct magnitudes are kept, and those that occur
twice are scaled by sqrt(2). The Euclidean distance between two such rows equals that between the paper's rows of M.
"""

import math

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel


def dimension(samples: int) -> int:
    """Length of a descriptor made from `samples` points (the paper's M, 1 / step)."""
    return samples // 2 + 1


@kernel
def describe_outlines(
    landmarks: NDArray[np.float64],
    vertices: NDArray[np.int32],
    offsets: NDArray[np.int32],
    samples: int,
    squared: bool,
) -> NDArray[np.float32]:
    """Descriptors (P, samples // 2 + 1) float32 of P outlines, in metres (square metres if `squared`).

    Args:
        landmarks: (N, 2) float64, metres, any centred frame: far from the origin, float32 rows lose digits.
        vertices, offsets: outlines as in `Tessellation`; triangles are outlines of three.
        samples: points along each outline; the paper's M, which is 1 / its step.
        squared: squared centroid distance (paper, section IV-B), or plain distance (the authors' code).
    """
    count = len(offsets) - 1
    width = samples // 2 + 1
    rows = np.empty((count, width), np.float32)
    cosine, sine = np.empty(samples), np.empty(samples)
    for k in range(samples):
        cosine[k] = math.cos(2.0 * math.pi * k / samples)
        sine[k] = math.sin(2.0 * math.pi * k / samples)
    distance = np.empty(samples)
    for i in range(count):
        first, n = offsets[i], offsets[i + 1] - offsets[i]
        cx = cy = perimeter = 0.0
        for v in range(n):
            a, b = vertices[first + v], vertices[first + (v + 1) % n]
            cx += landmarks[a, 0]
            cy += landmarks[a, 1]
            perimeter += math.hypot(landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1])
        cx, cy = cx / n, cy / n

        side, walked, passed = _start(landmarks, vertices, first, n, cx, cy), 0.0, 0
        a, b = vertices[first + side], vertices[first + (side + 1) % n]
        length = math.hypot(landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1])
        for k in range(samples):
            along = perimeter * k / samples
            while along > walked + length and passed < n - 1:
                walked += length
                passed += 1
                side = (side + 1) % n
                a, b = vertices[first + side], vertices[first + (side + 1) % n]
                length = math.hypot(landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1])
            share = (along - walked) / length
            dx = landmarks[a, 0] + share * (landmarks[b, 0] - landmarks[a, 0]) - cx
            dy = landmarks[a, 1] + share * (landmarks[b, 1] - landmarks[a, 1]) - cy
            distance[k] = dx * dx + dy * dy
            if not squared:
                distance[k] = math.sqrt(distance[k])

        for f in range(width):
            real = imaginary = 0.0
            for k in range(samples):
                real += distance[k] * cosine[f * k % samples]
                imaginary -= distance[k] * sine[f * k % samples]
            weight = 1.0 if f == 0 or 2 * f == samples else math.sqrt(2.0)
            rows[i, f] = weight * math.hypot(real, imaginary)
    return rows


@kernel
def _start(
    landmarks: NDArray[np.float64], vertices: NDArray[np.int32], first: int, n: int, cx: float, cy: float
) -> int:
    """The vertex farthest from the centroid, where the walk begins; of ties, the one with the longest next side."""
    best, best_distance, best_side = 0, -1.0, -1.0
    for v in range(n):
        a, b = vertices[first + v], vertices[first + (v + 1) % n]
        distance = math.hypot(landmarks[a, 0] - cx, landmarks[a, 1] - cy)
        side = math.hypot(landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1])
        slack = 1e-9 * best_distance
        if distance > best_distance + slack or (distance > best_distance - slack and side > best_side):
            best, best_distance, best_side = v, distance, side
    return best


def describe_triangles(
    landmarks: NDArray[np.float64], triangles: NDArray[np.int32], samples: int, squared: bool
) -> NDArray[np.float32]:
    """Descriptors (T, samples // 2 + 1) float32 of Delaunay triangles (T, 3) of landmarks (N, 2), metres.

    The paper describes triangles and polygons in the same way (section IV-B); see `describe_outlines`.
    """
    offsets = np.arange(0, 3 * len(triangles) + 1, 3, dtype=np.int32)
    return describe_outlines(landmarks, triangles.ravel(), offsets, samples, squared)
