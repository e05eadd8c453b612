"""Routes of snapshots of the whole database, for keys that may see all collections."""

from typing import Annotated

from fastapi import APIRouter, Path, Request, Response
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse
from starlette.types import Message, Receive, Scope, Send

from server.http.json_body import JsonRoute
from server.http.negotiation import JSON, SQLITE, choose
from server.http.responses import etag_header, json_response, next_link, not_modified, problems, stored_response
from server.resources import links
from server.routes.dependencies import (
    Accept,
    IdempotencyKeyDep,
    IfNoneMatch,
    PageCursor,
    PageLimit,
    PrincipalDep,
    ServiceDep,
)
from server.schemas.common import ResourceId
from server.schemas.snapshots import SNAPSHOT_EXAMPLE, Snapshot, SnapshotInput, SnapshotPage
from server.snapshots import snapshots

router = APIRouter(route_class=JsonRoute, tags=["snapshots"])
_PATH = "/v1/snapshots"
_EXAMPLE = {"content": {JSON: {"example": SNAPSHOT_EXAMPLE}}}
SnapshotName = Annotated[
    ResourceId, Path(description="`name` of the snapshot.", examples=[SNAPSHOT_EXAMPLE["name"]], alias="snapshot")
]


class _Download(FileResponse):
    """A file, or a range of it; an invalid range is answered with a problem document."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def checked(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] in {400, 416}:
                headers = {name.decode(): value.decode() for name, value in message["headers"]}
                response = {name: value for name, value in headers.items() if name == "content-range"}
                raise HTTPException(
                    message["status"], "The header Range asks for bytes that the file does not have.", response
                )
            await send(message)

        await super().__call__(scope, receive, checked)


@router.post(
    _PATH,
    operation_id="postSnapshot",
    summary="Create a snapshot",
    response_model=Snapshot,
    status_code=201,
    responses={
        201: {"description": "The snapshot is checked and on the disk; `Location` is its path.", **_EXAMPLE},
        **problems(400, 409, 413, 415, 422, 503, 507),
    },
)
def post_snapshot(
    body: SnapshotInput, service: ServiceDep, caller: PrincipalDep, idempotency_key: IdempotencyKeyDep
) -> Response:
    """Copies the whole database, including the hashes of API keys. Reads and writes continue meanwhile.

    The copy contains every write acknowledged before the request. The oldest snapshots beyond `snapshots.keep` are
    removed. 409 while another snapshot is being made.
    """
    caller.require_all()
    keep = service.settings.snapshots.keep
    return stored_response(snapshots.make_once(service.database, service.snapshots, body.name, keep, idempotency_key))


@router.get(
    _PATH,
    operation_id="listSnapshots",
    summary="List the snapshots",
    response_model=SnapshotPage,
    responses={
        200: {
            "content": {JSON: {"example": {"snapshots": [SNAPSHOT_EXAMPLE], "next": "WyJzbmFwc2hvdHMiLCJ4Il0"}}},
        },
        **problems(422, 503),
    },
)
def list_snapshots(
    request: Request,
    service: ServiceDep,
    caller: PrincipalDep,
    limit: PageLimit = None,
    cursor: PageCursor = None,
) -> Response:
    """Lists snapshots, oldest first. The last page has no `next`."""
    caller.require_all()
    page = snapshots.page(service.snapshots, service.settings.limits, limit, cursor)
    headers = {} if page.next is None else {"Link": next_link(links.snapshots(), request, page.next)}
    return json_response(page.document(), headers=headers)


@router.get(
    f"{_PATH}/{{snapshot}}",
    operation_id="getSnapshot",
    summary="Read or download a snapshot",
    response_model=Snapshot,
    responses={
        200: {
            "content": {
                JSON: {"example": SNAPSHOT_EXAMPLE},
                SQLITE: {"schema": {"type": "string", "format": "binary"}, "example": "SQLite format 3"},
            }
        },
        206: {
            "description": "The requested range of the file.",
            "content": {SQLITE: {"schema": {"type": "string", "format": "binary"}, "example": "format 3"}},
        },
        304: {"description": "Not modified."},
        **problems(404, 406, 416, 422, 503),
    },
)
def get_snapshot(
    snapshot: SnapshotName,
    service: ServiceDep,
    caller: PrincipalDep,
    accept: Accept = None,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Describes a snapshot. With `Accept: application/vnd.sqlite3` it returns the file, whose entity tag is its
    SHA-256; `Range` resumes a download.

    To restore it, run `urquhart snapshot restore` on the host.
    """
    caller.require_all()
    found = service.snapshots.get(snapshot)
    if choose(accept, [JSON, SQLITE]) == JSON:
        tag = snapshots.snapshot_etag(found)
        return not_modified(if_none_match, tag) or json_response(
            found.document(), headers={**etag_header(tag), "Vary": "Accept"}
        )
    return not_modified(if_none_match, found.sha256) or _Download(
        service.snapshots.file(found.name),
        media_type=SQLITE,
        filename=f"{found.name}.db",
        headers={**etag_header(found.sha256), "Vary": "Accept"},
    )


@router.delete(
    f"{_PATH}/{{snapshot}}",
    operation_id="deleteSnapshot",
    summary="Delete a snapshot",
    status_code=204,
    response_class=Response,
    responses=problems(404, 422, 503),
)
def delete_snapshot(
    snapshot: SnapshotName, service: ServiceDep, caller: PrincipalDep, idempotency_key: IdempotencyKeyDep
) -> Response:
    """Deletes a snapshot permanently."""
    caller.require_all()
    return stored_response(snapshots.remove_once(service.database, service.snapshots, snapshot, idempotency_key))
