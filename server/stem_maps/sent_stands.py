"""Stands that callers send as files: read, cut and stored like those that `urquhart index` stores."""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
import orjson

from server.collections.crud import get_collection
from server.config.settings import Limits
from server.errors import InvalidField, InvalidFile
from server.resources import links
from server.resources.idempotency import IdempotencyKey, StoredResponse, find_response, store_response
from server.resources.preconditions import Preconditions
from server.schemas.collections import Stand, StandReceipt
from server.schemas.common import to_json
from server.schemas.landmarks import FileRows
from server.stem_maps.reader import StemMap
from server.stem_maps.replacement import replace_stand
from server.stem_maps.stands import StandError, cut_stand, describe_stand, whole_stand
from server.stem_maps.stored_stands import find, stored_whole
from server.stem_maps.tiling import Cut, CuttingError, left_out, merged_phrase, without_twins
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction, Storage, WriteTransaction
from server.submaps.bulk_ingest import LineOptions

MOST_SUBMAPS: Final = 5_000
"""Submaps that one request may store: described one after the other they take half a minute."""


@dataclass(frozen=True, slots=True)
class Cutting:
    """How a stem map becomes submaps: circles of `radius` metres, `spacing` metres apart; or whole files or plots."""

    radius: float | None = None
    spacing: float | None = None
    one_submap: bool = False

    def check(self) -> None:
        """Raise InvalidField unless it says one way to cut."""
        sizes = (self.radius, self.spacing)
        if self.one_submap and sizes != (None, None):
            raise InvalidField(
                "makes whole files or plots submaps; leave out radius and spacing",
                code="cutting",
                parameter="one_submap",
            )
        if not self.one_submap and None in sizes:
            detail = "is missing; give radius and spacing in metres, or one_submap=true"
            raise InvalidField(detail, code="cutting", parameter="radius" if self.radius is None else "spacing")

    def cut(self, stem_map: StemMap, limits: Limits) -> Cut:
        """The submaps of a stem map. Raises InvalidFile."""
        try:
            if self.radius is None or self.spacing is None:
                return whole_stand(stem_map, limits)
            self._check_count(stem_map, self.spacing)
            return cut_stand(stem_map, self.radius, self.spacing, limits)
        except (CuttingError, StandError) as error:
            raise InvalidFile(f"{stem_map.name}: {error}") from error

    def _check_count(self, stem_map: StemMap, spacing: float) -> None:
        if not len(stem_map) or not (np.isfinite(spacing) and spacing > 0):
            return  # what follows says it
        wide, tall = (np.ptp(stem_map.xy, axis=0) // spacing + 1).tolist()
        if stem_map.plots is None and wide * tall > MOST_SUBMAPS:
            raise InvalidFile(
                f"{stem_map.name}: a spacing of {spacing:g} m makes up to {wide * tall:.0f} submaps, more than the "
                f"{MOST_SUBMAPS} that one request may store: make it larger, or use `urquhart index` on the host"
            )


def cutting_of(database: Storage, collection_id: str, name: str, asked: Cutting) -> Cutting:
    """How to cut the file of a stand: as is asked, or, if nothing is, as the stand of that name is cut now.

    Raises NotFound (the collection), and InvalidField unless that says one way to cut.
    """
    if asked == Cutting():
        with database.read() as tx:
            collection = get_collection(tx, collection_id)
            there, is_whole = find(tx, collection, name), stored_whole(tx, collection, name)
        if there is not None:
            asked = Cutting(one_submap=True) if is_whole else Cutting(there.radius, there.spacing)
    asked.check()
    return asked


class StandTerms(NamedTuple):
    """The conditions of a PUT: what must be true of the stand that is there, and the key of a repeated request."""

    preconditions: Preconditions
    idempotency_key: IdempotencyKey | None


class _Answered(Exception):
    """Another attempt of the same request was carried out meanwhile."""

    def __init__(self, response: StoredResponse) -> None:
        super().__init__("answered before")
        self.response = response


def put_stand(
    database: Storage, limits: Limits, collection_id: str, stem_map: StemMap, cutting: Cutting, terms: StandTerms
) -> StoredResponse:
    """Store a stem map as the stand of its name, in the place of what that had before, in one transaction.

    Returns the answer: the stand and how the file was understood, 201 if it is new.

    Raises NotFound (the collection), PreconditionFailed, KeyReused, InvalidFile, and what storing submaps raises.
    Nothing is stored then.
    """
    answers: list[StoredResponse] = []

    def operation(collection: CollectionRecord) -> str:
        return f"putStand {collection.key} {stem_map.name}"

    def check(tx: ReadTransaction, collection: CollectionRecord) -> bool:
        answered = find_response(tx, terms.idempotency_key, operation(collection))
        if answered is not None:
            raise _Answered(answered)
        before = find(tx, collection, stem_map.name)
        terms.preconditions.check(None if before is None else before.etag)
        return before is None

    def check_again(tx: WriteTransaction, collection: CollectionRecord) -> None:
        is_new.append(check(tx, collection))

    def finish(tx: WriteTransaction, collection: CollectionRecord) -> None:
        stand = find(tx, collection, stem_map.name)
        assert stand is not None  # it was stored in this transaction
        headers = {"ETag": f'"{stand.etag}"'}
        if is_new[0]:
            headers["Location"] = links.stand(collection_id, stem_map.name)
        answer = _stored(stand, stem_map, cuts[0])
        response = StoredResponse(201 if is_new[0] else 200, headers, to_json(answer))
        answers.append(store_response(tx, terms.idempotency_key, operation(collection), response))

    is_new: list[bool] = []
    cuts: list[Cut] = []
    try:
        with database.read() as tx:
            check(tx, get_collection(tx, collection_id))  # before the work, and again when it is stored
        cut = cutting.cut(stem_map, limits)
        cuts.append(cut)
        with describe_stand(database, collection_id, stem_map, cut, LineOptions(limits=limits)) as described:
            replace_stand(database, collection_id, described, check_again, finish)
    except _Answered as answered:
        return answered.response
    except StandError as error:
        raise InvalidFile(f"{stem_map.name}: {error}") from error
    return answers[0]


def _stored(stand: Stand, stem_map: StemMap, cut: Cut) -> StandReceipt:
    return StandReceipt(
        **dict(stand),
        understood="; ".join([stem_map.understood, *left_out(cut)]),
        assumed=list(stem_map.assumed),
        rows=_rows(stem_map, cut.merged),
    )


def _rows(stem_map: StemMap, merged: int) -> FileRows:
    read = len(stem_map) + stem_map.skipped + stem_map.further_stems
    return FileRows(read=read, skipped=stem_map.skipped, further_stems=stem_map.further_stems, merged=merged)


def stem_map_json(stem_map: StemMap) -> bytes:
    """What a file holds, as the JSON of a `StemMapAnswer`."""
    names = [None] if stem_map.plots is None else list(dict.fromkeys(stem_map.plots))
    of_tree = np.asarray(stem_map.plots if stem_map.plots is not None else [None] * len(stem_map), dtype=object)
    plots, merged = [], len(stem_map)
    for name in names:
        chosen = stem_map if name is None else stem_map.chosen(np.flatnonzero(of_tree == name))
        trees = without_twins(chosen)
        merged -= len(trees)
        plots.append({"name": name, "landmarks": _landmarks(trees)})
    answer = {
        "name": stem_map.name,
        "understood": f"{stem_map.understood}; {merged_phrase(merged)}" if merged else stem_map.understood,
        "assumed": stem_map.assumed,
        "rows": _rows(stem_map, merged).model_dump(),
        "crs": stem_map.crs,
        "own_frames": stem_map.own_frames,
        "plots": plots,
    }
    return orjson.dumps(answer)


def _landmarks(trees: StemMap) -> list[dict[str, object]]:
    """The trees, with only those members that are known."""
    found: list[dict[str, object]] = [
        {"id": tree_id, "x": x, "y": y} for tree_id, (x, y) in zip(trees.ids, trees.xy.tolist(), strict=True)
    ]
    for name, values in (("dbh_cm", trees.dbh_cm), ("height_m", trees.height_m)):
        if values is not None:
            for tree in np.flatnonzero(np.isfinite(values)).tolist():
                found[tree][name] = float(values[tree])
    for tree, species in enumerate(trees.species or ()):
        if species:
            found[tree]["species"] = species
    return found


def named(stem_map: StemMap, name: str) -> StemMap:
    """The stem map as the stand `name`."""
    return replace(stem_map, name=name)
