"""A collection of submaps: its index, and the features of its submaps wherever they are kept."""

from collections.abc import Collection as Keys
from collections.abc import Iterable, Mapping
from typing import Protocol

from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.index.collection_index import CollectionIndex


class FeatureSource(Protocol):
    """Where features are kept."""

    def read(self, keys: Keys[int]) -> Mapping[int, Features]:
        """Features of submaps by key. Raises KeyError for one that is not there."""
        ...


class FeatureMemory:
    """Features kept in memory; a change makes a new one, so a look-up goes on with the one it began with."""

    def __init__(self, features: Mapping[int, Features] | None = None) -> None:
        self._features = dict(features or {})

    def read(self, keys: Keys[int]) -> Mapping[int, Features]:
        """Features of submaps by key. Raises KeyError."""
        return {key: self._features[key] for key in keys}

    def with_changes(self, added: Mapping[int, Features], removed: Keys[int]) -> "FeatureMemory":
        """The same with submaps added or replaced, and without others; unknown keys are ignored."""
        gone = frozenset(removed)
        return FeatureMemory({key: known for key, known in self._features.items() if key not in gone} | dict(added))


class Collection:
    """Submaps by key. Both parts are immutable, and a change replaces both at once."""

    def __init__(
        self, config: Config, index: CollectionIndex | None = None, source: FeatureSource | None = None
    ) -> None:
        """Start empty, or with an `index` over submaps whose features are in `source`; by default in memory."""
        self.config = config
        # One pair, replaced as one: a look-up in another thread must not get the index of one state and the features of
        # another.
        self._held: tuple[CollectionIndex, FeatureSource] = (
            CollectionIndex(config) if index is None else index,
            FeatureMemory() if source is None else source,
        )

    @property
    def snapshot(self) -> tuple[CollectionIndex, FeatureSource]:
        """The index and the features as they are now; later changes of the collection leave them as they are."""
        return self._held

    @property
    def index(self) -> CollectionIndex:
        """What is searched."""
        return self._held[0]

    def __len__(self) -> int:
        return len(self.index)

    def __contains__(self, key: int) -> bool:
        return key in self.index

    def features(self, key: int) -> Features:
        """Features of a submap. Raises KeyError."""
        return self._held[1].read((key,))[key]

    def add(self, items: Iterable[tuple[int, Features]]) -> None:
        """Add submaps by key; a key that is present is replaced. Many at once are far cheaper than one by one.

        Raises:
            ValueError: features made with another configuration; nothing is added.
            TypeError: the features are kept elsewhere.
        """
        self._change(dict(items), ())

    def remove(self, keys: Iterable[int]) -> None:
        """Forget submaps; unknown keys are ignored. Raises TypeError: the features are kept elsewhere."""
        self._change({}, tuple(keys))

    def _change(self, added: Mapping[int, Features], removed: Keys[int]) -> None:
        index, source = self._held
        if not isinstance(source, FeatureMemory):
            raise TypeError("the features of these submaps are kept elsewhere")
        self._held = (index.with_changes(added.items(), removed), source.with_changes(added, removed))
