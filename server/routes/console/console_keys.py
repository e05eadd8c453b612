"""The list of keys, for the console's page of operations: what they may do, and nothing that could be used as one."""

from datetime import UTC, datetime
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Request, Response

from server.http.authorization import GuardedRoute, authenticate
from server.http.responses import json_response
from server.routes.dependencies import ServiceDep
from server.security import api_keys
from server.security.principal import Principal, Scope

router = APIRouter(route_class=GuardedRoute, include_in_schema=False)
PATH: Final = "/ui/keys"


async def get_operator(request: Request) -> Principal:
    """The caller, who may see all keys. Raises Unauthorized and Forbidden."""
    caller = await authenticate(request)
    caller.require(Scope.ADMIN)
    caller.require_all()
    return caller


@router.get(PATH)
def list_keys(service: ServiceDep, operator: Annotated[Principal, Depends(get_operator)]) -> Response:
    """All keys, oldest first, without their secrets, which are not stored. For admins of all collections."""
    now = datetime.now(UTC)
    keys = [
        {
            "id": row.id,
            "name": row.name,
            "state": row.state(now),
            "scopes": list(row.scopes),
            "patterns": list(row.patterns),
            "created": row.created,
            "expires": row.expires,
        }
        for row in api_keys.listed(service.database)
    ]
    return json_response({"keys": keys}, headers={"Cache-Control": "no-store"})
