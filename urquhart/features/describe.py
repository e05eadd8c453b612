"""The features of one submap (landmarks, tessellation, descriptors), and how they are packed into one BLOB.

Landmarks are centred in float64 before anything becomes float32: at a northing of 5 million metres, float32 resolves
0.5 m.
"""

import struct
import zlib
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from urquhart._kernel import kernel
from urquhart.budget import UNBOUNDED, Budget
from urquhart.config import FEATURES_FORMAT, Config
from urquhart.features.landmark_checks import check_diameters, check_landmarks
from urquhart.features.polygon_descriptor import describe_outlines
from urquhart.features.tessellation import Tessellation, tessellate

_MAGIC: Final = b"URQF"
_HEADER: Final = struct.Struct("<4sHH16s2d12I")

HEAD: Final = 24
"""Bytes of a packed features BLOB that `is_current` needs."""


class FeaturesError(ValueError):
    """A packed features BLOB that cannot be used: damaged, or of another format. Describe the landmarks again."""


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Features of one submap.

    Attributes:
        landmarks: (N, 2) float64, metres, centred frame: submap frame minus `origin`.
        origin: (2,) float64, metres, submap frame: the centroid of the landmarks.
        density: (N,) float32, landmarks per square metre around each landmark; see `local_density`.
        tessellation: triangles, quads and interior polygons.
        descriptors: (P, D) float32, a row for each interior polygon; see `describe_outlines`.
        fingerprint: `Config.fingerprint()` of the configuration that made them.
        diameters: (N,) float32, stem diameters, NaN where one is not known; empty where none is.
    """

    landmarks: NDArray[np.float64]
    origin: NDArray[np.float64]
    density: NDArray[np.float32]
    tessellation: Tessellation
    descriptors: NDArray[np.float32]
    fingerprint: str
    diameters: NDArray[np.float32]

    def counts(self) -> dict[str, int]:
        """Number of landmarks, triangles, quads and polygons, and of the polygons that were left out, by name."""
        return {
            "landmarks": len(self.landmarks),
            "triangles": len(self.tessellation.triangles),
            "quads": len(self.tessellation.quads),
            "polygons": len(self.tessellation),
            "hull_polygons": self.tessellation.hull_polygons,
            "non_simple_faces": self.tessellation.non_simple_faces,
            "dangling_edges": self.tessellation.dangling_edges,
        }

    def pack(self) -> bytes:
        """The features as one BLOB: header, arrays in a fixed order, CRC-32."""
        t = self.tessellation
        # 20,000 landmarks at most (landmarks.MAXIMUM) fit 16 bits; triangle indices and offsets (< 2^17) do not.
        body = b"".join(
            (
                self.landmarks.tobytes(),
                self.density.tobytes(),
                self.descriptors.tobytes(),
                t.vertex_offsets.tobytes(),
                t.member_offsets.tobytes(),
                t.members.tobytes(),
                t.triangles.astype("<u2").tobytes(),
                t.quads.astype("<u2").tobytes(),
                t.hull.astype("<u2").tobytes(),
                t.vertices.astype("<u2").tobytes(),
                self.diameters.tobytes(),
            )
        )
        header = _HEADER.pack(
            _MAGIC,
            FEATURES_FORMAT,
            self.descriptors.shape[1],
            self.fingerprint.encode("ascii"),
            *self.origin.tolist(),
            len(self.landmarks),
            len(t.triangles),
            len(t.quads),
            len(t.hull),
            len(t),
            len(t.vertices),
            len(t.members),
            t.hull_polygons,
            t.non_simple_faces,
            t.dangling_edges,
            len(self.diameters),
            len(body),
        )
        return header + body + struct.pack("<I", zlib.crc32(body, zlib.crc32(header)))

    @staticmethod
    def is_current(head: bytes, fingerprint: str) -> bool:
        """Whether a BLOB is of this format and was made with this configuration.

        Args:
            head: its first `HEAD` bytes.
            fingerprint: `Config.fingerprint()`.
        """
        return head[:6] == struct.pack("<4sH", _MAGIC, FEATURES_FORMAT) and head[8:HEAD] == fingerprint.encode("ascii")

    @staticmethod
    def unpack(blob: bytes) -> "Features":
        """The features that `pack` wrote, as copies.

        Views of `blob` would be read-only. For numba that is another type, and it would compile every kernel twice.
        Neighbouring arrays are copied together, because copying is most of the time of reading a submap.

        Raises:
            FeaturesError: wrong magic, format, length or checksum.
        """
        if len(blob) < _HEADER.size + 4 or blob[:4] != _MAGIC:
            raise FeaturesError("not a features BLOB")
        _, version, width, fingerprint, x, y, *sizes = _HEADER.unpack_from(blob)
        n, triangles, quads, hull, polygons, vertices, members, on_hull, holed, dangling, measured, size = sizes
        if version != FEATURES_FORMAT:
            raise FeaturesError(
                f"features of format {version}, this version reads {FEATURES_FORMAT}: describe the landmarks again"
            )
        expected = _HEADER.size + size + 4
        if len(blob) != expected:
            raise FeaturesError(f"features BLOB of {len(blob)} bytes, {expected} expected: it is truncated")
        if zlib.crc32(memoryview(blob)[:-4]) != struct.unpack_from("<I", blob, len(blob) - 4)[0]:
            raise FeaturesError("features BLOB with a wrong checksum: it is damaged")
        reader = _Reader(blob)
        landmarks = reader.take("<f8", 2 * n).reshape(n, 2)
        floats = reader.take("<f4", n + polygons * width)
        offsets = reader.take("<i4", 2 * (polygons + 1) + members)
        short = reader.take("<u2", 3 * triangles + 4 * quads + hull + vertices).astype(np.int32)
        diameters = reader.take("<f4", measured)
        at_hull = 3 * triangles + 4 * quads
        tessellation = Tessellation(
            short[: 3 * triangles].reshape(triangles, 3),
            short[3 * triangles : at_hull].reshape(quads, 4),
            short[at_hull : at_hull + hull],
            short[at_hull + hull :],
            offsets[: polygons + 1],
            offsets[2 * (polygons + 1) :],
            offsets[polygons + 1 : 2 * (polygons + 1)],
            on_hull,
            holed,
            dangling,
        )
        return Features(
            landmarks,
            np.array([x, y]),
            floats[:n],
            tessellation,
            floats[n:].reshape(polygons, width),
            fingerprint.decode("ascii"),
            diameters,
        )


class _Reader:
    def __init__(self, blob: bytes) -> None:
        self._blob, self._at = blob, _HEADER.size

    def take(self, dtype: str, count: int) -> NDArray[Any]:
        array = np.frombuffer(self._blob, dtype, count, self._at).copy()
        self._at += array.nbytes
        return array


def describe(xy: ArrayLike, config: Config, diameters: ArrayLike | None = None, budget: Budget = UNBOUNDED) -> Features:
    """Compute the features of one submap or observation.

    Args:
        xy: (N, 2), metres, any rigid frame; projected coordinates too, because they are centred first.
        config: its description parameters (`samples`, `squared`, `keep_hull`) shape the features.
        diameters: (N,), stem diameters in any unit, NaN where one is not known. They are evidence, never required.
        budget: when the work must end; by default never.

    Raises:
        LandmarkError: the landmarks or diameters cannot be used. Nothing is repaired silently.
        DeadlinePassed: the deadline passed first.
        Abandoned: nobody waits for the result any more.
    """
    posted = check_landmarks(xy)
    measured = check_diameters(diameters, len(posted))
    origin = posted.mean(axis=0)
    landmarks = posted - origin
    tessellation = tessellate(landmarks, keep_hull=config.keep_hull, budget=budget)
    budget.check()
    descriptors = describe_outlines(
        landmarks, tessellation.vertices, tessellation.vertex_offsets, config.samples, config.squared
    )
    density = local_density(landmarks, tessellation.triangles)
    return Features(landmarks, origin, density, tessellation, descriptors, config.fingerprint(), measured)


@kernel
def local_density(landmarks: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float32]:
    """Landmarks per square metre (N,) float32 around each landmark (N, 2), metres.

    Each corner of a Delaunay triangle (T, 3) gets a third of its area. Areas are pooled over a landmark, its neighbours
    and their neighbours, about 20 landmarks: few enough to tell a thicket from the clearing beside it, and enough to
    average out chance.
    """
    n = len(landmarks)
    area, share = np.zeros(n), np.ones(n)
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ux, uy = landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1]
        vx, vy = landmarks[c, 0] - landmarks[a, 0], landmarks[c, 1] - landmarks[a, 1]
        third = abs(ux * vy - uy * vx) / 6.0
        area[a] += third
        area[b] += third
        area[c] += third
    for _ in range(2):
        pooled_area, pooled_share = area.copy(), share.copy()
        for t in range(len(triangles)):
            for k in range(3):
                # Each directed edge belongs to one counter-clockwise triangle; a hull edge passes its area one way.
                a, b = triangles[t, k], triangles[t, (k + 1) % 3]
                pooled_area[b] += area[a]
                pooled_share[b] += share[a]
        area, share = pooled_area, pooled_share
    density = np.empty(n, np.float32)
    for i in range(n):
        density[i] = share[i] / area[i] if area[i] > 0.0 else np.inf
    # A landmark that lies in no triangle (or in flat ones) has no area of its own.
    finite = density[np.isfinite(density)]
    typical = np.median(finite) if len(finite) else np.float32(1.0)
    for i in range(n):
        if not np.isfinite(density[i]):
            density[i] = typical
    return density
