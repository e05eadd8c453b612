"""Stands: stem maps cut into discs, each stored as a submap with its pose in the map."""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray
from pydantic import ValidationError

from server.config.settings import Limits
from server.parsing.field_errors import sentence
from server.schemas.common import check_id
from server.schemas.landmarks import Landmark
from server.schemas.poses import MapPose
from server.stem_maps.plots import cut_plots, keep_whole
from server.stem_maps.reader import StemMap
from server.stem_maps.replacement import DescribedStand, ReplacementReport, StandError, keep_on_disk, replace_stand
from server.stem_maps.tiling import Cut, cut
from server.store.codec import digest, pack_positions
from server.store.records import StandRecord
from server.store.storage import Storage
from server.submaps.bulk_ingest import USUAL, LineOptions, describe_lines
from server.submaps.described_batches import DescribedBatch

BATCH = 200

__all__ = ["StandError", "StandReport", "cut_stand", "landmarks_of", "lines_of", "store_stand", "whole_stand"]


@dataclass(slots=True)
class StandReport:
    """The outcome of one stem map. `seconds` is the time from the first description until all submaps are durable."""

    name: str
    cut: Cut
    outcome: ReplacementReport
    seconds: float

    @property
    def submaps(self) -> int:
        """Number of submaps of the stand in the database now."""
        return self.outcome.created + self.outcome.replaced + self.outcome.unchanged


def store_stand(
    database: Storage,
    collection: str,
    stem_map: StemMap,
    stand: Cut,
    options: LineOptions = USUAL,
    *,
    advance: Callable[[int], None] | None = None,
) -> StandReport:
    """Store the discs of `stand`, which `stem_map` was cut into, in an existing collection.

    They replace everything that was stored under the map's name, in one transaction at the end. `advance` is called
    with the number of submaps described in each batch. `options` are as in `ingest_lines`.

    Raises:
        StandError: a tree's id or species is not one that a landmark can have, or as `replace_stand`.
        DomainError: what `describe_lines` and `replace_stand` raise. Nothing is stored.
    """
    began = time.perf_counter()
    with describe_stand(database, collection, stem_map, stand, options, advance=advance) as described:
        outcome = replace_stand(database, collection, described)
    return StandReport(stem_map.name, stand, outcome, time.perf_counter() - began)


@contextmanager
def describe_stand(
    database: Storage,
    collection: str,
    stem_map: StemMap,
    stand: Cut,
    options: LineOptions = USUAL,
    *,
    advance: Callable[[int], None] | None = None,
) -> Iterator[DescribedStand]:
    """The described submaps of a stand, for `replace_stand` within the block. Arguments and errors as `store_stand`."""
    describing = describe_lines(database, collection, lines_of(stem_map, stand), replace(options, batch_size=BATCH))
    with closing(describing), keep_on_disk(_counted(describing, advance), database.path.parent) as batches:
        ids = [disc.submap_id for disc in stand.discs]
        yield DescribedStand(_record(stem_map, stand), ids, batches)


def _counted(batches: Iterable[DescribedBatch], advance: Callable[[int], None] | None) -> Iterator[DescribedBatch]:
    for batch in batches:
        if advance is not None:
            advance(len(batch.records) + len(batch.refused))
        yield batch


def _record(stem_map: StemMap, stand: Cut) -> StandRecord:
    in_order = stem_map.xy[np.lexsort(stem_map.xy.T)]
    return StandRecord(
        name=stem_map.name,
        frame_id=stem_map.name,
        source_hash=stem_map.source_hash,
        trees_hash=digest(pack_positions(in_order)),
        tree_count=len(stem_map),
        radius=stand.radius,
        spacing=stand.spacing,
        crs=stem_map.crs,
    )


