"""Bodies of the submap routes."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, PlainSerializer, model_validator
from pydantic_core import PydanticCustomError

from server.schemas.common import STAMPED, Answer, Free, Label, ResourceId, Stamp, write_stamp
from server.schemas.landmarks import _XY, LandmarkBody
from server.schemas.poses import MapPose, PlacedPose
from server.schemas.queries import QueryAnswer, QueryInput, QueryOptions

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
_POSE: Any = {"frame_id": "map", "x": 120.5, "y": 88.25, "yaw": 0.31}


class SubmapInput(LandmarkBody):
    """A submap to store."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"xy": _XY},
                {
                    "frame_id": "plot_7",
                    "stamp": "2026-05-04T09:30:00Z",
                    "session": "2026-05-04-robot-2",
                    "landmarks": [
                        {"id": "t1", "x": 1.2, "y": 3.4, "dbh": 0.31, "height": 18.5, "species": "Picea abies"},
                        {"id": "t2", "x": 4.9, "y": -2.2, "dbh": 0.22},
                        {"id": "t3", "x": -3.1, "y": 0.7},
                    ],
                    "map_pose": _POSE,
                    "properties": {"observer": "robot-2"},
                },
            ]
        }
    )

    frame_id: Label | None = Field(None, description="Name of the frame that the landmarks are in.")
    stamp: Stamp | None = Field(None, description=STAMPED)
    session: Label | None = Field(None, description="The drive, flight or season that it belongs to.")
    map_pose: MapPose | None = Field(None, description="Where the submap's frame is in a map.")
    properties: Free | None = Field(None, description="Anything else worth keeping.")

    @model_validator(mode="after")
    def _has_landmarks(self) -> "SubmapInput":
        if self.xy is None and self.landmarks is None:
            raise PydanticCustomError("no_landmarks", "give the trees as `xy` or as `landmarks`")
        return self


class NamedSubmap(SubmapInput):
    """A submap with its id, as in bulk ingest."""

    id: ResourceId


class SubmapPatch(LandmarkBody):
    """Members to change: what is given replaces what was there, null clears it, what is left out stays."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"map_pose": _POSE}, {"xy": _XY}]})

    frame_id: Label | None = Field(None, description="Name of the frame that the landmarks are in.")
    stamp: Stamp | None = Field(None, description=STAMPED)
    session: Label | None = Field(None, description="The drive, flight or season that it belongs to.")
    map_pose: MapPose | None = Field(None, description="Where the submap's frame is in a map.")
    properties: Free | None = Field(None, description="Anything else worth keeping.")

    @model_validator(mode="after")
    def _keeps_landmarks(self) -> "SubmapPatch":
        for name in ("xy", "landmarks"):
            if name in self.model_fields_set and getattr(self, name) is None:
                raise PydanticCustomError(
                    "landmarks_cleared", "a submap has landmarks: leave `{name}` out to keep them", {"name": name}
                )
        return self

    @property
    def has_landmarks(self) -> bool:
        """Whether it gives landmarks."""
        return self.xy is not None or self.landmarks is not None


class SubmapLinks(Answer):
    """Where to go from a submap."""

    self: str
    collection: str
    tessellation: str


class SubmapSummary(Answer):
    """A submap, as in a list."""

    id: str
    collection: str
    frame_id: str | None
    stamp: _Written | None
    session: str | None
    map_pose: PlacedPose | None
    properties: dict[str, Any] | None
    counts: dict[str, int]
    etag: str
    revision: int
    created: _Written
    updated: _Written
    links: SubmapLinks


class StoredLandmark(Answer):
    """A tree as stored."""

    id: str
    x: float = Field(description="Metres in the submap's frame.")
    y: float = Field(description="Metres in the submap's frame.")
    dbh: float | None = Field(None, description="Diameter at breast height, in metres.")
    height: float | None = Field(None, description="Height of the tree, in metres.")
    species: str | None = None


class Submap(SubmapSummary):
    """A submap with its landmarks."""

    landmarks: list[StoredLandmark]


class SubmapPage(Answer):
    """A page of submaps."""

    submaps: list[SubmapSummary]
    next: str | None = Field(None, description="Cursor of the next page; not there on the last.")


class SessionSummary(Answer):
    """A drive, a flight, a season: who was here, and when."""

    session: str
    submaps: int
    landmarks: int = Field(description="Landmarks of all its submaps together.")
    first: _Written | None = Field(description="The earliest stamp of its submaps.")
    last: _Written | None = Field(description="The latest stamp of its submaps.")


class SessionPage(Answer):
    """A page of sessions."""

    sessions: list[SessionSummary]
    next: str | None = Field(None, description="Cursor of the next page; not there on the last.")


class TessellationPolygon(Answer):
    """An interior Urquhart polygon."""

    vertices: list[int] = Field(description="Landmark positions, counter-clockwise.")
    triangles: list[int] = Field(description="The triangles that it is joined from.")
    descriptor: list[float]


class TessellationAnswer(Answer):
    """What the method sees in a submap."""

    submap: str
    fingerprint: str
    counts: dict[str, int]
    landmarks: list[StoredLandmark]
    triangles: list[tuple[int, int, int]] = Field(description="Landmark positions, counter-clockwise.")
    polygons: list[TessellationPolygon]


_EXAMPLES: list[Any] = SubmapInput.model_config["json_schema_extra"]["examples"]  # type: ignore[index,assignment]


class ArrivingSubmap(SubmapInput):
    """A submap to store."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [*_EXAMPLES, {**_EXAMPLES[0], "session": "monday", "query": {"exclude": {"session": "monday"}}}]
        }
    )

    query: QueryOptions | None = Field(
        None, description="Ask first where else it was seen, and how: {} as usual. It does not find itself."
    )

    def question(self) -> QueryInput:
        """The query to ask before this is stored."""
        options = self.query or QueryOptions()
        members = {name: getattr(self, name) for name in ("xy", "ids", "landmarks", "frame_id", "stamp")}
        # What is checked already is not checked again.
        return QueryInput.model_construct(
            _fields_set=set(options.model_fields_set),
            **members,
            **{name: getattr(options, name) for name in QueryOptions.model_fields},
            submap_id=None,
            store=False,
        )


class SubmapReceipt(Answer):
    """What became of a submap that was sent."""

    id: str | None = Field(description="The submap's id; null where a POST stored nothing.")
    collection: str
    outcome: Literal["created", "replaced", "unchanged", "not_stored"] = Field(
        description="`not_stored`: the submap was asked about, and too few trees, or trees on one line, make no submap."
    )
    reason: str | None = Field(None, description="Why nothing was stored: the `reason` of `query`; null otherwise.")
    detail: str | None = Field(None, description="Why nothing was stored, in a sentence; null otherwise.")
    counts: dict[str, int] = Field(description="Landmarks, triangles, polygons kept and discarded of what is stored.")
    etag: str | None = Field(description="Entity tag of what is stored under the id now; null where nothing is.")
    revision: int = Field(
        description="The collection's revision at the submap's last write; where there is none, its revision now."
    )
    cleared: list[str] = Field(
        default_factory=list,
        description="Optional members that the submap had before this write and has no more, e.g. `session`, "
        "`map_pose`, or `dbh` of its landmarks: a PUT replaces the whole submap. PATCH keeps what it does not name.",
    )
    links: SubmapLinks | None = Field(description="Where to go from the submap; null where there is none.")
    query: QueryAnswer | None = Field(
        None,
        description="Where else the submap was seen, among all that was stored before it; not there unless asked for.",
    )
