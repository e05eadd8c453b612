"""The submaps that one look-up has to do with: features read once, landmarks made ready once."""

from collections.abc import Iterable

from urquhart.features.describe import Features
from urquhart.index.collection import FeatureSource
from urquhart.verify.evidence import pattern
from urquhart.verify.pairing import Pattern


class Submaps:
    """Features of submaps by key, read from their source when they are first asked for."""

    def __init__(self, source: FeatureSource, reach: float) -> None:
        self._source, self._reach = source, reach
        self._features: dict[int, Features] = {}
        self._patterns: dict[int, Pattern] = {}

    def read(self, keys: Iterable[int]) -> None:
        """Read many at once, which is far cheaper than one by one. Raises KeyError."""
        missing = [key for key in keys if key not in self._features]
        if missing:
            self._features.update(self._source.read(missing))

    def features(self, key: int) -> Features:
        """Features of a submap. Raises KeyError."""
        self.read((key,))
        return self._features[key]

    def pattern(self, key: int) -> Pattern:
        """A submap ready for verification. Raises KeyError."""
        if key not in self._patterns:
            self._patterns[key] = pattern(self.features(key), self._reach)
        return self._patterns[key]
