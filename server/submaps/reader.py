"""Reads of submaps: one, a page of them, a tessellation; as JSON, GeoJSON or a drawing."""

from datetime import datetime
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

import urquhart
from server.collections.crud import get_collection
from server.collections.georeference import Georeference, polygon
from server.config.settings import Limits
from server.errors import InvalidField, NotAcceptable, NotFound
from server.index.row_decoding import config_of, features_of
from server.resources import links
from server.resources.paging import PageRequest, page_size, read_name_cursor, write_cursor
from server.schemas.common import Stamp
from server.schemas.poses import PlacedPose
from server.schemas.submaps import (
    SessionPage,
    SessionSummary,
    StoredLandmark,
    Submap,
    SubmapLinks,
    SubmapPage,
    SubmapSummary,
    TessellationAnswer,
    TessellationPolygon,
)
from server.store.codec import digest, unpack_attributes, unpack_ids, unpack_positions
from server.store.storage import Storage
from server.store.submap_records import SubmapContent, SubmapFilter, SubmapMetadata, SubmapWhole
from server.submaps.geo_footprints import geometry_of, outside, references_of, without_crs
from server.submaps.page_rows import rows_of_page
from urquhart import Budget


def read(database: Storage, collection_id: str, submap_id: str) -> Submap:
    """A submap with its landmarks. Raises NotFound."""
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        row = tx.submaps(collection.key).get(submap_id, SubmapContent)
        if row is None:
            raise NotFound("submap", submap_id)
        return submap_of(collection_id, row)


def submap_of(collection_id: str, row: SubmapContent) -> Submap:
    """The answer for a row with its landmarks."""
    return Submap(**_summary(collection_id, row), landmarks=_landmarks(row))


def page(database: Storage, limits: Limits, collection_id: str, chosen: SubmapFilter, asked: PageRequest) -> SubmapPage:
    """A page of submaps without landmarks, in the order they were stored. Raises NotFound and InvalidField."""
    rows, following = rows_of_page(database, limits, collection_id, chosen, asked, SubmapMetadata)[1:]
    return SubmapPage(submaps=[SubmapSummary(**_summary(collection_id, row)) for row in rows], next=following)


def sessions(
    database: Storage, limits: Limits, collection_id: str, limit: int | None, cursor: str | None
) -> SessionPage:
    """A page of the sessions of a collection, by name. Raises NotFound and InvalidField."""
    size = page_size(limit, limits)
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        rows = tx.sessions(collection.key).page(read_name_cursor("sessions", cursor), size + 1)
    return SessionPage(
        sessions=[
            SessionSummary(
                session=row.session, submaps=row.submaps, landmarks=row.landmarks, first=row.first, last=row.last
            )
            for row in rows[:size]
        ],
        next=write_cursor("sessions", rows[size - 1].session) if len(rows) > size else None,
    )


def geojson_page(
    database: Storage,
    limits: Limits,
    collection_id: str,
    chosen: SubmapFilter,
    asked: PageRequest,
    budget: Budget,
) -> tuple[dict[str, Any], str | None]:
    """A page as GeoJSON: footprints, by the CRS of each submap's map frame; and the cursor of the next page.

    A submap without map_pose, or in a map frame without CRS, has no geometry, and `no_geometry` says why. Raises
    NotAcceptable for a collection without any CRS, and urquhart.budget.DeadlinePassed and Abandoned.
    """
    collection, rows, following = rows_of_page(database, limits, collection_id, chosen, asked, SubmapContent)
    references = references_of(database, collection, {row.place.map_frame_id for row in rows if row.place is not None})
    features = []
    for row in rows:
        budget.check()
        summary = SubmapSummary(**_summary(collection_id, row)).model_dump(mode="json")
        submap_id = summary.pop("id")
        geometry, reason = geometry_of(row, references)
        summary |= {} if reason is None else {"no_geometry": reason}
        features.append({"type": "Feature", "id": submap_id, "geometry": geometry, "properties": summary})
    return {"type": "FeatureCollection", "features": features} | ({"next": following} if following else {}), following


