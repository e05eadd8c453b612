"""Submaps to search: their `CollectionIndex`, which finds candidates, and the source of their features, which verifies
them. A program without a database keeps its submaps in a `SubmapCollection`."""

from collections.abc import Collection as Keys
from collections.abc import Iterable, Mapping
from typing import Protocol

from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.index.collection_index import CollectionIndex


class FeatureSource(Protocol):
    """Where the features of a collection are kept: in memory, or in the rows of a database."""

    def read(self, keys: Keys[int]) -> Mapping[int, Features]:
        """Features of submaps by key. Raises KeyError for an unknown key."""
        ...


class FeatureMemory:
    """Features kept in memory. It is immutable: a change makes a new one, and a running search keeps its own."""

    def __init__(self, features: Mapping[int, Features] | None = None) -> None:
        self._features = dict(features or {})

    def read(self, keys: Keys[int]) -> Mapping[int, Features]:
        """Features of submaps by key. Raises KeyError for an unknown key."""
        return {key: self._features[key] for key in keys}

    def with_changes(self, added: Mapping[int, Features], removed: Keys[int]) -> "FeatureMemory":
        """A copy with submaps added or replaced, and others removed; unknown keys are ignored."""
        gone = frozenset(removed)
        return FeatureMemory({key: known for key, known in self._features.items() if key not in gone} | dict(added))


class SubmapCollection:
    """Submaps by key: an index and a feature source. Both are immutable, and a change replaces both at once."""

    def __init__(
        self, config: Config, index: CollectionIndex | None = None, source: FeatureSource | None = None
    ) -> None:
        """Start empty, or with an `index` over submaps whose features are in `source`; by default in memory."""
        self.config = config
        # One pair, replaced as a whole: a search in another thread must not mix the index of one state with the
        # features of another.
        self._held: tuple[CollectionIndex, FeatureSource] = (
            CollectionIndex(config) if index is None else index,
            FeatureMemory() if source is None else source,
        )

    @property
    def read_view(self) -> tuple[CollectionIndex, FeatureSource]:
        """The current index and feature source; later changes of the collection do not affect them."""
        return self._held

    @property
    def index(self) -> CollectionIndex:
        """The current index."""
        return self._held[0]

    def __len__(self) -> int:
        return len(self.index)

    def __contains__(self, key: int) -> bool:
        return key in self.index

    def features(self, key: int) -> Features:
        """Features of a submap. Raises KeyError for an unknown key."""
        return self._held[1].read((key,))[key]

    def add(self, items: Iterable[tuple[int, Features]]) -> None:
        """Add submaps by key; existing keys are replaced. Many at once are far cheaper than one by one.

        Raises:
            ValueError: features made with another configuration; nothing is added.
            TypeError: the features are not kept in memory, so they cannot be changed here.
        """
        self._change(dict(items), ())

    def remove(self, keys: Iterable[int]) -> None:
        """Remove submaps; unknown keys are ignored. Raises TypeError if the features are not kept in memory."""
        self._change({}, tuple(keys))

    def _change(self, added: Mapping[int, Features], removed: Keys[int]) -> None:
        index, source = self._held
        if not isinstance(source, FeatureMemory):
            raise TypeError("the features of these submaps are not kept in memory")
        self._held = (index.with_changes(added.items(), removed), source.with_changes(added, removed))
