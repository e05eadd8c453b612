"""Submaps in batches, read and described in this process or in others.

Models are slow to send between processes, but JSON is not. So a batch is sent as lines of NDJSON, and what comes back
is ready to be written.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

import numpy as np
import orjson
from pydantic import ValidationError

import urquhart
from server.collections.crud import get_collection
from server.collections.georeference import check_place
from server.config.settings import Limits
from server.errors import DomainError, InvalidBody, InvalidField, MalformedBody, TooCostly, TooLarge, forget_frames
from server.index.row_decoding import config_of
from server.parsing.field_errors import invalid_body
from server.parsing.strict_json import read_json
from server.platform.precedence import give_way
from server.platform.process_pool import PATIENCE, IsolationPolicy, PoolTask, ProcessPool
from server.platform.thread_limits import pin_threads
from server.schemas.submaps import NamedSubmap
from server.store.storage import Storage
from server.store.submap_records import SubmapRecord
from server.submaps.preparation import Prepared
from urquhart import Config

_Item = TypeVar("_Item")
_MOST_BYTES: Final = 4 * 1024 * 1024
"""Approximate bytes of a batch. Submaps with thousands of landmarks come in smaller batches, so that a few fit in
memory.
"""
_LIGHT: Final = 2_000
"""Arrays and objects in a line that the service itself describes. A line with more is described in another process."""
_LANDMARK_BYTES: Final = 40
_LONGEST_ID: Final = 128
"""Characters of an id that a report repeats. A longer one is not an id."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """A submap that was not stored, and why.

    Attributes:
        submap_id: None where not even that could be read.
        error: what is wrong with it, without its traceback.
        position: in what was given, from 0.
    """

    submap_id: str | None
    error: DomainError
    position: int


@dataclass(frozen=True, slots=True)
class BlankLines:
    """A number of consecutive blank lines, represented as one item."""

    count: int


@dataclass(frozen=True, slots=True)
class Batch(Generic[_Item]):
    """Part of the input, each item with its position. `following` is the position after the last one, blank or not."""

    items: list[tuple[int, _Item]]
    following: int


@dataclass(slots=True)
class DescribedBatch:
    """A batch that is ready to be written.

    Attributes:
        collection_key: the collection that it was described for.
        following: position after the last of what was given.
        records: what can be stored, with its position.
        landmarks: of all that can be used.
        refused: what cannot be used.
    """

    collection_key: int
    following: int
    records: list[tuple[int, SubmapRecord]]
    landmarks: int
    refused: list[Refusal]


@dataclass(frozen=True, slots=True)
class _Task:
    database: Storage
    collection_id: str
    limits: Limits
    lines: list[tuple[int, bytes]]
    following: int


def describers(processes: int | None = None, *, patience: float = PATIENCE) -> ProcessPool:
    """Processes that describe batches, including this one: by default one for each core.

    `patience`: seconds of work before processes are started.
    """
    return ProcessPool(processes, warm_up=_warm_up, patience=patience)


def of_submaps(
    database: Storage, collection_id: str, limits: Limits
) -> PoolTask[Batch[NamedSubmap], _Task, DescribedBatch]:
    """How batches of submaps are described for a collection. The work raises NotFound and StorageError."""

    def here(batch: Batch[NamedSubmap]) -> DescribedBatch:
        return _describe(database, collection_id, limits, batch.following, batch.items, [])

    def pack(batch: Batch[NamedSubmap]) -> _Task:
        lines = [(position, line_of(submap)) for position, submap in batch.items]
        return _Task(database, collection_id, limits, lines, batch.following)

    return PoolTask(here, pack, _describe_there)


def of_lines(
    database: Storage, collection_id: str, limits: Limits, *, careful: bool = False
) -> PoolTask[Batch[bytes], _Task, DescribedBatch]:
    """How batches of NDJSON lines are described for a collection. The work raises NotFound and StorageError.

    A line that ends its worker process or takes too long is refused, and no other line with it. Lines with many trees
    are described only in other processes; with `careful`, all lines are.
    """

    def here(batch: Batch[bytes]) -> DescribedBatch:
        return _describe_lines(database, collection_id, limits, batch.items, batch.following)

    def pack(batch: Batch[bytes]) -> _Task:
        return _Task(database, collection_id, limits, batch.items, batch.following)

    def singles(batch: Batch[bytes]) -> list[Batch[bytes]]:
        *others, last = [[one] for one in batch.items] or [[]]
        return [*(Batch(one, one[0][0] + 1) for one in others), Batch(last, batch.following)]

    def refuse(batch: Batch[bytes], why: str) -> DescribedBatch:
        ((position, line),) = batch.items
        error = TooCostly("import_line_seconds", limits.import_line_seconds, why)
        with database.read() as tx:
            collection = get_collection(tx, collection_id)
        submap_id = _id_in(line, error) if _is_json(line) else None
        return DescribedBatch(collection.key, batch.following, [], 0, [Refusal(submap_id, error, position)])

    def is_light(batch: Batch[bytes]) -> bool:
        return not careful and all(_is_light(line) for _, line in batch.items)

    apart = IsolationPolicy(is_light, singles, refuse, limits.import_line_seconds)
    return PoolTask(here, pack, _describe_there, apart)


def _is_light(line: bytes) -> bool:
    """Whether a line has so few trees that it cannot cost much, whatever their shape."""
    return line.count(b"[") + line.count(b"{") <= _LIGHT


def cut(
    items: Iterable[_Item | BlankLines], most: int, weigh: Callable[[_Item], int], first: int = 0
) -> Iterator[Batch[_Item]]:
    """Batches of at most `most` items, or fewer if they are large. The first has position `first`.

    Blank lines are in no batch. Blank lines at the end have a batch without items, so that they are counted.
    """
    batch, weight, position = list[tuple[int, _Item]](), 0, first
    for item in items:
        if isinstance(item, BlankLines):
            position += item.count
            continue
        batch.append((position, item))
        position += 1
        weight += weigh(item)
        if len(batch) >= most or weight >= _MOST_BYTES:
            yield Batch(batch, position)
            first, batch, weight = position, [], 0
    if position > first:
        yield Batch(batch, position)


def weigh_submap(submap: NamedSubmap) -> int:
    """Approximate bytes of a submap as JSON."""
    return submap.landmark_count * _LANDMARK_BYTES


def line_of(submap: NamedSubmap) -> bytes:
    """A submap as a line of NDJSON that is read as the same content."""
    return orjson.dumps(submap.model_dump(exclude_unset=True, warnings=False), option=orjson.OPT_UTC_Z)


def read_line(line: bytes, limits: Limits) -> NamedSubmap:
    """The submap in one line of NDJSON. Raises MalformedBody, InvalidBody, InvalidField and TooLarge."""
    try:
        members = read_json(line, limits.body_values)
    except orjson.JSONDecodeError as error:
        raise MalformedBody(f"The line is not JSON: {error.msg.split(': line')[0]} (column {error.colno}).") from error
    try:
        return NamedSubmap.model_validate(members)
    except ValidationError as error:
        invalid = invalid_body(error)
    # Not raised within the handler: a refusal that is kept would keep the other error and its frames alive, in a cycle
    # that garbage collection does not see.
    raise invalid


def _describe_there(task: _Task) -> DescribedBatch:
    return _describe_lines(task.database, task.collection_id, task.limits, task.lines, task.following)


def _describe_lines(
    database: Storage, collection_id: str, limits: Limits, lines: Iterable[tuple[int, bytes]], following: int
) -> DescribedBatch:
    submaps: list[tuple[int, NamedSubmap]] = []
    refused: list[Refusal] = []
    for position, line in lines:
        give_way()
        if len(line) <= limits.body_bytes and (not line or line.isspace()):
            continue
        try:
            if len(line) > limits.body_bytes:
                raise TooLarge(
                    "body_bytes", limits.body_bytes, None, "Each line is the body of one PUT: split this one."
                )
            submaps.append((position, read_line(line, limits)))
        except DomainError as error:
            forget_frames(error)
            refused.append(Refusal(_id_in(line, error), error, position))
    return _describe(database, collection_id, limits, following, submaps, refused)


def _describe(
    database: Storage,
    collection_id: str,
    limits: Limits,
    following: int,
    submaps: list[tuple[int, NamedSubmap]],
    refused: list[Refusal],
) -> DescribedBatch:
    """The valid ones of some submaps, with features except for those whose trees are stored already."""
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        known = tx.submaps(collection.key).identities({submap.id for _, submap in submaps})
        maps = {submap.map_pose.frame_id for _, submap in submaps if submap.map_pose is not None}
        references = tx.map_frames(collection).some(maps)
    config = config_of(collection)
    described = DescribedBatch(collection.key, following, [], 0, refused)
    for position, submap in submaps:
        give_way()
        try:
            prepared = Prepared(submap.id, submap, limits)
            if prepared.place is not None:
                check_place(prepared.place, references.get(prepared.place.map_frame_id))
            record = prepared.record(known.get(submap.id), config)
        except DomainError as error:
            forget_frames(error)
            refused.append(Refusal(submap.id, error, position))
            continue
        described.records.append((position, record))
        described.landmarks += submap.landmark_count
    refused.sort(key=lambda one: one.position)
    return described


def _id_in(line: bytes, error: DomainError) -> str | None:
    """The id in a line that is valid JSON but not a submap, for the report."""
    if isinstance(error, InvalidField | InvalidBody | TooCostly):
        members = orjson.loads(line)
        if isinstance(members, dict) and isinstance(members.get("id"), str) and len(members["id"]) <= _LONGEST_ID:
            return str(members["id"])
    return None


def _is_json(line: bytes) -> bool:
    try:
        orjson.loads(line)
    except orjson.JSONDecodeError:
        return False
    return True


def _warm_up() -> None:
    pin_threads()
    urquhart.describe(np.random.default_rng(0).uniform(0.0, 50.0, (30, 2)), Config())
