"""Bodies of the submap routes."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, PlainSerializer, model_validator
from pydantic_core import PydanticCustomError

from server.schemas.common import (
    FRAME_NAME,
    NEXT,
    SESSION,
    STAMPED,
    Answer,
    Free,
    Label,
    ResourceId,
    Stamp,
    write_stamp,
)
from server.schemas.landmarks import _XY, LandmarkBody
from server.schemas.poses import MapPose, PlacedPose
from server.schemas.queries import QueryAnswer, QueryInput, QueryOptions

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
_POSE: Any = {"frame_id": "map", "x": 120.5, "y": 88.25, "yaw": 0.31}
_MAP_POSE = "Pose of the submap's frame in a map, if it is known."
_PROPERTIES = "Any other data that you want to store with the submap, as a JSON object."
_COUNTS = "Numbers of landmarks, triangles and polygons of the submap, by name."
_ETAG = "Entity tag of the submap, for `If-Match` and `If-None-Match`."


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
                        {"id": "t1", "x": 1.2, "y": 3.4, "dbh_cm": 31.0, "height_m": 18.5, "species": "Picea abies"},
                        {"id": "t2", "x": 4.9, "y": -2.2, "dbh_cm": 22.0},
                        {"id": "t3", "x": -3.1, "y": 0.7},
                    ],
                    "map_pose": _POSE,
                    "properties": {"observer": "robot-2"},
                },
            ]
        }
    )

    frame_id: Label | None = Field(None, description=FRAME_NAME)
    stamp: Stamp | None = Field(None, description=STAMPED)
    session: Label | None = Field(None, description=SESSION)
    map_pose: MapPose | None = Field(None, description=_MAP_POSE)
    properties: Free | None = Field(None, description=_PROPERTIES)

    @model_validator(mode="after")
    def _has_landmarks(self) -> "SubmapInput":
        if self.xy is None and self.landmarks is None:
            raise PydanticCustomError("no_landmarks", "give the trees as `xy` or as `landmarks`")
        return self


class NamedSubmap(SubmapInput):
    """A submap with its id, as in an import."""

    id: ResourceId = Field(description="Id of the submap.")


class SubmapPatch(LandmarkBody):
    """Members of a submap to change. Null removes a member; a member left out stays."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"map_pose": _POSE}, {"xy": _XY}]})

    frame_id: Label | None = Field(None, description=FRAME_NAME)
    stamp: Stamp | None = Field(None, description=STAMPED)
    session: Label | None = Field(None, description=SESSION)
    map_pose: MapPose | None = Field(None, description=_MAP_POSE)
    properties: Free | None = Field(None, description=_PROPERTIES)

    @model_validator(mode="after")
    def _keeps_landmarks(self) -> "SubmapPatch":
        for name in ("xy", "landmarks"):
            if name in self.model_fields_set and getattr(self, name) is None:
                raise PydanticCustomError(
                    "landmarks_cleared",
                    "landmarks cannot be removed from a submap; leave out `{name}` to keep them",
                    {"name": name},
                )
        return self

    @property
    def has_landmarks(self) -> bool:
        """Whether the body contains landmarks."""
        return self.xy is not None or self.landmarks is not None


class SubmapLinks(Answer):
    """Paths of a submap, its collection and its tessellation."""

    self: str = Field(description="Path of the submap.")
    collection: str = Field(description="Path of the collection.")
    tessellation: str = Field(description="Path of the submap's tessellation.")


class SubmapSummary(Answer):
    """A submap without its landmarks, as in a list."""

    id: str = Field(description="Id of the submap.")
    collection: str = Field(description="Id of the collection.")
    frame_id: str | None = Field(description=FRAME_NAME)
    stamp: _Written | None = Field(description="When the trees were observed, in RFC 3339 form, in UTC.")
    session: str | None = Field(description=SESSION)
    map_pose: PlacedPose | None = Field(description=_MAP_POSE)
    properties: dict[str, Any] | None = Field(description="Other data that were stored with the submap.")
    counts: dict[str, int] = Field(description=_COUNTS)
    etag: str = Field(description=_ETAG)
    revision: int = Field(description="Revision of the collection at the last write of the submap.")
    created: _Written = Field(description="When the submap was first stored.")
    updated: _Written = Field(description="When the submap was last changed.")
    links: SubmapLinks = Field(description="Paths of the submap, its collection and its tessellation.")


class StoredLandmark(Answer):
    """A stored landmark. Attributes that it does not have are left out."""

    id: str = Field(description="Id of the tree, unique in the submap.")
    x: float = Field(description="Position along x, in metres, in the submap's frame.")
    y: float = Field(description="Position along y, in metres, in the submap's frame.")
    dbh_cm: float | None = Field(None, description="Diameter at breast height, in centimetres.")
    height_m: float | None = Field(None, description="Height of the tree, in metres.")
    species: str | None = Field(None, description="Species of the tree, as it was sent.")


