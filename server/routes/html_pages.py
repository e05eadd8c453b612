"""Routes of pages for people, also available as JSON: the landing page and the explanations of problems."""

from typing import Annotated

from fastapi import APIRouter, Path, Request, Response
from fastapi.openapi.docs import get_swagger_ui_html

from server.collections import crud
from server.errors import NotFound
from server.http.authorization import GuardedRoute
from server.http.browser_protection import page_policy
from server.http.documentation import html_pages
from server.http.documentation.openapi_document import EncodedDocument
from server.http.negotiation import HTML, JSON, choose
from server.http.responses import json_response, problems
from server.problem_types import PROBLEM_TYPES
from server.routes.console.pages import PATH as CONSOLE_PATH
from server.routes.dependencies import Accept, ServiceDep, VisitorDep

router = APIRouter(route_class=GuardedRoute, tags=["pages"])

OPENAPI = "/openapi.json"
"""Where the OpenAPI document is."""
ASSETS = "/docs/assets"
"""Where scripts and styles of the documentation are served."""


@router.get(
    "/",
    operation_id="getLandingPage",
    summary="Landing page",
    responses={
        200: {
            "content": {
                JSON: {"schema": {"type": "object"}, "example": {"title": "Urquhart", "collections": []}},
            }
        },
        303: {"description": "Browsers are sent on to the console, /ui."},
        **problems(406, 503),
    },
    response_class=Response,
)
def landing_page(service: ServiceDep, visitor: VisitorDep, accept: Accept = None) -> Response:
    """Lists the collections that the caller may see, and the service's pages, as JSON. A browser, which prefers HTML,
    is sent on to the console.
    """
    media_type = choose(accept, [JSON, HTML])
    headers = {"Vary": "Accept"}
    if media_type == HTML:
        return Response(status_code=303, headers=headers | {"Location": CONSOLE_PATH})
    page = crud.page(service.database, service.settings.limits, visitor, None, None)
    return json_response(html_pages.landing_json(page, service.settings.docs_url or "/docs"), headers=headers)


@router.get(OPENAPI, include_in_schema=False)
def openapi_json(request: Request) -> Response:
    """The OpenAPI document."""
    encoded: EncodedDocument = request.app.state.openapi
    return json_response(encoded.read())


@router.get("/docs", include_in_schema=False)
def api_docs() -> Response:
    """The interactive documentation: every route, with examples that can be sent from the page."""
    page = get_swagger_ui_html(
        openapi_url=OPENAPI,
        title="Urquhart API",
        swagger_js_url=f"{ASSETS}/swagger-ui-bundle.js",
        swagger_css_url=f"{ASSETS}/swagger-ui.css",
        swagger_favicon_url=f"{ASSETS}/favicon.png",
        swagger_ui_parameters={"docExpansion": "list", "defaultModelsExpandDepth": -1, "tryItOutEnabled": True},
    )
    page.headers["Content-Security-Policy"] = page_policy(bytes(page.body).decode())
    return page


@router.get(
    "/problems/{slug}",
    operation_id="getProblem",
    summary="Explain a type of problem",
    responses={
        200: {
            "content": {
                JSON: {
                    "schema": {"type": "object"},
                    "example": {"type": "/problems/gone", "title": "Gone", "status": 410, "about": "No longer kept."},
                },
                HTML: {"schema": {"type": "string"}, "example": "<!doctype html>"},
            }
        },
        **problems(404, 406),
    },
    response_class=Response,
)
def problem_page(
    slug: Annotated[str, Path(description="Last part of the problem's type.", examples=["gone"])], accept: Accept = None
) -> Response:
    """Explains a type of problem. The `type` of every problem document is a link to this route."""
    kind = PROBLEM_TYPES.get(slug)
    if kind is None:
        raise NotFound("kind of problem", slug[:100])
    media_type = choose(accept, [JSON, HTML])
    headers = {"Vary": "Accept"}
    if media_type == HTML:
        return _html(html_pages.problem_html(kind.title, kind.status, kind.about))
    about = {"type": f"/problems/{kind.slug}", "title": kind.title, "status": kind.status, "about": kind.about}
    return json_response(about, headers=headers)


def _html(page: str) -> Response:
    headers = {"Vary": "Accept", "Content-Security-Policy": page_policy(page)}
    return Response(page, media_type=HTML, headers=headers)
