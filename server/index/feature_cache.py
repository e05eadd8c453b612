"""Features of submaps, read in the snapshot of a view, and those read lately kept for the views that come."""

import threading
from collections import OrderedDict
from collections.abc import Collection, Iterable, Mapping

from sqlalchemy.orm import Session

from server.index.derived import features_of
from server.store.repositories.feature_rows import FeatureRows
from urquhart import Config, Features, FeaturesError

_OVERHEAD = 2_000
"""Bytes of the objects around a submap's arrays,"""
_UNPACKED = 1.3
"""and how much larger these are than the BLOB."""

Entry = tuple[int, Features, int]
"""Content revision, features, bytes."""


class FeatureCache:
    """Features by owner (a live index) and key, the least lately used going first.

    An entry holds for every view of its owner whose revision is its content revision or a later one: a submap that is
    changed is dropped before any view can be of a revision at which it is. What an older view reads may have changed
    since, so that only a view of the owner's present revision may put something in.
    """

    def __init__(self, most_bytes: int) -> None:
        """Keep up to `most_bytes`."""
        self._most = most_bytes
        self._bytes = 0
        self._entries: OrderedDict[tuple[int, int], Entry] = OrderedDict()
        self._revisions: dict[int, int] = {}
        self._guard = threading.Lock()

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def nbytes(self) -> int:
        """Bytes of what is kept, about."""
        return self._bytes

    def get(self, owner: int, keys: Iterable[int], revision: int) -> dict[int, Features]:
        """Those of the features that are kept and were the submap's at `revision`."""
        found = {}
        with self._guard:
            for key in keys:
                entry = self._entries.get((owner, key))
                if entry is not None and entry[0] <= revision:
                    self._entries.move_to_end((owner, key))
                    found[key] = entry[1]
        return found

    def put(self, owner: int, items: Mapping[int, Entry], revision: int) -> None:
        """Keep features that were read at `revision`, if the owner has not gone on from there."""
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
        """The owner is about to go to a revision at which these submaps are changed or gone; None for any."""
        with self._guard:
            if changed is None:
                self._clear(owner)
            else:
                for key in changed:
                    self._remove((owner, key))
            self._revisions[owner] = revision

    def forget(self, owner: int) -> None:
        """Drop everything of an owner, and take nothing of it any more."""
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
    """The features of a collection as they are at a view's revision: a `urquhart.index.collection.FeatureSource`."""

    def __init__(
        self, session: Session, collection_key: int, config: Config, cache: FeatureCache, owner: int, revision: int
    ) -> None:
        """`session` is on a snapshot at `revision`; `owner` is known to the cache."""
        self._described = FeatureRows(session, collection_key)
        self._config = config
        self._cache, self._owner, self._revision = cache, owner, revision

    def read(self, keys: Collection[int]) -> Mapping[int, Features]:
        """Features of submaps by key, described again where what is stored cannot be used.

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
