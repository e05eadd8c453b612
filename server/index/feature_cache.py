"""Features of submaps, read in the read view of a search, with a cache of those read recently."""

import threading
from collections import OrderedDict
from collections.abc import Collection, Iterable, Mapping

from server.index.row_decoding import features_of
from server.store.storage import ReadTransaction
from urquhart import Config, Features, FeaturesError

_OVERHEAD = 2_000
"""Bytes of the objects around a submap's arrays."""
_UNPACKED = 1.3
"""Size of the arrays relative to the BLOB."""

Entry = tuple[int, Features, int]
"""Content revision, features, bytes."""


class FeatureCache:
    """Features by owner (a live index) and key. The least recently used are dropped first.

    An entry is valid for every view of its owner from its content revision on: a changed submap is dropped before any
    view can have the revision of the change. What an older view reads may have changed since, so only a view at the
    owner's present revision may add entries.
    """

    def __init__(self, most_bytes: int) -> None:
        """Keep at most `most_bytes`."""
        self._most = most_bytes
        self._bytes = 0
        self._entries: OrderedDict[tuple[int, int], Entry] = OrderedDict()
        self._revisions: dict[int, int] = {}
        self._guard = threading.Lock()

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def nbytes(self) -> int:
        """Approximate bytes of the entries."""
        return self._bytes

    def get(self, owner: int, keys: Iterable[int], revision: int) -> dict[int, Features]:
        """The features that are cached and valid at `revision`."""
        found = {}
        with self._guard:
            for key in keys:
                entry = self._entries.get((owner, key))
                if entry is not None and entry[0] <= revision:
                    self._entries.move_to_end((owner, key))
                    found[key] = entry[1]
        return found

    def put(self, owner: int, items: Mapping[int, Entry], revision: int) -> None:
        """Add features that were read at `revision`, if that is still the owner's revision."""
        with self._guard:
            if self._revisions.get(owner) != revision:
                return
            for key, entry in items.items():
                self._remove((owner, key))
                self._entries[owner, key] = entry
                self._bytes += entry[2]
            while self._bytes > self._most and self._entries:
                self._remove(next(iter(self._entries)))

    def advance(self, owner: int, revision: int, changed: Iterable[int] | None) -> None:
        """The owner is about to move to a revision at which these submaps are changed or deleted; None: all of them."""
        with self._guard:
            if changed is None:
                self._clear(owner)
            else:
                for key in changed:
                    self._remove((owner, key))
            self._revisions[owner] = revision

    def forget(self, owner: int) -> None:
        """Drop all entries of an owner, and accept no more of it."""
        with self._guard:
            self._clear(owner)
            self._revisions.pop(owner, None)

    def _clear(self, owner: int) -> None:
        for known in [known for known in self._entries if known[0] == owner]:
            self._remove(known)

    def _remove(self, known: tuple[int, int]) -> None:
        entry = self._entries.pop(known, None)
        if entry is not None:
            self._bytes -= entry[2]


class FeatureReader:
    """The features of a collection at a view's revision: a `urquhart.index.submap_collection.FeatureSource`."""

    def __init__(
        self, tx: ReadTransaction, collection_key: int, config: Config, cache: FeatureCache, owner: int, revision: int
    ) -> None:
        """`tx` has a read view at `revision`. `owner` is known to the cache."""
        self._described = tx.features(collection_key)
        self._config = config
        self._cache, self._owner, self._revision = cache, owner, revision

    def read(self, keys: Collection[int]) -> Mapping[int, Features]:
        """Features of submaps by key. If stored ones cannot be used, the landmarks are described again.

        Raises:
            KeyError: a submap is not there.
        """
        found = self._cache.get(self._owner, keys, self._revision)
        missing = [key for key in keys if key not in found]
        if missing:
            new, unusable = dict[int, Entry](), list[int]()
            for key, changed, blob in self._described.packed(missing):
                try:
                    features = Features.unpack(blob)
                except FeaturesError:
                    unusable.append(key)
                    continue
                if features.fingerprint == self._config.fingerprint():
                    new[key] = (changed, features, _size(blob))
                else:
                    unusable.append(key)
            for row in self._described.stored(unusable):
                features = features_of(row.features, row.landmarks, row.attributes, self._config)
                new[row.key] = (row.content_revision, features, _size(row.features))
            self._cache.put(self._owner, new, self._revision)
            found |= {key: features for key, (_, features, _) in new.items()}
        if len(found) < len(set(keys)):
            raise KeyError(next(key for key in keys if key not in found))
        return found


def _size(blob: bytes) -> int:
    return int(_UNPACKED * len(blob)) + _OVERHEAD
