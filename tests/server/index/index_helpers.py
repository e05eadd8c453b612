"""What the tests of the index share: the parts of a process over a database, with thresholds of a few submaps."""

import functools
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from server.checks.database import discrepancies
from server.checks.index import index_discrepancies
from server.config.settings import Limits
from server.config.settings_groups import IndexSettings
from server.index.live_indexes import LiveIndexes
from server.index.maintenance import Maintenance
from server.observability.metrics import Metrics
from server.queries import lookup
from server.queries.query import PlaceQuery
from server.schemas.queries import QueryAnswer, QueryInput
from server.schemas.submaps import NamedSubmap, SubmapInput
from server.store.records import SegmentRecord
from server.store.sqlite.database import Database
from server.store.submap_records import SubmapMetadata
from server.submaps import bulk_ingest, writes
from tests.server.factories import forest, points
from urquhart import Features
from urquhart.index.collection_index import CollectionIndex
from urquhart.index.segment import Segment, merge_segments

LIMITS = Limits()
FEW = IndexSettings(flush_submaps=3, memory_submaps=12, block_submaps=4, cache_mb=1, maintenance_seconds=0.05)


@functools.cache
def trees(seed: int) -> NDArray[np.float64]:
    """A small forest that is quickly looked up."""
    return forest(seed, count=30, radius=25.0)


class Process:
    """What another process would have: its own connections, locks and indexes over the same file."""

    def __init__(self, path: Path, settings: IndexSettings = FEW, *, read_only: bool = False) -> None:
        self.database = Database(path, read_only=read_only)
        self.metrics = Metrics()
        self.indexes = LiveIndexes(self.database, self.metrics, settings)
        self.maintenance = Maintenance(self.database, self.indexes, self.metrics)

    def put(self, name: str, seed: int) -> None:
        """Store a forest."""
        body = SubmapInput.model_validate({"xy": points(trees(seed))})
        writes.put(self.database, "plots", name, body, LIMITS)

    def put_many(self, seeds: range, *, batch: int = 500) -> None:
        """Store forests under their seeds, `batch` of them in a transaction."""
        named = (NamedSubmap.model_validate({"id": f"p{seed}", "xy": points(trees(seed))}) for seed in seeds)
        for _ in bulk_ingest.ingest_many(self.database, "plots", named, batch_size=batch):
            pass

    def delete(self, name: str) -> None:
        """Remove it."""
        writes.delete(self.database, "plots", name)

    def ask(self, seed: int) -> QueryAnswer:
        """Query with a forest."""
        query = PlaceQuery.of(QueryInput.model_validate({"xy": points(trees(seed))}), LIMITS)
        return lookup.answer_query(
            lookup.QueryContext(self.database, self.indexes, self.metrics, LIMITS), "plots", query
        )

    def found(self, seed: int) -> str | None:
        """The submap that a forest is matched to."""
        answer = self.ask(seed)
        return answer.candidates[0].submap_id if answer.verdict == "matched" else None

    def chain(self) -> tuple[SegmentRecord, ...]:
        """The segments that are listed."""
        with self.indexes.view("plots") as view:
            return view.tx.segments(view.collection.key).chain()

    def files(self) -> list[str]:
        """Names of the segment files that lie there, listed or not."""
        folder = self.indexes.folder.path
        return sorted(path.name for path in folder.glob("*.segment*")) if folder.is_dir() else []

    def held(self) -> set[str]:
        """Ids of the submaps in the index, which must be that of the rows of the same view."""
        with self.indexes.view("plots") as view:
            keys = list(view.recognizer.index)
            assert len(keys) == len(set(keys)) == len(view.recognizer) == view.collection.submap_count
            rows = list(view.tx.submaps(view.collection.key).every(SubmapMetadata))
            assert set(keys) == {row.key for row in rows}
            if keys:
                as_rebuilt(view.recognizer.index, view.recognizer.features)
            return {row.id for row in rows}

    def agreed(self) -> None:
        """Everything in the database and its index agrees."""
        assert list(discrepancies(self.database)) == []
        assert list(index_discrepancies(self.database)) == []

    def close(self) -> None:
        """Close the connections."""
        self.database.dispose()


def as_rebuilt(index: CollectionIndex, features: Callable[[int], Features]) -> None:
    """The index holds the quads and polygons of its submaps as they are now.

    Found or not is no proof of that: a small collection is searched exhaustively where its features are of no use.
    """
    whole = merge_segments([(part.segment, part.alive) for part in index.live_segments])
    rebuilt = Segment.build([(key, features(key)) for key in index], index.config)
    for name in ("keys", "scales", "units"):
        assert np.array_equal(getattr(whole, name), getattr(rebuilt, name)), name
    assert np.array_equal(whole.quads.codes, rebuilt.quads.codes)
    assert np.array_equal(whole.quads.starts, rebuilt.quads.starts)
    for one, other in zip(*(np.split(s.quads.words, s.quads.starts[1:-1]) for s in (whole, rebuilt)), strict=True):
        assert np.array_equal(np.sort(one), np.sort(other))
    assert polygons_of(whole) == polygons_of(rebuilt)


def polygons_of(segment: Segment) -> dict[int, list[tuple[int, bytes]]]:
    """Slot and outline of every polygon, by vertex count."""
    return {
        count: sorted((int(owner), outline.tobytes()) for owner, outline in zip(p.owners, p.outlines, strict=True))
        for count, p in segment.polygons.items()
        if len(p.owners)
    }


def damage(path: Path, kind: str, rng: random.Random) -> None:
    """Put a damaged file in the place of a sound one; who has mapped that keeps it as it was."""
    content = bytearray(path.read_bytes())
    match kind if len(content) > 65_544 else "empty":
        case "missing":
            path.unlink(missing_ok=True)
            return
        case "empty":
            content = bytearray()
        case "truncated":
            content = content[: rng.randrange(1, len(content))]
        case "header":
            content[rng.randrange(16, 400)] ^= 1 << rng.randrange(8)
        case "flipped":
            content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        case "arrays":
            content[65_536 + rng.randrange(8)] ^= 1 << rng.randrange(8)
        case _:
            raise ValueError(kind)
    temporary = path.with_suffix(".damaged")
    temporary.write_bytes(content)
    temporary.replace(path)
