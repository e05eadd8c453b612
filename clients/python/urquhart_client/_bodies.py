"""The bodies of requests, from what callers have at hand."""

from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from enum import Enum
from typing import Any, Final

from pydantic import BaseModel

from urquhart_client.models import Landmark, MapPose


class Unset(Enum):
    """The default of what can also be set to nothing: `None` clears a field, `UNSET` leaves it as it is."""

    UNSET = "unset"


UNSET: Final = Unset.UNSET

Points = Iterable[Sequence[float]]
Landmarks = Iterable[Landmark | Mapping[str, Any]]
Pose = MapPose | Mapping[str, Any]


def landmarks(xy: Points | None, ids: Iterable[str] | None, listed: Landmarks | None) -> dict[str, Any]:
    """The landmarks of a submap or query: coordinates with or without ids, or landmarks as a list. Exactly one way."""
    if (xy is None) == (listed is None):
        raise ValueError("give the landmarks either as xy (with ids, if they have any) or as landmarks")
    if listed is not None:
        if ids is not None:
            raise ValueError("landmarks carry their own ids: leave ids out")
        return {"landmarks": [_plain(landmark) for landmark in listed]}
    assert xy is not None
    body: dict[str, Any] = {"xy": [[float(x), float(y)] for x, y in xy]}
    if ids is not None:
        body["ids"] = [str(one) for one in ids]
    return body


def submap_body(
    landmarks_body: Mapping[str, Any],
    frame_id: str | None,
    stamp: datetime | str | None,
    session: str | None,
    map_pose: Pose | None,
    properties: Mapping[str, Any] | None,
) -> dict[str, Any]:
    """A submap: its landmarks, and whatever else is given."""
    return dict(landmarks_body) | given(
        frame_id=frame_id,
        stamp=rfc3339(stamp),
        session=session,
        map_pose=None if map_pose is None else _plain(map_pose),
        properties=None if properties is None else dict(properties),
    )


def changes(**fields: object) -> dict[str, Any]:
    """The body of a PATCH: every field that is set, those set to None included."""
    return {
        name: _plain(value) if isinstance(value, BaseModel) else value
        for name, value in fields.items()
        if value is not UNSET
    }


def rfc3339(stamp: datetime | str | None) -> str | None:
    """A time as the service reads it; text is sent as it is."""
    if not isinstance(stamp, datetime):
        return stamp
    if stamp.tzinfo is None:
        raise ValueError("a stamp needs a time zone: datetime(..., tzinfo=timezone.utc)")
    return stamp.isoformat()


def given(**fields: object) -> dict[str, Any]:
    """The fields that are not None."""
    return {name: value for name, value in fields.items() if value is not None}


def _plain(value: BaseModel | Mapping[str, Any]) -> dict[str, Any]:
    return value.model_dump(mode="json", exclude_none=True) if isinstance(value, BaseModel) else dict(value)
