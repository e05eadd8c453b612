"""Stored queries as a list, and the trees of a map frame as columns."""

import json
import struct
import sys
from array import array
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

import httpx

from urquhart_client._protocol.exchange import Request, page, unexpected
from urquhart_client._protocol.requests import collection_path, parameters
from urquhart_client.models import Page
from urquhart_client.poses import Model

COLUMNS = "application/vnd.urquhart.landmark-columns"
_MAGIC = b"URQCOL1\n"


class StoredQuery(Model):
    """A stored query as in a list: the outcome and the first candidate. `get_query` has the whole answer.

    `milliseconds` is how long the search took. `submap_id`, `inlier_count` and `confidence` are of the first candidate,
    None without one.
    """

    shown = ("id", "created", "verdict", "reason", "submap_id", "inlier_count", "confidence")

    id: str
    created: datetime
    verdict: Literal["matched", "ambiguous", "no_match"]
    reason: str
    landmark_count: int
    revision: int
    milliseconds: float
    submap_id: str | None = None
    inlier_count: int | None = None
    confidence: float | None = None


@dataclass(frozen=True, slots=True)
class LandmarkColumns:
    """Trees of a map frame as columns: S submaps and N positions. Metres, relative to `origin` in the map frame.

    The arrays are flat and of 32 bits a value. `numpy.asarray(columns.xy).reshape(-1, 2)` copies nothing.

    Attributes:
        origin: (x, y) in the map frame, metres, which `boxes` and `xy` are relative to.
        landmarks: number of trees in all. Trees that overlapping submaps share are counted in each.
        every: 1, or every how-many-th tree is in `xy`.
        submaps, sessions, stamps: S ids, sessions and times of observation; None where there is none.
        boxes: 4 S values: x minimum, y minimum, x maximum, y maximum of each submap.
        counts: S values: how many positions of each submap are in `xy`, submap after submap.
        xy: 2 N values: x and y of each tree.
    """

    frame_id: str
    revision: int
    origin: tuple[float, float]
    landmarks: int
    every: int
    submaps: tuple[str, ...]
    sessions: tuple[str | None, ...]
    stamps: tuple[datetime | None, ...]
    boxes: "array[float]"
    counts: "array[int]"
    xy: "array[float]"


def get_queries(
    collection: str, verdict: str | None, limit: int | None, cursor: str | None
) -> Request[Page[StoredQuery]]:
    """A page of stored queries, newest first."""
    return Request(
        "GET",
        f"{collection_path(collection)}/queries",
        page("queries", StoredQuery),
        params=parameters(verdict=verdict, limit=limit, cursor=cursor),
    )


def get_landmarks(collection: str, asked: Mapping[str, str | int | None]) -> Request[LandmarkColumns]:
    """The trees of a map frame."""
    return Request(
        "GET",
        f"{collection_path(collection)}/landmarks",
        _columns,
        headers={"Accept": COLUMNS},
        params=parameters(**asked),
    )


def _columns(response: httpx.Response) -> LandmarkColumns:
    try:
        return read_columns(response.content)
    except (ValueError, KeyError, TypeError, IndexError, struct.error) as error:
        raise unexpected(response, f"not columns of landmarks: {error}") from error


def read_columns(data: bytes) -> LandmarkColumns:
    """The columns in the body of an answer. Raises ValueError, KeyError, TypeError, IndexError or struct.error."""
    if not data.startswith(_MAGIC):
        raise ValueError("it begins otherwise")
    (length,) = struct.unpack_from("<I", data, len(_MAGIC))
    begin = len(_MAGIC) + 4
    head: dict[str, Any] = json.loads(data[begin : begin + length])
    at, submaps = begin + length, len(head["submaps"])
    boxes, counts, xy = array("f"), array("I"), array("f")
    boxes.frombytes(data[at : at + 16 * submaps])
    counts.frombytes(data[at + 16 * submaps : at + 20 * submaps])
    xy.frombytes(data[at + 20 * submaps :])
    if sys.byteorder == "big":
        for column in (boxes, counts, xy):
            column.byteswap()
    if len(boxes) != 4 * submaps or len(counts) != submaps or len(xy) != 2 * sum(counts):
        raise ValueError("it ends too early")
    names = head["sessions"]
    return LandmarkColumns(
        frame_id=head["frame_id"],
        revision=head["revision"],
        origin=(head["origin"][0], head["origin"][1]),
        landmarks=head["landmarks"],
        every=head["every"],
        submaps=tuple(head["submaps"]),
        sessions=tuple(None if one < 0 else names[one] for one in head["session_of"]),
        stamps=tuple(None if one is None else datetime.fromtimestamp(one, UTC) for one in head["stamps"]),
        boxes=boxes,
        counts=counts,
        xy=xy,
    )
