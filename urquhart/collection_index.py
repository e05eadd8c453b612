"""Everything a look-up reads of one collection: features by key, polygons by vertex count, quads by length.

All of it is derived from landmarks and can be rebuilt at any time.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from urquhart.config import Config
from urquhart.descriptor import dimension
from urquhart.features import Features
from urquhart.index import PolygonIndex
from urquhart.pairing import Pattern
from urquhart.quad_index import QuadIndex
from urquhart.quads import measure
from urquhart.verification import REACH, pattern
from urquhart.voting import outlines


class CollectionIndex:
    """Features and indexes of one collection. Not safe for a change during a search; searches may run side by side."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self.reach = REACH * config.sigma
        self.polygons = PolygonIndex(dimension(config.samples))
        self.quads = QuadIndex()
        self._features: dict[int, Features] = {}

    def __len__(self) -> int:
        return len(self._features)

    def __contains__(self, key: int) -> bool:
        return key in self._features

    def features(self, key: int) -> Features:
        """Features of a submap. Raises KeyError."""
        return self._features[key]

    def __iter__(self) -> Iterator[int]:
        """Keys of all submaps, in the order in which they were added."""
        return iter(self._features)

    def pattern(self, key: int) -> Pattern:
        """A submap ready for verification. Raises KeyError."""
        return pattern(self._features[key], self.reach)

    def has_others(self, excluded: frozenset[int]) -> bool:
        """Whether there is a submap that is not excluded."""
        return len(self) > len(excluded) or any(key not in excluded for key in self._features)

    def add(self, items: Iterable[tuple[int, Features]]) -> None:
        """Add submaps by key; a key that is present is replaced. Many at once are far cheaper than one by one.

        Raises:
            ValueError: features made with another configuration; nothing is added.
        """
        new = dict(items)
        for key, features in new.items():
            if features.fingerprint != self.config.fingerprint():
                raise ValueError(f"features of submap {key} were made with another configuration: describe it again")
        self.remove(new)
        self._features.update(new)
        self.quads.add((key, *measure(f.landmarks, f.tessellation.quads)) for key, f in new.items())
        by_count: dict[int, list[tuple[int, Features]]] = {}
        for key, features in new.items():
            for count in np.unique(features.tessellation.vertex_counts()).tolist():
                by_count.setdefault(count, []).append((key, features))
        for count, members in by_count.items():
            self._add_polygons(count, members)

    def remove(self, keys: Iterable[int]) -> None:
        """Forget submaps; unknown keys are ignored."""
        known = {key for key in keys if key in self._features}
        if known:
            self.polygons.remove(known)
            self.quads.remove(known)
            for key in known:
                del self._features[key]

    def _add_polygons(self, count: int, members: list[tuple[int, Features]]) -> None:
        parts = [(key, features, *outlines(features, count)) for key, features in members]
        self.polygons.add(
            np.concatenate([np.full(len(ordinals), key, np.int64) for key, _, ordinals, _ in parts]),
            np.concatenate([ordinals for _, _, ordinals, _ in parts]),
            np.concatenate([shapes for _, _, _, shapes in parts]).astype(np.float32),
            np.concatenate([features.descriptors[ordinals] for _, features, ordinals, _ in parts]),
        )
