"""Bodies of requests, built from the arguments of callers."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from enum import Enum
from math import isfinite, isnan
from typing import Any, Final

from pydantic import BaseModel

from urquhart_client.models import Landmark
from urquhart_client.poses import MapPose


class Unset(Enum):
    """The default of arguments that can also be cleared: `None` clears a member, `UNSET` leaves it as it is."""

    UNSET = "unset"


UNSET: Final = Unset.UNSET

Points = Iterable[Sequence[float]]
Landmarks = Iterable[Landmark | Mapping[str, Any]]
Diameters = Iterable[float | None]
Pose = MapPose | Mapping[str, Any]


def landmarks(
    xy: Points | None, ids: Iterable[str] | None, dbh_cm: Diameters | None, listed: Landmarks | None
) -> dict[str, Any]:
    """The landmarks of a submap or query: coordinates with or without ids and diameters, or a list of landmarks.

    Exactly one of the two must be given. A diameter that is None or NaN is unknown.
    """
    if (xy is None) == (listed is None):
        raise ValueError("give the landmarks either as xy (with ids, if they have any) or as landmarks")
    if listed is not None:
        if ids is not None or dbh_cm is not None:
            raise ValueError("landmarks carry their own ids and dbh_cm: leave ids and dbh_cm out")
        return {"landmarks": [_plain(landmark) for landmark in listed]}
    if isinstance(xy, str) or not isinstance(xy, Iterable):
        raise ValueError(f"xy must be a list of positions [x, y], not {type(xy).__name__}")
    body: dict[str, Any] = {"xy": [_position(i, point) for i, point in enumerate(xy)]}
    if ids is not None:
        body["ids"] = [str(one) for one in ids]
    return body if dbh_cm is None else _measured(body, list(dbh_cm))


def _position(index: int, point: Sequence[float]) -> list[float]:
    try:
        numbers = [float(number) for number in point]
    except (TypeError, ValueError) as error:
        raise ValueError(f"positions are [x, y], two numbers; the one at {index} is {point!r:.100}") from error
    if len(numbers) != 2:
        advice = ": leave out what follows x and y" if len(numbers) > 2 else ""
        raise ValueError(f"positions are [x, y]; the one at {index} has {len(numbers)} numbers{advice}")
    return numbers


def _measured(body: Mapping[str, Any], dbh_cm: Sequence[float | None]) -> dict[str, Any]:
    """The landmarks one by one, with their diameters."""
    xy, ids = body["xy"], body.get("ids")
    if len(dbh_cm) != len(xy) or (ids is not None and len(ids) != len(xy)):
        raise ValueError(f"{len(xy)} points need as many ids and dbh_cm, None where one is not known")
    listed = []
    for i, ((x, y), diameter) in enumerate(zip(xy, dbh_cm, strict=True)):
        landmark: dict[str, Any] = {"x": x, "y": y} if ids is None else {"id": ids[i], "x": x, "y": y}
        if diameter is not None and not isnan(diameter):
            landmark["dbh_cm"] = float(diameter)
        listed.append(landmark)
    return {"landmarks": listed}


def submap_body(
    landmarks_body: Mapping[str, Any],
    frame_id: str | None,
    stamp: datetime | str | None,
    session: str | None,
    map_pose: Pose | None,
    properties: Mapping[str, Any] | None,
    query: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The body of a submap: its landmarks and all other members."""
    return dict(landmarks_body) | given(
        frame_id=frame_id,
        stamp=rfc3339(stamp),
        session=session,
        map_pose=None if map_pose is None else _plain(map_pose),
        properties=None if properties is None else dict(properties),
        query=None if query is None else dict(query),
    )


