"""The submaps of one search: features are read once, and landmarks prepared once."""

from collections.abc import Iterable

from urquhart.features.describe import Features
from urquhart.index.submap_collection import FeatureSource
from urquhart.verify.landmark_grid import LandmarkGrid, landmark_grid


class SubmapCache:
    """Features of submaps by key, read from their source on first use."""

    def __init__(self, source: FeatureSource, reach: float) -> None:
        self._source, self._reach = source, reach
        self._features: dict[int, Features] = {}
        self._grids: dict[int, LandmarkGrid] = {}

    def read(self, keys: Iterable[int]) -> None:
        """Read many submaps at once, which is far cheaper than one by one. Raises KeyError for an unknown key."""
        missing = [key for key in keys if key not in self._features]
        if missing:
            self._features.update(self._source.read(missing))

    def features(self, key: int) -> Features:
        """Features of a submap. Raises KeyError for an unknown key."""
        self.read((key,))
        return self._features[key]

    def grid(self, key: int) -> LandmarkGrid:
        """The landmarks of a submap, prepared for verification. Raises KeyError for an unknown key."""
        if key not in self._grids:
            self._grids[key] = landmark_grid(self.features(key), self._reach)
        return self._grids[key]
