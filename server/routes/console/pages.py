"""The console's files: one page for every address under /ui, and the scripts and styles that it loads."""

from functools import cache
from typing import Final

from fastapi import APIRouter, Request, Response

from server.console.built_files import BuiltFile, BuiltFiles, read_built_files
from server.errors import NotFound
from server.http.authorization import GuardedRoute
from server.http.browser_protection import CONSOLE
from server.http.responses import entity_tags, etag_header

router = APIRouter(route_class=GuardedRoute, include_in_schema=False)

PATH: Final = "/ui"
_FOREVER: Final = "public, max-age=31536000, immutable"
"""A file's name holds a hash of its contents, so what was loaded once stays right."""


@cache
def _built() -> BuiltFiles:
    return read_built_files()


@router.get(f"{PATH}/files/{{name}}")
def console_file(name: str, request: Request) -> Response:
    """A script, style or picture of the console."""
    file = _built().files.get(name)
    if file is None:
        raise NotFound("file of the console", name[:100])
    headers = {"Cache-Control": _FOREVER, **etag_header(file.etag)}
    return _unless_known(request, file, headers)


@router.get(PATH)
@router.get(f"{PATH}/{{page:path}}")
def console_page(request: Request) -> Response:
    """The page. Which part of the console it shows is up to its script, by the address."""
    page = _built().page
    # Asked for again each time, because it names the present files.
    headers = {"Cache-Control": "no-cache", "Content-Security-Policy": CONSOLE, **etag_header(page.etag)}
    return _unless_known(request, page, headers)


def _unless_known(request: Request, file: BuiltFile, headers: dict[str, str]) -> Response:
    """The file, or 304. A browser takes over the headers of a 304, so these must be the same, the policy above all."""
    tags = entity_tags(request.headers.get("if-none-match")) or ()
    if file.etag in tags:
        return Response(status_code=304, headers=headers)
    return Response(file.content, media_type=file.media_type, headers=headers)