def observation(
    xy: Points | None,
    ids: Iterable[str] | None,
    dbh_cm: Diameters | None,
    listed: Landmarks | None,
    submap_id: str | None,
    keyframes: Iterable[Mapping[str, Any]] | None = None,
) -> dict[str, Any]:
    """The landmarks of a query, or the id of a stored submap, or several views."""
    if keyframes is not None:
        if submap_id is not None or xy is not None or listed is not None:
            raise ValueError("give either keyframes, or landmarks or submap_id, not both")
        return {"keyframes": [_keyframe(**dict(view)) for view in keyframes]}
    if submap_id is None:
        return landmarks(xy, ids, dbh_cm, listed)
    if xy is not None or listed is not None or ids is not None or dbh_cm is not None:
        raise ValueError("give either landmarks or submap_id, not both")
    return {"submap_id": submap_id}


_listed = landmarks


def _keyframe(
    pose: Mapping[str, float],
    xy: Points | None = None,
    ids: Iterable[str] | None = None,
    dbh_cm: Diameters | None = None,
    landmarks: Landmarks | None = None,
) -> dict[str, Any]:
    return {"pose": dict(pose), **_listed(xy, ids, dbh_cm, landmarks)}


def query_body(
    observed: Mapping[str, Any],
    *,
    limit: int,
    method: str | None,
    effort: str | None,
    min_confidence: float | None,
    seed: int | None,
    store: bool,
    explain: bool,
    per_session: bool,
    frame_id: str | None,
    stamp: datetime | str | None,
    near: Mapping[str, Any] | None,
    prior: Mapping[str, Any] | None,
    exclude: Mapping[str, Any] | None,
    pairs: bool,
    pair_format: str | None,
    timeout_ms: int | None,
) -> dict[str, Any]:
    """The body of a query: its landmarks and all other members."""
    return dict(observed) | given(
        limit=limit,
        method=method,
        effort=effort,
        min_confidence=min_confidence,
        seed=seed,
        store=store or None,
        explain=explain or None,
        per_session=per_session or None,
        frame_id=frame_id,
        stamp=rfc3339(stamp),
        near=None if near is None else dict(near),
        prior=None if prior is None else dict(prior),
        exclude=None if exclude is None else dict(exclude),
        pairs=None if pairs else False,
        pair_format=pair_format,
        timeout_ms=timeout_ms,
    )


def changes(**fields: object) -> dict[str, Any]:
    """The body of a PATCH: every member that is set, also those set to None."""
    return {
        name: _plain(value) if isinstance(value, BaseModel) else value
        for name, value in fields.items()
        if value is not UNSET
    }


def rfc3339(stamp: datetime | str | None) -> str | None:
    """A time in RFC 3339 form. Text is sent as it is."""
    if not isinstance(stamp, datetime):
        return stamp
    if stamp.tzinfo is None:
        raise ValueError("a stamp needs a time zone: datetime(..., tzinfo=timezone.utc)")
    return stamp.isoformat()


def given(**fields: object) -> dict[str, Any]:
    """The members that are not None."""
    return {name: value for name, value in fields.items() if value is not None}


def written(body: Mapping[str, Any]) -> bytes:
    """A body as JSON. Raises ValueError for a number that JSON does not have, with its place."""
    try:
        return json.dumps(body, allow_nan=False, separators=(",", ":")).encode()
    except ValueError as error:
        place = next(_not_finite(body), "?")
        raise ValueError(
            f"the number at {place} is not finite: leave the member out, or the landmark that it belongs to"
        ) from error


def _not_finite(value: object, place: str = "") -> Iterator[str]:
    """JSON pointers to the numbers in a body that are NaN or infinite."""
    if isinstance(value, float) and not isfinite(value):
        yield place
    elif isinstance(value, Mapping):
        for name, member in value.items():
            yield from _not_finite(member, f"{place}/{name}")
    elif isinstance(value, list | tuple):
        for index, member in enumerate(value):
            yield from _not_finite(member, f"{place}/{index}")


def _plain(value: BaseModel | Mapping[str, Any]) -> dict[str, Any]:
    return value.model_dump(mode="json", exclude_none=True) if isinstance(value, BaseModel) else dict(value)
