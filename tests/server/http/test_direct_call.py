"""Endpoints are called as the framework would call them; what is invalid or unusual is left to it."""

import contextlib
from collections.abc import AsyncIterator
from typing import Annotated, Any

import anyio
import pytest
from fastapi import BackgroundTasks, Depends, FastAPI, Header, Path, Query, Request, Response
from fastapi.routing import APIRoute
from pydantic import BaseModel

from server.app import create_app
from server.config.settings import Settings
from server.http.authorization import GuardedRoute
from server.http.direct_call import DirectCall
from server.platform.request_threads import RequestThreads

CLOSED: list[str] = []


async def named(request: Request) -> str:
    return f"{request.method} {request.url.path}"


async def opened(name: Annotated[str, Depends(named)], token: Annotated[str, Header()] = "none") -> AsyncIterator[str]:
    yield f"{name} {token}"
    CLOSED.append(name)


class SentThing(BaseModel):
    size: int


def endpoint(
    number: Annotated[int, Path(alias="id", ge=1)],
    body: SentThing,
    name: Annotated[str, Depends(named)],
    token: Annotated[str, Depends(opened)],
    page: Annotated[int, Query()] = 7,
) -> Response:
    return Response(f"{number} {body.size} {name} {token} {page}")


def route_of(function: Any) -> APIRoute:
    app = FastAPI()
    app.add_api_route("/things/{id}", function, methods=["PUT"])
    return next(route for route in app.routes if isinstance(route, APIRoute))


def answered(path: str = "3", sent: Any = None, query: bytes = b"", token: str | None = None) -> str | None:
    """What a direct call answers, None where the framework has to."""
    direct = DirectCall.of(route_of(endpoint))
    assert direct is not None
    app = FastAPI()
    app.state.threads = RequestThreads(1)
    headers = [] if token is None else [(b"token", token.encode())]
    scope: dict[str, Any] = {"type": "http", "method": "PUT", "path": f"/things/{path}", "headers": headers, "app": app}
    scope |= {"query_string": query, "path_params": {"id": path}, "server": ("a", 1), "scheme": "http", "root_path": ""}

    async def call() -> Response | None:
        async with contextlib.AsyncExitStack() as stack:
            scope["fastapi_inner_astack"] = stack
            return await direct(Request(scope), {"size": 2} if sent is None else sent)

    response = anyio.run(call)
    return None if response is None else bytes(response.body).decode()


def test_arguments_come_from_path_body_headers_and_dependencies() -> None:
    CLOSED.clear()
    assert answered() == "3 2 PUT /things/3 PUT /things/3 none 7"
    assert CLOSED == ["PUT /things/3"], "what a dependency opens is closed"
    assert answered(token="t") == "3 2 PUT /things/3 PUT /things/3 t 7"


def test_what_is_invalid_or_unusual_is_left_to_the_framework() -> None:
    CLOSED.clear()
    assert answered(path="0") is None
    assert answered(path="x") is None
    assert answered(sent={"size": "large"}) is None
    assert answered(query=b"page=8") is None
    assert CLOSED == [], "nothing was opened before all was found valid"


def with_background(tasks: BackgroundTasks) -> Response:
    return Response(str(tasks))


def with_list(things: Annotated[list[str], Query()]) -> Response:
    return Response(str(things))


def without_response() -> dict[str, str]:
    return {}


@pytest.mark.parametrize("function", [with_background, with_list, without_response])
def test_endpoints_that_need_the_framework_are_left_to_it(function: Any) -> None:
    assert DirectCall.of(route_of(function)) is None


def test_all_routes_of_the_service_are_called_directly_but_for_streams(tmp_path: Any) -> None:
    app = create_app(Settings(database=str(tmp_path / "a.db")))
    routes = [route for router in app.state.routers for route in router.routes if isinstance(route, GuardedRoute)]
    left = {route.operation_id for route in routes if DirectCall.of(route) is None}
    assert left <= {"postImport", None}
