"""Constraints as a collection keeps them: found by jobs, posted by robots, listed, deleted, written to files."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from server.collections.crud import get_collection
from server.config.settings import Limits
from server.constraints.extraction import Found
from server.constraints.formats import StoredSubmap, write_out
from server.errors import InvalidField, NotFound
from server.queries.poses import flat, middle_answer
from server.resources.idempotency import NO_CONTENT, IdempotencyKey, StoredResponse, find_response, store_response
from server.resources.paging import PageRequest, page_size, read_cursor, write_cursor
from server.schemas.common import to_json, write_stamp
from server.schemas.maps.constraint_rows import (
    ConstraintPage,
    KeptConstraint,
    KeptKind,
    KeptState,
    OdometryReceipt,
    StoredFormat,
)
from server.schemas.maps.request import OdometryEdge
from server.store.repositories.maps.constraint_records import ConstraintFilter, ConstraintRecord, StoredConstraint
from server.store.storage import ReadTransaction, Storage, WriteTransaction
from server.store.submap_records import SubmapMetadata
from urquhart import SE2
from urquhart.pose_covariance import PoseUncertainty

_LEAST = 1e-9
"""Least eigenvalue of the correlations of odometry. Below, the pose would be certain along some direction."""
_COLUMNS = ("from_revision", "to_revision", "from_session", "to_session", "stale", "warnings")
"""Members of a constraint that are no part of its transform and its evidence."""


def uncertainty_of_odometry(edge: OdometryEdge, pointer: str) -> PoseUncertainty:
    """The uncertainty of a posted relative pose. Raises InvalidField."""
    if edge.from_ == edge.to:
        raise InvalidField("joins a submap with itself", code="same_submap", pointer=f"{pointer}/to")
    covariance = np.reshape(edge.covariance, (3, 3))
    deviations = np.sqrt(np.diag(covariance))
    if not deviations.all() or np.linalg.eigvalsh(covariance / np.outer(deviations, deviations))[0] < _LEAST:
        raise InvalidField(
            "must be positive definite: give every direction a variance above 0",
            code="covariance",
            pointer=f"{pointer}/covariance",
        )
    return PoseUncertainty.about_point(np.zeros(2), SE2(edge.x, edge.y, edge.yaw), covariance)


def post_odometry(
    database: Storage, collection_id: str, edges: Sequence[OdometryEdge], idempotency_key: IdempotencyKey | None
) -> StoredResponse:
    """Store relative poses, all in one transaction. Returns the answer.

    Raises NotFound (the collection), InvalidField (a submap that does not exist, a covariance that is not positive, the
    same two submaps twice), KeyReused and StorageError; then nothing is stored.
    """
    with database.write() as tx:
        collection = get_collection(tx, collection_id)
        operation = f"postOdometry {collection.key}"
        response = find_response(tx, idempotency_key, operation)
        if response is not None:
            return response
        revisions = _revisions(tx, collection.key, {name for edge in edges for name in (edge.from_, edge.to)})
        records, known = list[ConstraintRecord](), set[frozenset[str]]()
        for number, edge in enumerate(edges):
            pointer = f"/edges/{number}"
            for end, name in (("from", edge.from_), ("to", edge.to)):
                if name not in revisions:
                    raise InvalidField(f"there is no submap {name!r}", code="not_found", pointer=f"{pointer}/{end}")
            pair = frozenset((edge.from_, edge.to))
            content = _odometry(edge, uncertainty_of_odometry(edge, pointer))
            if pair in known:
                raise InvalidField(
                    f"{edge.from_!r} and {edge.to!r} come twice: one relative pose is kept for two submaps",
                    code="repeated",
                    pointer=f"{pointer}/to",
                )
            known.add(pair)
            ends = (edge.from_, edge.to, revisions[edge.from_], revisions[edge.to])
            records.append(ConstraintRecord("odometry", *ends, "", "posted", None, content))
        tx.constraints(collection.key).put(records)
        answer = to_json(OdometryReceipt(stored=len(records)))
        return store_response(tx, idempotency_key, operation, StoredResponse(200, {}, answer))


def store_found(
    tx: WriteTransaction,
    collection_key: int,
    found: Sequence[Found],
    looked_up: Mapping[str, tuple[int, int]],
    origin: tuple[str, str | None],
) -> None:
    """Store what a search found, in the place of what it found for the same submaps before.

    Args:
        found: one constraint for each pair of submaps.
        looked_up: key and revision of the landmarks of each submap that was looked up, by id.
        origin: the search, and the id of its job; None if a command made it.
    """
    search, job = origin
    rows = tx.constraints(collection_key)
    rows.forget_found(search, looked_up.keys())
    rows.put(
        [
            ConstraintRecord(
                "match", one["from"], one["to"], one["from_revision"], one["to_revision"], search, "job", job, one
            )
            for one in found
        ]
    )
    rows.note_searched(search, dict(looked_up.values()))


def chosen_rows(kind: KeptKind | None, state: KeptState | None, submap: str | None) -> ConstraintFilter:
    """The constraints of a kind, in a state, of a submap; None for any."""
    return ConstraintFilter(kind, state, submap)


def page(
    database: Storage, limits: Limits, collection_id: str, chosen: ConstraintFilter, asked: PageRequest
) -> ConstraintPage:
    """A page of a collection's constraints, in the order they were stored. Raises NotFound and InvalidField."""
    size = page_size(asked.limit, limits)
    after = read_cursor("constraints", asked.cursor)
    with database.read() as tx:
        key = get_collection(tx, collection_id).key
        rows = tx.constraints(key).page(chosen, after_key=after, limit=size + 1)
    more = write_cursor("constraints", rows[size - 1].key) if len(rows) > size else None
    return ConstraintPage(constraints=[_answer(row) for row in rows[:size]], next=more)


