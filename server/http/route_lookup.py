"""The route of a path, also before the router has run."""

from collections.abc import Iterator
from typing import Any

from fastapi import FastAPI


def matched(app: FastAPI, path: str) -> tuple[str, dict[str, str]] | None:
    """Template of the route that serves the path, and the path's parameters as text. None if no route does.

    Needed for requests that are refused before routing (body too large, unknown encoding, overload).
    """
    for route in _routes(app):
        if (found := route.path_regex.match(path)) is not None:
            return route.path, {name: value for name, value in found.groupdict().items() if name != "path"}
    return None


def allowed_methods(app: FastAPI, path: str) -> set[str]:
    """The methods of the path. Every route answers HEAD like GET, and OPTIONS with this list."""
    methods = {
        method
        for route in _routes(app)
        if route.path_regex.match(path)
        for method in getattr(route, "methods", None) or ("GET",)  # mounted apps serve files
    }
    return methods | {"OPTIONS"} | ({"HEAD"} if "GET" in methods else set())


def _routes(app: FastAPI) -> Iterator[Any]:
    routers = getattr(app.state, "routers", ())
    for route in (*(route for router in routers for route in router.routes), *app.routes):
        if getattr(route, "path_regex", None) is not None:
            yield route
