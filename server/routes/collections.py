"""Routes of collections."""

from fastapi import APIRouter, Request, Response

from server.collections import crud
from server.http.json_body import JsonRoute
from server.http.responses import etag_header, json_response, next_link, not_modified, problems, stored_response
from server.resources import links
from server.resources.idempotency import StoredResponse, find_before, run_once
from server.routes.dependencies import (
    CollectionId,
    IdempotencyKeyDep,
    IfNoneMatch,
    PageCursor,
    PageLimit,
    PreconditionsDep,
    PrincipalDep,
    ServiceDep,
)
from server.schemas.collections import (
    COLLECTION_EXAMPLE,
    Collection,
    CollectionPage,
    CollectionPatch,
    CollectionPut,
)
from server.schemas.common import to_json

router = APIRouter(route_class=JsonRoute, tags=["collections"])
_PATH = "/v1/collections/{collection}"
_EXAMPLE = {"content": {"application/json": {"example": COLLECTION_EXAMPLE}}}
_SUMMARY = {name: value for name, value in COLLECTION_EXAMPLE.items() if name not in {"frames", "config", "extent"}}


@router.get(
    "/v1/collections",
    operation_id="listCollections",
    summary="List the collections",
    response_model=CollectionPage,
    responses={
        200: {
            "content": {"application/json": {"example": {"collections": [_SUMMARY], "next": "WyJjb2xsZWN0aW9ucyIsMV0"}}}
        },
        **problems(422, 503),
    },
)
def list_collections(
    request: Request,
    service: ServiceDep,
    caller: PrincipalDep,
    limit: PageLimit = None,
    cursor: PageCursor = None,
) -> Response:
    """Lists the collections that the key may see, in the order they were created. The last page has no `next`."""
    page = crud.page(service.database, service.settings.limits, caller, limit, cursor)
    headers = {} if page.next is None else {"Link": next_link("/v1/collections", request, page.next)}
    return json_response(page, headers=headers)


@router.put(
    _PATH,
    operation_id="putCollection",
    summary="Create a collection",
    response_model=Collection,
    responses={
        200: {"description": "The collection exists and agrees with the body.", **_EXAMPLE},
        201: {"description": "The collection was created.", "model": Collection, **_EXAMPLE},
        **problems(400, 409, 412, 413, 415, 422, 503, 507),
    },
)
def put_collection(
    collection: CollectionId,
    body: CollectionPut,
    service: ServiceDep,
    preconditions: PreconditionsDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Creates the collection, or confirms that it exists. Members that you leave out are not compared, so `{}` only
    makes sure that it exists.

    409 if it exists and differs in a member that you send.
    """
    if idempotency_key is None:  # mostly it is there, and then nothing is to be written
        return stored_response(_answered(crud.ensure(service.database, collection, body, preconditions)))
    operation = f"putCollection {collection}"
    response = find_before(service.database, idempotency_key, operation)
    if response is None:
        config = crud.checked(body)
        response = run_once(
            service.database,
            idempotency_key,
            operation,
            lambda tx: _answered(crud.ensure_in(tx, collection, body, config, preconditions)),
        )
    return stored_response(response)


@router.get(
    _PATH,
    operation_id="getCollection",
    summary="Read a collection",
    response_model=Collection,
    responses={200: _EXAMPLE, 304: {"description": "Not modified."}, **problems(404, 422, 503)},
)
def get_collection(collection: CollectionId, service: ServiceDep, if_none_match: IfNoneMatch = None) -> Response:
    """Returns configuration, fingerprint, counts, extent and revision."""
    found, etag = crud.read(service.database, collection)
    return not_modified(if_none_match, etag) or json_response(found, headers=etag_header(etag))


@router.patch(
    _PATH,
    operation_id="patchCollection",
    summary="Change a collection",
    response_model=Collection,
    responses={200: _EXAMPLE, **problems(400, 404, 409, 412, 413, 415, 422, 503, 507)},
)
def patch_collection(
    collection: CollectionId,
    body: CollectionPatch,
    service: ServiceDep,
    preconditions: PreconditionsDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Changes title, crs, origin and frames. null removes a member; members that you leave out stay. The configuration
    cannot be changed (409).

    422 if a CRS or origin would put a stored submap outside the area of that CRS.
    """
    config = crud.checked(body)
    return stored_response(
        run_once(
            service.database,
            idempotency_key,
            f"patchCollection {collection}",
            lambda tx: _answered(crud.patch_in(tx, collection, body, config, preconditions)),
        )
    )


@router.delete(
    _PATH,
    operation_id="deleteCollection",
    summary="Delete a collection",
    status_code=204,
    response_class=Response,
    responses=problems(404, 412, 422, 503, 507),
)
def delete_collection(
    collection: CollectionId, service: ServiceDep, preconditions: PreconditionsDep, idempotency_key: IdempotencyKeyDep
) -> Response:
    """Deletes the collection with everything in it."""
    response = run_once(
        service.database,
        idempotency_key,
        f"deleteCollection {collection}",
        lambda tx: crud.delete_in(tx, collection, preconditions),
    )
    if not response.replayed:
        service.indexes.forget(collection)
    return stored_response(response)


def _answered(ensured: crud.Ensured) -> StoredResponse:
    headers = etag_header(ensured.etag)
    if ensured.created:
        headers["Location"] = links.collection(ensured.collection.id)
    return StoredResponse(201 if ensured.created else 200, headers, to_json(ensured.collection))