def cut_stand(stem_map: StemMap, radius: float, spacing: float, limits: Limits) -> Cut:
    """Cut `stem_map` into discs within the service's limits, or into its plots if they are to be submaps.

    Raises:
        CuttingError: radius or spacing does not fit the map.
        StandError: the map's name is not one that a submap can have.
    """
    _check_name(stem_map)
    cut_map = cut if stem_map.plots is None else cut_plots
    return cut_map(stem_map, radius, spacing, maximum_trees=limits.landmarks)


def whole_stand(stem_map: StemMap, limits: Limits) -> Cut:
    """Make `stem_map`, or each of its plots, one submap, within the service's limits.

    Raises:
        CuttingError: there are too few or too many trees for a submap, or two plots get one id.
        StandError: the map's name is not one that a submap can have.
    """
    _check_name(stem_map)
    return keep_whole(stem_map, maximum_trees=limits.landmarks)


def _check_name(stem_map: StemMap) -> None:
    try:
        check_id(f"{stem_map.name}-000-000")
    except ValueError as error:
        raise StandError(
            f"the file's name {stem_map.name!r} becomes the submaps' ids, and {error}: rename it"
        ) from error


def lines_of(stem_map: StemMap, stand: Cut) -> Iterator[bytes]:
    """The discs as lines of NDJSON, each in its own frame, with the trees' ids and attributes.

    Raises:
        StandError: a tree's id or species is not one that a landmark can have; before the first line.
    """
    known = _known(stem_map, np.unique(np.concatenate([disc.tree_indices for disc in stand.discs])))
    bare = stem_map.dbh_cm is None and stem_map.height_m is None and stem_map.species is None
    for disc in stand.discs:
        trees = disc.tree_indices.tolist()
        landmarks: dict[str, Any]
        if bare:
            landmarks = {"xy": np.ascontiguousarray(disc.xy), "ids": [stem_map.ids[tree] for tree in trees]}
        else:
            positions = zip(trees, disc.xy.tolist(), strict=True)
            landmarks = {"landmarks": [{**known[tree], "x": x, "y": y} for tree, (x, y) in positions]}
        # The frame is part of the map, so its pose there is exact.
        frame = disc.frame_id or stem_map.name
        pose = MapPose(frame_id=frame, x=disc.centre[0], y=disc.centre[1], yaw=0.0, covariance=[0.0] * 9)
        submap = {"id": disc.submap_id, "frame_id": disc.submap_id, "map_pose": pose.model_dump(), **landmarks}
        yield orjson.dumps(submap, option=orjson.OPT_SERIALIZE_NUMPY)


def _known(stem_map: StemMap, trees: NDArray[np.int64]) -> dict[int, dict[str, Any]]:
    """Attributes of the trees, validated once for all the discs that they are in."""
    try:
        return {
            tree: _landmark(stem_map, tree, 0.0, 0.0).model_dump(exclude_unset=True, exclude={"x", "y"})
            for tree in trees.tolist()
        }
    except ValidationError as error:
        first = error.errors()[0]
        raise StandError(f"{stem_map.name}: tree value {first['input']!r} {sentence(first)}") from error


def landmarks_of(stem_map: StemMap) -> list[Landmark]:
    """All trees of a stem map with their attributes. Raises pydantic's ValidationError."""
    return [_landmark(stem_map, tree, x, y) for tree, (x, y) in enumerate(stem_map.xy.tolist())]


def _landmark(stem_map: StemMap, tree: int, x: float, y: float) -> Landmark:
    known: dict[str, Any] = {}
    if stem_map.dbh_cm is not None and np.isfinite(stem_map.dbh_cm[tree]):
        known["dbh_cm"] = float(stem_map.dbh_cm[tree])
    if stem_map.height_m is not None and np.isfinite(stem_map.height_m[tree]):
        known["height_m"] = float(stem_map.height_m[tree])
    if stem_map.species is not None and stem_map.species[tree]:
        known["species"] = stem_map.species[tree]
    return Landmark(id=stem_map.ids[tree], x=x, y=y, **known)
