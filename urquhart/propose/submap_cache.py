"""The submaps that one look-up has to do with: features read once, landmarks made ready once."""

from collections.abc import Iterable

from urquhart.features.describe import Features
from urquhart.index.collection import FeatureSource
from urquhart.verify.landmark_grid import LandmarkGrid, landmark_grid


class SubmapCache:
    """Features of submaps by key, read from their source when they are first asked for."""

    def __init__(self, source: FeatureSource, reach: float) -> None:
        self._source, self._reach = source, reach
        self._features: dict[int, Features] = {}
        self._grids: dict[int, LandmarkGrid] = {}

    def read(self, keys: Iterable[int]) -> None:
        """Read many at once, which is far cheaper than one by one. Raises KeyError."""
        missing = [key for key in keys if key not in self._features]
        if missing:
            self._features.update(self._source.read(missing))

    def features(self, key: int) -> Features:
        """Features of a submap. Raises KeyError."""
        self.read((key,))
        return self._features[key]

    def grid(self, key: int) -> LandmarkGrid:
        """A submap ready for verification. Raises KeyError."""
        if key not in self._grids:
            self._grids[key] = landmark_grid(self.features(key), self._reach)
        return self._grids[key]