def export(
    database: Storage, collection_id: str, chosen: ConstraintFilter, form: tuple[StoredFormat, str | None]
) -> bytes:
    """All constraints that are chosen, in a format; with it the map frame in which vertices start.

    Raises NotFound and InvalidField (a frame that no submap has a pose in, or no common frame for a trajectory).
    """
    wanted, frame_id = form
    with database.read() as tx:
        key = get_collection(tx, collection_id).key
        rows = tx.constraints(key).page(chosen)
        submaps = tx.submaps(key)
        names = {name for row in rows for name in (row.from_id, row.to_id)}
        known = {
            row.id: StoredSubmap(row.content_revision, row.place, row.stamp)
            for row in submaps.some(submaps.keys(names).values(), SubmapMetadata)
        }
    if wanted in ("json", "ndjson"):
        answers = [_answer(row).model_dump(mode="json", by_alias=True) for row in rows]
        return write_out(answers, wanted, known, frame_id)
    found = [row.content | {"from": row.from_id, "to": row.to_id, "stale": row.stale} for row in rows]
    return write_out(found, wanted, known, frame_id)


def delete(
    database: Storage, collection_id: str, constraint: str, idempotency_key: IdempotencyKey | None
) -> StoredResponse:
    """Delete a constraint. Returns the answer. Raises NotFound, KeyReused and StorageError."""
    with database.write() as tx:
        collection = get_collection(tx, collection_id)
        operation = f"deleteConstraint {collection.key} {constraint}"
        response = find_response(tx, idempotency_key, operation)
        if response is not None:
            return response
        is_key = constraint.isascii() and constraint.isdigit() and len(constraint) < 19
        if not is_key or not tx.constraints(collection.key).delete([int(constraint)]):
            raise NotFound("constraint", constraint)
        return store_response(tx, idempotency_key, operation, NO_CONTENT)


def _odometry(edge: OdometryEdge, uncertainty: PoseUncertainty) -> dict[str, Any]:
    pose = SE2(edge.x, edge.y, edge.yaw)
    return {
        "transform": {
            "x": edge.x,
            "y": edge.y,
            "yaw": edge.yaw,
            "covariance": list(edge.covariance),
            "covariance_frame": "from",
            "about": "to_origin",
            "middle": middle_answer(uncertainty),
        },
        "information": flat(uncertainty.source_information(pose)),
        "information_frame": "to",
    }


def _revisions(tx: ReadTransaction, collection_key: int, names: set[str]) -> dict[str, int]:
    """The revisions of the landmarks of those of the submaps that exist, by id."""
    submaps = tx.submaps(collection_key)
    return {row.id: row.content_revision for row in submaps.some(submaps.keys(names).values(), SubmapMetadata)}


def _answer(row: StoredConstraint) -> KeptConstraint:
    content = {name: value for name, value in row.content.items() if name not in _COLUMNS}
    return KeptConstraint.model_validate(
        content
        | {
            "id": str(row.key),
            "kind": row.kind,
            "source": row.source,
            "job": row.source_id,
            "state": row.state,
            "refused": row.refused,
            "refused_by": row.refused_by,
            "from": row.from_id,
            "to": row.to_id,
            "from_revision": row.from_revision,
            "to_revision": row.to_revision,
            "created": write_stamp(row.created),
        }
    )
