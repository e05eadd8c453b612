"""OGC API - Features (Part 1: Core, GeoJSON), read only: a GIS opens the service by the address of its landing page."""

from collections.abc import Callable, Coroutine
from datetime import UTC, datetime
from typing import Annotated, Any, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import BeforeValidator

from server.errors import InvalidField, InvalidParameter
from server.http.admission.request_admission import BudgetDep
from server.http.authorization import GuardedRoute
from server.http.negotiation import GEOJSON, JSON, choose
from server.http.responses import json_response, problems
from server.ogc import feature_collections as collections
from server.ogc.boxes import read_box
from server.ogc.items import FeatureKind, ItemsRequest, item_of, page_of
from server.parsing.field_errors import describe, field_problems
from server.routes.dependencies import Accept, CollectionId, PageCursor, PrincipalDep, ServiceDep
from server.schemas.common import check_digits
from server.submaps.reader import submap_filter


class FeaturesRoute(GuardedRoute):
    """A route whose bad parameters are answered with 400, as OGC API - Features wants it, instead of 422."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Handle, and say of bad parameters what every other route says."""
        handle = super().get_route_handler()

        async def handle_features(request: Request) -> Response:
            try:
                return await handle(request)
            except InvalidField as error:
                raise InvalidParameter(str(error), code=error.code, parameter=error.parameter) from None
            except RequestValidationError as error:
                entries = field_problems(error.errors())
                raise InvalidParameter(
                    describe(entries), code="invalid", parameter=entries[0].get("parameter")
                ) from None

        return handle_features


router = APIRouter(route_class=FeaturesRoute, tags=["features"])
_COLLECTIONS = f"{collections.ROOT}/collections"
_ONE = f"{_COLLECTIONS}/{{collection}}:{{kind}}"
_DEFAULT: Final = 100
_OBJECT: Final[dict[str, Any]] = {"schema": {"type": "object"}}
_FEATURE: Final[dict[str, Any]] = {
    "type": "Feature",
    "id": "p7:t1",
    "geometry": {"type": "Point", "coordinates": [8.2911, 48.8512]},
    "properties": {"id": "t1", "dbh_cm": 31.0, "submap": "p7"},
}
_LINK = {"href": "http://localhost:8000/ogc", "rel": "self", "type": JSON, "title": "This page"}
_DESCRIBED: Final[dict[str, Any]] = {"id": "plots:landmarks", "title": "plots: landmarks", "links": [_LINK]}
Kind = Annotated[FeatureKind, Path(description="`landmarks` or `submaps`.", alias="kind")]


def _answers(media_type: str, example: dict[str, Any], *statuses: int) -> dict[int | str, dict[str, Any]]:
    return {200: {"content": {media_type: _OBJECT | {"example": example}}}, **problems(*statuses)}


@router.get(f"{collections.ROOT}/", include_in_schema=False, operation_id="getFeaturesLandingPage")
@router.get(
    collections.ROOT,
    operation_id="getFeaturesLandingPage",
    summary="Landing page for GIS",
    response_class=Response,
    responses=_answers(JSON, {"title": "Urquhart", "links": [_LINK]}, 400, 406),
)
def get_features_landing_page(request: Request, accept: Accept = None) -> Response:
    """The address to give to QGIS or GDAL: OGC API - Features, read only. Links lead to all that the key may see."""
    choose(accept, [JSON])
    return json_response(collections.landing_page(_base(request)))


@router.get(
    f"{collections.ROOT}/conformance",
    operation_id="getConformance",
    summary="List the conformance classes",
    response_class=Response,
    responses=_answers(JSON, {"conformsTo": list(collections.CONFORMANCE)}, 400, 406),
)
def get_conformance(accept: Accept = None) -> Response:
    """Lists what parts of OGC API - Features the service conforms to: Core and GeoJSON."""
    choose(accept, [JSON])
    return json_response({"conformsTo": list(collections.CONFORMANCE)})


@router.get(
    _COLLECTIONS,
    operation_id="listFeatureCollections",
    summary="List the feature collections",
    response_class=Response,
    responses=_answers(JSON, {"links": [_LINK], "collections": [_DESCRIBED]}, 400, 406, 503),
)
def list_feature_collections(
    request: Request, service: ServiceDep, caller: PrincipalDep, cursor: PageCursor = None, accept: Accept = None
) -> Response:
    """Lists two feature collections for each collection that the key may see: its landmarks and its submaps."""
    choose(accept, [JSON])
    return json_response(
        collections.list_page(service.database, service.settings.limits, caller, _base(request), cursor)
    )