class Submap(SubmapSummary):
    """A submap with its landmarks."""

    landmarks: list[StoredLandmark] = Field(description="The landmarks, in the order they were sent.")


class SubmapPage(Answer):
    """A page of submaps."""

    submaps: list[SubmapSummary] = Field(description="The submaps of the page, oldest first.")
    next: str | None = Field(None, description=NEXT)


class SessionSummary(Answer):
    """A session: submaps that were gathered in one drive, flight or survey."""

    session: str = Field(description="Name of the session.")
    submaps: int = Field(description="Number of the session's submaps.")
    landmarks: int = Field(description="Number of landmarks in all the session's submaps.")
    first: _Written | None = Field(description="Earliest stamp of the session's submaps. Null if none has one.")
    last: _Written | None = Field(description="Latest stamp of the session's submaps. Null if none has one.")


class SessionPage(Answer):
    """A page of sessions."""

    sessions: list[SessionSummary] = Field(description="The sessions of the page.")
    next: str | None = Field(None, description=NEXT)


class TessellationPolygon(Answer):
    """An interior Urquhart polygon."""

    vertices: list[int] = Field(
        description="The polygon's vertices, counter-clockwise, as positions in `landmarks`, counted from 0."
    )
    triangles: list[int] = Field(
        description="The triangles that the polygon is joined from, as positions in `triangles`, counted from 0."
    )
    descriptor: list[float] = Field(description="The numbers that the polygon is compared by.")


class TessellationAnswer(Answer):
    """The triangles and polygons of a submap."""

    submap_id: str = Field(description="Id of the submap.")
    fingerprint: str = Field(description="Hash of the parameters that the features were computed with.")
    counts: dict[str, int] = Field(description=_COUNTS)
    landmarks: list[StoredLandmark] = Field(description="The submap's landmarks, in the order they were sent.")
    triangles: list[tuple[int, int, int]] = Field(
        description="The Delaunay triangles: three positions in `landmarks` each, counted from 0, counter-clockwise."
    )
    polygons: list[TessellationPolygon] = Field(description="The interior Urquhart polygons.")


_EXAMPLES: list[Any] = SubmapInput.model_config["json_schema_extra"]["examples"]  # type: ignore[index,assignment]


class ArrivingSubmap(SubmapInput):
    """A submap to store, and on request to search for first."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [*_EXAMPLES, {**_EXAMPLES[0], "session": "monday", "query": {"exclude": {"session": "monday"}}}]
        }
    )

    query: QueryOptions | None = Field(
        None,
        description="Search for the submap before it is stored, with these options; `{}` for the defaults. It cannot "
        "find itself.",
    )

    def question(self) -> QueryInput:
        """The query to answer before this submap is stored."""
        options = self.query or QueryOptions()
        members = {name: getattr(self, name) for name in ("xy", "ids", "landmarks", "frame_id", "stamp")}
        # All members were validated already.
        return QueryInput.model_construct(
            _fields_set=set(options.model_fields_set),
            **members,
            **{name: getattr(options, name) for name in QueryOptions.model_fields},
            submap_id=None,
            store=False,
        )


class SubmapReceipt(Answer):
    """The outcome of storing a submap."""

    id: str | None = Field(description="Id of the submap. Null if a POST stored nothing.")
    collection: str = Field(description="Id of the collection.")
    outcome: Literal["created", "replaced", "unchanged", "not_stored"] = Field(
        description="What was done. `not_stored`: the submap came with a `query`, which is answered, but too few "
        "trees, or trees on one line, make no submap."
    )
    reason: str | None = Field(
        None, description="Why nothing was stored, as a stable word: the `reason` of `query`. Null otherwise."
    )
    detail: str | None = Field(None, description="Why nothing was stored, as a sentence. Null otherwise.")
    counts: dict[str, int] = Field(description=_COUNTS)
    etag: str | None = Field(
        description="Entity tag of what is stored under the id now, for `If-Match`. Null if nothing is."
    )
    revision: int = Field(
        description="Revision of the collection at the last write of the submap. If there is no submap, its present "
        "one."
    )
    cleared: list[str] = Field(
        default_factory=list,
        description="Optional members that the submap had before and that this PUT removed, such as `session`, "
        "`map_pose`, or `dbh_cm` of its landmarks. PUT replaces the whole submap; PATCH keeps members that it does not "
        "name.",
    )
    links: SubmapLinks | None = Field(
        description="Paths of the submap, its collection and its tessellation. Null if there is no submap."
    )
    query: QueryAnswer | None = Field(
        None,
        description="Where else the submap was seen, among all submaps that were stored before it. Left out unless the "
        "submap came with a `query`.",
    )
