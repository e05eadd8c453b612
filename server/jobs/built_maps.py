"""Maps that jobs have built, and merges, read from their results."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson

from server.collections.crud import get_collection
from server.errors import NotFound
from server.jobs import queue
from server.jobs.folder import JobFolder
from server.maps.files import tree_layer
from server.maps.results import StoredMap, read_map
from server.outputs.files import OutputFormat
from server.platform.disk_errors import disk_errors
from server.schemas.maps.answers import MapAnswer, PartTrees
from server.schemas.maps.merges import MergeAnswer
from server.security.principal import Principal
from server.store.storage import Storage


def map_answer(database: Storage, folder: JobFolder, caller: Principal, collection_id: str, map_id: str) -> MapAnswer:
    """A map in numbers, with its poses and constraints. Raises NotFound, Conflict (unfinished) and Gone."""
    job = queue.read(database, caller, map_id)
    found = _read(database, folder, caller, (collection_id, map_id), trees=False)
    assert found.summary is not None
    version = job.counts.get("map_version")
    return MapAnswer(
        id=map_id,
        summary=found.summary,
        map_version=version,
        poses=found.poses,
        constraints=found.constraints,
        contradictions=found.contradictions,
    )


def merge_answer(database: Storage, folder: JobFolder, caller: Principal, place: tuple[str, str]) -> MergeAnswer:
    """A merge with its pairs; `place` is the collection and the merge. Raises NotFound, Conflict and Gone."""
    job = queue.read(database, caller, place[1])
    summary, *pairs = _documents(database, folder, caller, place, "merge")
    for one in (summary, *pairs):
        del one["of"]
    return MergeAnswer.model_validate(
        {"id": place[1], "summary": summary, "map_version": job.counts.get("map_version"), "pairs": pairs}
    )


def trees_answer(
    database: Storage, folder: JobFolder, caller: Principal, place: tuple[str, str], part: int
) -> PartTrees:
    """The trees of a part of a map; `place` is the collection and the map. Raises NotFound, Conflict and Gone."""
    found = _read(database, folder, caller, place, trees=True)
    return PartTrees(part=part, frame_id=_frame(found, part), trees=[one for one in found.trees if one.part == part])


def tree_file(database: Storage, collection_id: str, told: PartTrees, form: OutputFormat) -> bytes:
    """The trees of a part of a map as a file.

    Raises NotFound, NotAcceptable (the package that writes the format is not installed, or GeoJSON of a frame without a
    coordinate reference system) and StorageError.
    """
    with database.read() as tx:
        layer, rows = tree_layer(tx, get_collection(tx, collection_id), told.frame_id, told.trees)
    beside = None if database.read_only else str(database.path.parent)
    with (
        disk_errors(database.path),
        tempfile.TemporaryDirectory(prefix=".export-", dir=beside, ignore_cleanup_errors=True) as folder,
    ):
        path = Path(folder) / f"trees{form.suffix}"
        form.write(path, layer, [rows])
        return path.read_bytes()


def _read(database: Storage, folder: JobFolder, caller: Principal, place: tuple[str, str], *, trees: bool) -> StoredMap:
    collection_id, map_id = place
    with database.read() as tx:
        key = get_collection(tx, collection_id).key
    left = queue.results(database, folder, caller, map_id)
    with left.file as file:
        if left.kind != "map" or left.collection_key != key or not left.size:
            raise NotFound("map", map_id[:100])
        return read_map(_lines(file.read(left.size)), trees=trees)


def _documents(
    database: Storage, folder: JobFolder, caller: Principal, place: tuple[str, str], kind: str
) -> list[dict[str, Any]]:
    """The lines of the results of a job of a kind. Raises NotFound, Conflict (unfinished) and Gone."""
    collection_id, job_id = place
    with database.read() as tx:
        key = get_collection(tx, collection_id).key
    left = queue.results(database, folder, caller, job_id)
    with left.file as file:
        if left.kind != kind or left.collection_key != key or not left.size:
            raise NotFound(kind, job_id[:100])
        return [orjson.loads(line) for line in _lines(file.read(left.size))]


def _lines(content: bytes) -> Iterator[bytes]:
    yield from content.splitlines()


def _frame(found: StoredMap, part: int) -> str:
    """The map frame of a part. Raises NotFound."""
    for one in found.poses:
        if one.part == part and one.map_pose is not None:
            return one.map_pose.frame_id
    raise NotFound("part", str(part))