@router.get(
    _ONE,
    operation_id="getFeatureCollection",
    summary="Describe a feature collection",
    response_class=Response,
    responses=_answers(JSON, _DESCRIBED, 400, 404, 406, 503),
)
def get_feature_collection(
    request: Request, collection: CollectionId, kind: Kind, service: ServiceDep, accept: Accept = None
) -> Response:
    """Describes a feature collection. It has an extent if a map frame has a coordinate reference system."""
    choose(accept, [JSON])
    return json_response(collections.describe(service.database, collection, kind, _base(request)))


@router.get(
    f"{_ONE}/items",
    operation_id="listFeatures",
    summary="Read features",
    response_class=Response,
    responses=_answers(GEOJSON, {"type": "FeatureCollection", "features": [_FEATURE]}, 400, 404, 406, 503),
)
def list_features(
    request: Request,
    collection: CollectionId,
    kind: Kind,
    service: ServiceDep,
    budget: BudgetDep,
    limit: Annotated[
        int,
        BeforeValidator(check_digits),
        Query(
            ge=1, description="Most features on the page; `page_max` in GET /v1/limits if it is more.", examples=[100]
        ),
    ] = _DEFAULT,
    bbox: Annotated[
        str | None,
        Query(
            description="Only features in this box: min longitude,min latitude,max longitude,max latitude, in degrees. "
            "Features without geometry are in none.",
            examples=["8.2,48.8,8.4,48.9"],
        ),
    ] = None,
    datetime: Annotated[
        str | None,
        Query(
            description="Only features of submaps with a stamp in this interval start/end; '..' for an open end. Or an "
            "instant.",
            examples=["2026-05-01T00:00:00Z/.."],
        ),
    ] = None,
    cursor: PageCursor = None,
    accept: Accept = None,
) -> Response:
    """Returns features as GeoJSON in longitude and latitude, in the order in which submaps were stored. The link `next`
    leads to the next page; the last page has none.

    Writes in between move nothing. A page may have fewer features than `limit`, or none, and still a next one. What is
    in a map frame without a coordinate reference system has no geometry, and `no_geometry` says why.
    """
    choose(accept, [GEOJSON, JSON])
    chosen = submap_filter(session=None, bbox=None, frame_id=None, datetime_range=datetime)
    most = min(limit, service.settings.limits.page_max)
    asked = ItemsRequest(most, read_box(bbox), chosen, cursor)
    features, following = page_of(collections.source_of(service.database, collection, kind), asked, budget)
    query = None if following is None else urlencode({**request.query_params, "cursor": following})
    path = collections.path_of(collection, kind)
    content = {
        "type": "FeatureCollection",
        "timeStamp": _now(),
        "numberReturned": len(features),
        "links": collections.page_links(_base(request), path, urlencode(request.query_params), query),
        "features": features,
    }
    return json_response(content, media_type=GEOJSON, headers={"Vary": "Accept"})


@router.get(
    f"{_ONE}/items/{{feature:path}}",
    operation_id="getFeature",
    summary="Read a feature",
    response_class=Response,
    responses=_answers(GEOJSON, _FEATURE, 400, 404, 406, 503),
)
def get_feature(
    request: Request,
    collection: CollectionId,
    kind: Kind,
    feature: Annotated[
        str,
        Path(
            description="`id` of the feature: that of the submap, or SUBMAP:LANDMARK.",
            examples=["p7:t1"],
            max_length=300,
        ),
    ],
    service: ServiceDep,
    accept: Accept = None,
) -> Response:
    """Returns one feature as GeoJSON in longitude and latitude."""
    choose(accept, [GEOJSON, JSON])
    found = item_of(collections.source_of(service.database, collection, kind), feature)
    links = collections.item_links(_base(request), collections.path_of(collection, kind), found["id"])
    return json_response(found | {"links": links}, media_type=GEOJSON, headers={"Vary": "Accept"})


def _base(request: Request) -> str:
    """The address under which the caller reached the service: GIS clients need whole links."""
    return str(request.base_url).rstrip("/")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
