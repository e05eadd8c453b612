"""Features of submaps, wherever they are kept, read when a look-up first asks for them."""

from collections.abc import Collection, Iterable, Mapping
from typing import Protocol

from urquhart.features.describe import Features
from urquhart.verify.evidence import pattern
from urquhart.verify.pairing import Pattern


class Source(Protocol):
    """Where features are kept."""

    def read(self, keys: Collection[int]) -> Mapping[int, Features]:
        """Features of submaps by key. Raises KeyError for one that is not there."""
        ...


class Memory:
    """Features kept in memory; changes make another, so that a look-up goes on with what it began with."""

    def __init__(self, features: Mapping[int, Features] | None = None) -> None:
        self._features = dict(features or {})

    def read(self, keys: Collection[int]) -> Mapping[int, Features]:
        """Features of submaps by key. Raises KeyError."""
        return {key: self._features[key] for key in keys}

    def with_changes(self, added: Mapping[int, Features], removed: Collection[int]) -> "Memory":
        """The same with submaps added or replaced, and without others; unknown keys are ignored."""
        gone = frozenset(removed)
        return Memory({key: known for key, known in self._features.items() if key not in gone} | dict(added))


class Submaps:
    """The submaps that one look-up has to do with: read once, laid out once."""

    def __init__(self, source: Source, reach: float) -> None:
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
