"""Many observations in three files: points one after the other, where each begins, and where each was made."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from benchmarks.scale.tiled_forest import Seen
from urquhart.se2 import SE2


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """N observations, read from the disk when they are asked for.

    Attributes:
        points: (T, 2) float64, metres, each in its observation's own frame.
        offsets: (N + 1,) int64; those of observation i are `points[offsets[i]:offsets[i + 1]]`.
        poses: (N, 3) float64: x, y (metres), yaw (radians) of `map_T_sensor`.
    """

    points: NDArray[np.float64]
    offsets: NDArray[np.int64]
    poses: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.poses)

    def xy(self, i: int) -> NDArray[np.float64]:
        """Landmarks (n, 2) of observation i, metres, a writable copy: a read-only array is another type to kernels."""
        return np.array(self.points[self.offsets[i] : self.offsets[i + 1]])

    def pose(self, i: int) -> SE2:
        """Where observation i was made, `map_T_sensor`."""
        return SE2(*self.poses[i].tolist())

    @staticmethod
    def load(folder: Path, name: str) -> "Observations":
        """What was written under `name`."""
        points, offsets, poses = (np.load(path, mmap_mode="r") for path in _paths(folder, name))
        return Observations(points, offsets, np.array(poses))


def write(folder: Path, name: str, seen: Sequence[Seen]) -> None:
    """Write observations under `name`."""
    points, offsets, poses = _paths(folder, name)
    np.save(points, np.concatenate([one.xy for one in seen]))
    np.save(offsets, np.cumsum([0, *(len(one.xy) for one in seen)], dtype=np.int64))
    np.save(poses, np.array([(one.pose.x, one.pose.y, one.pose.yaw) for one in seen]))


def join(folder: Path, name: str, parts: Sequence[str]) -> None:
    """Put parts one after the other under `name`, and remove them. No more than one of them is held in memory."""
    read = [Observations.load(folder, part) for part in parts]
    points, offsets, poses = _paths(folder, name)
    whole = open_memmap(points, mode="w+", dtype=np.float64, shape=(sum(len(one.points) for one in read), 2))
    starts, at = [np.zeros(1, np.int64)], 0
    for one in read:
        whole[at : at + len(one.points)] = one.points
        starts.append(one.offsets[1:] + at)
        at += len(one.points)
    whole.flush()
    np.save(offsets, np.concatenate(starts))
    np.save(poses, np.concatenate([one.poses for one in read]))
    del read
    for part in parts:
        for path in _paths(folder, part):
            path.unlink()


def _paths(folder: Path, name: str) -> tuple[Path, Path, Path]:
    return tuple(folder / f"{name}-{what}.npy" for what in ("points", "offsets", "poses"))  # type: ignore[return-value]