class Tessellated:
    """A submap's tessellation in all its formats. Each method raises `DeadlinePassed` and `Abandoned`."""

    def __init__(self, database: Storage, collection_id: str, submap_id: str, budget: Budget) -> None:
        """Raises NotFound."""
        self._budget = budget
        with database.read() as tx:
            self._collection = get_collection(tx, collection_id)
            row = tx.submaps(self._collection.key).get(submap_id, SubmapWhole)
            if row is None:
                raise NotFound("submap", submap_id)
            self._row = row
            frame_id = None if row.place is None else row.place.map_frame_id
            self._reference = (
                None if frame_id is None else tx.map_frames(self._collection).some([frame_id]).get(frame_id)
            )
        self._features = features_of(row.features, row.landmarks, row.attributes, config_of(self._collection))
        self.etag = digest(row.etag.encode(), self._features.fingerprint.encode(), self._geo_etag())

    def to_answer(self) -> TessellationAnswer:
        """The tessellation as data. Landmarks are referred to by position."""
        tessellation = self._features.tessellation
        return TessellationAnswer(
            submap_id=self._row.id,
            fingerprint=self._features.fingerprint,
            counts=self._features.counts(),
            landmarks=_landmarks(self._row),
            triangles=tessellation.triangles.tolist(),
            polygons=[
                TessellationPolygon(
                    vertices=tessellation.polygon(i).tolist(),
                    triangles=tessellation.polygon_triangles(i).tolist(),
                    descriptor=self._features.descriptors[i].tolist(),
                )
                for i in self._budget.each(range(len(tessellation)))
            ],
        )

    def to_geojson(self) -> dict[str, Any]:
        """The polygons in longitude and latitude. Raises NotAcceptable without CRS or map_pose."""
        others = ["application/json", "image/svg+xml"]
        place = self._row.place
        if place is None:
            raise NotAcceptable(
                f"The submap {self._row.id!r} has no map_pose, so it has no longitude and latitude. Set one with "
                "PATCH, or ask for application/json.",
                others,
            )
        if self._reference is None:
            raise NotAcceptable(f"The submap {self._row.id!r}: {without_crs(place.map_frame_id)}.", others)
        positions = Georeference(self._reference).lonlat(place, self._features.landmarks + self._features.origin)
        if positions is None:
            raise NotAcceptable(f"The submap {self._row.id!r}: {outside(place.map_frame_id, self._reference)}.", others)
        tessellation = self._features.tessellation
        return {
            "type": "FeatureCollection",
            "features": [
                {
                    "type": "Feature",
                    "id": i,
                    "geometry": polygon([positions[vertex] for vertex in tessellation.polygon(i)]),
                    "properties": {"vertices": tessellation.polygon(i).tolist()},
                }
                for i in self._budget.each(range(len(tessellation)))
            ],
        }

    def to_svg(self) -> str:
        """The tessellation as a drawing."""
        return urquhart.draw_tessellation(self._features, title=self._row.id, budget=self._budget)

    def _geo_etag(self) -> bytes:
        return repr(self._reference).encode()


def submap_filter(
    *, session: str | None, bbox: str | None, frame_id: str | None, datetime_range: str | None
) -> SubmapFilter:
    """The filter in query parameters. Raises InvalidField."""
    since, until = _interval(datetime_range)
    return SubmapFilter(session=session, bbox=_bbox(bbox), map_frame_id=frame_id, since=since, until=until)


def _summary(collection_id: str, row: SubmapMetadata) -> dict[str, Any]:
    place = row.place
    return {
        "id": row.id,
        "collection": collection_id,
        "frame_id": row.frame_id,
        "stamp": row.stamp,
        "session": row.session,
        "map_pose": place
        and PlacedPose(
            frame_id=place.map_frame_id,
            x=place.map_x,
            y=place.map_y,
            yaw=place.map_yaw,
            covariance=place.map_covariance,
        ),
        "properties": row.properties,
        "counts": row.counts,
        "etag": row.etag,
        "revision": row.revision,
        "created": row.created,
        "updated": row.updated,
        "links": submap_links(collection_id, row.id),
    }


def submap_links(collection_id: str, submap_id: str) -> SubmapLinks:
    """Paths of a submap, its collection and its tessellation."""
    own = links.submap(collection_id, submap_id)
    return SubmapLinks(self=own, collection=links.collection(collection_id), tessellation=f"{own}/tessellation")


def _landmarks(row: SubmapContent) -> list[StoredLandmark]:
    ids = unpack_ids(row.landmark_ids, row.landmark_count)
    attributes = unpack_attributes(row.attributes)
    return [
        StoredLandmark(id=name, x=float(x), y=float(y), **{key: values[i] for key, values in attributes.items()})
        for i, (name, (x, y)) in enumerate(zip(ids, unpack_positions(row.landmarks), strict=True))
    ]


def _bbox(text: str | None) -> tuple[float, float, float, float] | None:
    if text is None:
        return None
    try:
        # float() would accept `1_0`.
        values = () if "_" in text else tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 4 or not np.isfinite(values).all() or values[0] > values[2] or values[1] > values[3]:
        raise InvalidField(
            "must be four numbers min x,min y,max x,max y in metres of the map frame, each minimum at most its maximum",
            code="bbox",
            parameter="bbox",
        )
    return values


def _interval(text: str | None) -> tuple[datetime | None, datetime | None]:
    if text is None:
        return None, None
    parts = text.split("/")
    ends = [None if part in {"", ".."} else _instant(part) for part in parts]
    if len(parts) > 2 or ends == [None] or ends == [None, None]:
        raise _bad_datetime()
    since, until = (ends[0], ends[0]) if len(ends) == 1 else (ends[0], ends[1])
    if since is not None and until is not None and since > until:
        raise _bad_datetime()
    return since, until


def _instant(text: str) -> datetime:
    # A '+' that was not escaped in the URL has become a space.
    text = text[:-6] + "+" + text[-5:] if len(text) > 6 and text[-6] == " " else text
    try:
        return _STAMP.validate_python(text)
    except ValidationError as error:
        raise _bad_datetime() from error


def _bad_datetime() -> InvalidField:
    return InvalidField(
        "must be an instant such as 2026-05-04T09:30:00Z or an interval start/end, '..' for an open end, start first",
        code="datetime",
        parameter="datetime",
    )


_STAMP: TypeAdapter[datetime] = TypeAdapter(Stamp)
