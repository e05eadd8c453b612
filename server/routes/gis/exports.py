"""Routes that export what a collection holds as files for GIS."""

from collections.abc import Iterator
from typing import Annotated, Any, Final
from urllib.parse import quote

from fastapi import APIRouter, Path, Query, Response
from starlette.responses import StreamingResponse

from server.exports.downloads import write_download
from server.exports.layers import LayerName, export_of
from server.exports.selection import ExportChoice
from server.http.admission.request_admission import BudgetDep
from server.http.json_body import JsonRoute
from server.http.negotiation import choose
from server.http.responses import problems
from server.outputs.files import FORMATS, FormatName, OutputFormat
from server.routes.dependencies import Accept, CollectionId, ServiceDep
from server.submaps.reader import submap_filter

router = APIRouter(route_class=JsonRoute, tags=["exports"])
_BINARY: Final[dict[str, Any]] = {"schema": {"type": "string", "format": "binary"}, "example": "SQLite format 3"}
_PIECE: Final = 1 << 16
"""Bytes that are sent at once."""
_CONTENT: Final[dict[str, Any]] = {
    "text/csv": {
        "schema": {"type": "string"},
        "example": "id,x,y,dbh_cm,submap,crs\nt1,448125.0190,5411179.4430,21.1,p7,EPSG:25832\n",
    },
    "application/geo+json": {
        "schema": {"type": "object"},
        "example": {"type": "FeatureCollection", "name": "landmarks", "features": []},
    },
    "application/geopackage+sqlite3": _BINARY,
    "application/vnd.apache.parquet": _BINARY | {"example": "PAR1"},
}


@router.get(
    "/v1/collections/{collection}/exports/{table}",
    operation_id="getExport",
    summary="Export a collection as a file",
    response_class=Response,
    responses={200: {"content": _CONTENT}, **problems(404, 406, 422, 503, 507)},
)
def get_export(
    collection: CollectionId,
    table: Annotated[
        LayerName,
        Path(description="`landmarks` (trees), `submaps`, `matches` (stored queries), or `pairs` (of trees in these)."),
    ],
    service: ServiceDep,
    budget: BudgetDep,
    written: Annotated[
        FormatName | None,
        Query(alias="format", description="Format of the file, instead of `Accept`, for browsers.", examples=["gpkg"]),
    ] = None,
    frame_id: Annotated[
        str | None,
        Query(
            description="Only what is in this map frame. Needed if map frames have several coordinate reference "
            "systems, because one file has one.",
            examples=["map"],
        ),
    ] = None,
    session: Annotated[
        str | None, Query(description="Only landmarks or submaps of this session.", examples=["2026-05-04-robot-2"])
    ] = None,
    bbox: Annotated[
        str | None,
        Query(
            description="Only submaps whose footprint overlaps this box, and their landmarks: min x,min y,max x,max y, "
            "metres, map frame.",
            examples=["0,0,100,100"],
        ),
    ] = None,
    every: Annotated[
        bool,
        Query(description="One row for each submap that has a tree, where overlapping submaps of a stand share it."),
    ] = False,
    accept: Accept = None,
) -> Response:
    """Returns all landmarks, submaps, matches or pairs as CSV, GeoJSON, GeoPackage or GeoParquet, by `Accept` or
    `format`.

    Positions are full coordinates of the map frame's coordinate reference system; a frame without one is written as a
    local engineering system with its name (CSV leaves `crs` empty). GeoJSON is in longitude and latitude: 406 if no map
    frame has a coordinate reference system. CSV and GeoJSON are sent while they are read. What is stored meanwhile may
    be missing.
    """
    form = _format(written, accept)
    chosen = submap_filter(session=session, bbox=bbox, frame_id=frame_id, datetime_range=None)
    choice = ExportChoice(chosen, every=every, in_degrees=form.name == "geojson")
    name = quote(f"{collection}-{table}{form.suffix}", safe="")
    headers = {"Vary": "Accept", "Content-Disposition": f"attachment; filename*=UTF-8''{name}"}
    if form.pieces is not None:
        made = export_of(service.database, collection, table, choice)
        pieces = _together(form.pieces(made.layer, made.rows))
    else:
        written_file = write_download(
            service.database, export_of(service.database, collection, table, choice, budget), form
        )
        pieces, headers["Content-Length"] = written_file.pieces(), str(written_file.size)
    return StreamingResponse(pieces, media_type=form.media_type, headers=headers)


def _format(written: FormatName | None, accept: str | None) -> OutputFormat:
    """The format that the caller asks for. Raises NotAcceptable."""
    there = [one for one in FORMATS if one.is_there]
    if written is not None:
        return next(one for one in FORMATS if one.name == written)
    media_type = choose(accept, [one.media_type for one in there])
    return next(one for one in there if one.media_type == media_type)


def _together(pieces: Iterator[bytes]) -> Iterator[bytes]:
    """The same bytes in large pieces, because each is sent by a thread of its own."""
    waiting = bytearray()
    for piece in pieces:
        waiting += piece
        if len(waiting) >= _PIECE:
            yield bytes(waiting)
            waiting.clear()
    yield bytes(waiting)
