"""Constraints between the submaps of a collection: each submap is looked up, and both directions must agree.

A constraint is from_T_to: it takes points of the submap `to` into the frame of `from`, p_from = R(yaw) p_to + t. That
is the pose of `to` seen from `from`, like an edge of a pose graph.
"""

import hashlib
import math
from collections.abc import Iterable
from typing import Any, Final

import numpy as np
import orjson

from server.collections.crud import get_collection
from server.errors import InvalidField
from server.queries.lookup import LookupResult
from server.queries.poses import flat, transform_answer
from server.queries.query import Exclusion, PlaceQuery
from server.schemas.constraints import ConstraintsInput
from server.store.storage import Storage
from server.store.submap_records import SubmapFilter, SubmapMetadata
from server.submaps.reader import submap_filter
from urquhart import SE2, Candidate

_SHIFT: Final = 1.0
"""Metres, and"""
_TURN: Final = math.radians(5.0)
"""radians. Two results for a pair that differ by more contradict each other."""
_SEARCH: Final = "compare_each"
"""What these searches do. Under another name, submaps are looked up again, and what was found before is not used."""

Found = dict[str, Any]
"""A constraint as JSON, as it is stored: all of `server.schemas.constraints.Constraint` except `stale`."""


def chosen_submaps(body: ConstraintsInput) -> SubmapFilter:
    """The filter of submaps to look up, without `submap_ids`. Raises InvalidField."""
    bbox = None if body.bbox is None else ",".join(map(repr, body.bbox))
    try:
        return submap_filter(session=body.session, bbox=bbox, frame_id=body.frame_id, datetime_range=body.datetime)
    except InvalidField as error:  # here they are members with the names of a list's parameters
        raise InvalidField(str(error), code=error.code, pointer=f"/{error.parameter}") from error


def check_ids(database: Storage, collection_id: str, body: ConstraintsInput) -> None:
    """Refuse ids of submaps that do not exist. Raises NotFound and InvalidField."""
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        there = tx.submaps(collection.key).keys(body.submap_ids or ())
    for number, name in enumerate(body.submap_ids or ()):
        if name not in there:
            raise InvalidField(f"there is no submap {name!r}", code="not_found", pointer=f"/submap_ids/{number}")


def search_of(body: ConstraintsInput) -> str:
    """A name for searches that find the same constraints: 16 hexadecimal digits."""
    told = orjson.dumps(
        [body.gates.model_dump(mode="json"), body.exclude.model_dump(mode="json"), body.per_submap, _SEARCH],
        option=orjson.OPT_SORT_KEYS,
    )
    return hashlib.sha256(told).hexdigest()[:16]


def question(row: SubmapMetadata, body: ConstraintsInput, most: int) -> PlaceQuery:
    """The query that looks a submap up among all others that it may be paired with, with `most` candidates."""
    wanted = body.exclude
    # A submap without a session shares it with no other, and one without a stamp is close to none in time.
    possible = row.session is not None or not wanted.same_session
    possible = possible and (row.stamp is not None or wanted.within_seconds is None)
    exclude = Exclusion()
    if possible:
        exclude = Exclusion((), row.session if wanted.same_session else None, wanted.within_seconds)
    limit = min(body.per_submap, most)
    return PlaceQuery(None, submap_id=row.id, limit=limit, exclude=exclude, pairs=False, compare_each=True)


def from_look(row: SubmapMetadata, look: LookupResult, body: ConstraintsInput) -> list[Found]:
    """The candidates of a submap's look-up that are accepted and pass the gates, as constraints."""
    gates = body.gates
    if look.answer.verdict != "matched":
        return []
    return [
        {
            "from": one.submap_id,
            "to": row.id,
            **measured(found),
            "rank": one.rank,
            "inlier_count": one.inlier_count,
            "rms": one.rms,
            "confidence": one.confidence,
            "from_session": one.session,
            "to_session": row.session,
            "from_revision": look.content_revisions[one.submap_id],
            "to_revision": look.content_revisions[row.id],
            "warnings": one.warnings,
        }
        for one, found in zip(look.answer.candidates, look.candidates, strict=True)
        if one.refused is None
        and one.confidence >= gates.confidence
        and one.inlier_count >= gates.inlier_count
        and (gates.rms is None or one.rms <= gates.rms)
    ]


def measured(found: Candidate) -> dict[str, Any]:
    """The pose of `to` in the frame of `from`, with its uncertainty, from a candidate."""
    answer = transform_answer(found.transform, found.uncertainty)
    return {
        "transform": answer | {"covariance_frame": "from", "about": "to_origin"},
        "information": flat(found.uncertainty.source_information(found.transform)),
        "information_frame": "to",
    }


def read_found(line: bytes) -> Found:
    """A constraint as a job wrote it to its results, whichever version it was."""
    one: Found = orjson.loads(line)
    if "inliers" in one:  # its name before 0.2.0
        one["inlier_count"] = one.pop("inliers")
    return one


def agree(found: Iterable[Found]) -> tuple[list[Found], int]:
    """One constraint for each pair, and the number of pairs that contradict themselves and are left out.

    Of two that agree, the one that was the best match of its search is kept, or else the one with more inliers.
    """
    pairs: dict[tuple[str, str], Found | None] = {}
    contradictions = 0
    for one in found:
        pair = min(one["from"], one["to"]), max(one["from"], one["to"])
        other = pairs.get(pair)
        if pair not in pairs:
            pairs[pair] = one
        elif other is not None:
            if _contradict(one, other):
                pairs[pair], contradictions = None, contradictions + 1
            elif _worth(one) > _worth(other):
                pairs[pair] = one
    return [one for one in pairs.values() if one is not None], contradictions


def _worth(one: Found) -> tuple[bool, int]:
    return is_best(one), one["inlier_count"]


def is_best(one: Found) -> bool:
    """Whether a constraint was the best match of its search, which was compared with all rivals."""
    return bool(one.get("rank", 1) == 1)  # results of older versions do not say


def _contradict(one: Found, other: Found) -> bool:
    """Whether two results for a pair put the trees at different places. Compared at the trees, because at an origin far
    away small rotations would dominate.
    """
    mine, theirs = pose_of(one), pose_of(other)
    if one["from"] != other["from"]:
        theirs = theirs.inverse()
    trees = np.array([one["transform"]["middle"]["source"]])
    shift, turn = float(np.hypot(*(mine.apply(trees) - theirs.apply(trees))[0])), mine.distance(theirs)[1]
    return shift > _SHIFT or turn > _TURN


def pose_of(one: Found) -> SE2:
    """from_T_to of a constraint."""
    at = one["transform"]
    return SE2(at["x"], at["y"], at["yaw"])
