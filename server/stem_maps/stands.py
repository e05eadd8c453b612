"""Whole stands in: a stem map cut into discs, each stored as a submap with its pose in the map."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydantic import ValidationError

from server.batches import Refusal
from server.ingest import ingest_many
from server.schemas.common import MapPose, check_id
from server.schemas.submaps import Landmark, NamedSubmap
from server.settings import Limits
from server.stem_maps.discs import Cut, Disc, cut
from server.stem_maps.reader import StemMap
from server.store.database import Database

BATCH = 200


class StandError(ValueError):
    """A stem map whose names cannot be used. The message is one line that says what to change."""


@dataclass(slots=True)
class StandReport:
    """What became of one stem map; `seconds` from the first submap described to the last one durable."""

    name: str
    cut: Cut
    created: int = 0
    replaced: int = 0
    unchanged: int = 0
    refused: list[Refusal] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def submaps(self) -> int:
        """Submaps that are in the database now."""
        return self.created + self.replaced + self.unchanged


def store_stand(
    database: Database,
    collection: str,
    stem_map: StemMap,
    stand: Cut,
    *,
    limits: Limits,
    advance: Callable[[int], None] | None = None,
) -> StandReport:
    """Store the discs of `stand`, which `stem_map` was cut into, in a collection that exists.

    `advance` is told how many more submaps are durable, batch by batch.

    Raises:
        StandError: the map's name or a tree's id or species is not one that a submap can have.
        DomainError: what `ingest_many` raises; the batches before are stored.
    """
    report = StandReport(stem_map.name, stand)
    began = time.perf_counter()
    for batch in ingest_many(database, collection, submaps_of(stem_map, stand), batch_size=BATCH, limits=limits):
        report.created += batch.created
        report.replaced += batch.replaced
        report.unchanged += batch.unchanged
        report.refused += batch.refused
        if advance is not None:
            advance(batch.submaps)
    report.seconds = time.perf_counter() - began
    return report


def cut_stand(stem_map: StemMap, radius: float, spacing: float, limits: Limits) -> Cut:
    """Cut `stem_map` into discs that the service takes.

    Raises:
        CuttingError: radius or spacing does not fit the map.
        StandError: the map's name is not one that a submap can have.
    """
    try:
        check_id(f"{stem_map.name}-000-000")
    except ValueError as error:
        raise StandError(
            f"the file's name {stem_map.name!r} becomes the submaps' ids, and {error}: rename it"
        ) from error
    return cut(stem_map, radius, spacing, maximum_trees=limits.landmarks)


def submaps_of(stem_map: StemMap, stand: Cut) -> Iterator[NamedSubmap]:
    """The discs as submaps: each in its own frame, with the trees' ids and what else is known of them.

    Raises:
        StandError: a tree's id or species is not one that a landmark can have.
    """
    for disc in stand.discs:
        try:
            yield NamedSubmap(
                id=disc.submap_id,
                frame_id=disc.submap_id,
                # The frame was cut out of the map: its pose there is exact.
                map_pose=MapPose(
                    frame_id=stem_map.name, x=disc.centre[0], y=disc.centre[1], yaw=0.0, covariance=[0.0] * 9
                ),
                **_landmarks(stem_map, disc),
            )
        except ValidationError as error:
            first = error.errors()[0]
            raise StandError(
                f"{stem_map.name}: tree value {first['input']!r}: {first['msg'].removeprefix('Value error, ')}"
            ) from error


def _landmarks(stem_map: StemMap, disc: Disc) -> dict[str, Any]:
    trees = disc.tree_indices.tolist()
    ids = [stem_map.ids[tree] for tree in trees]
    if stem_map.dbh_cm is None and stem_map.height_m is None and stem_map.species is None:
        return {"xy": [tuple(point) for point in disc.xy.tolist()], "ids": ids}
    return {
        "landmarks": [_landmark(stem_map, tree, x, y) for tree, (x, y) in zip(trees, disc.xy.tolist(), strict=True)]
    }


def landmarks_of(stem_map: StemMap) -> list[Landmark]:
    """All trees of a stem map, with what is known of them. Raises pydantic's ValidationError."""
    return [_landmark(stem_map, tree, x, y) for tree, (x, y) in enumerate(stem_map.xy.tolist())]


def _landmark(stem_map: StemMap, tree: int, x: float, y: float) -> Landmark:
    known: dict[str, Any] = {}
    if stem_map.dbh_cm is not None and np.isfinite(stem_map.dbh_cm[tree]):
        known["dbh"] = float(stem_map.dbh_cm[tree]) / 100.0  # the API is in metres
    if stem_map.height_m is not None and np.isfinite(stem_map.height_m[tree]):
        known["height"] = float(stem_map.height_m[tree])
    if stem_map.species is not None and stem_map.species[tree]:
        known["species"] = stem_map.species[tree]
    return Landmark(id=stem_map.ids[tree], x=x, y=y, **known)
