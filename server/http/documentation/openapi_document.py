"""The OpenAPI document: as the framework makes it of the routes, plus types, problems and scopes it does not know."""

import threading
from typing import Any

import orjson
from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from server.http.admission.request_admission import ALWAYS_ANSWERED
from server.http.responses import problems
from server.schemas.common import Problem
from server.schemas.constraints import ConstraintList
from server.schemas.files.coregistrations import PlotRow
from server.schemas.jobs import LineResult
from server.schemas.submaps import NamedSubmap
from server.security.operation_scopes import SCOPES


class EncodedDocument:
    """The document as bytes of JSON, made at the first request for it and kept."""

    def __init__(self, app: FastAPI) -> None:
        self._app = app
        self._lock = threading.Lock()
        self._made: bytes | None = None

    def read(self) -> bytes:
        """The document. The first call takes 0.6 s, so this is for threads and not for the event loop."""
        with self._lock:
            if self._made is None:
                self._made = orjson.dumps(openapi_document(self._app))
            return self._made


def openapi_document(app: FastAPI) -> dict[str, Any]:
    """The document, made once. Errors are problems, and every operation names the scope that a key needs."""
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title, version=app.version, description=app.description, routes=app.routes, tags=app.openapi_tags
        )
        schemas = document["components"]["schemas"]
        for model in (Problem, ConstraintList, LineResult, NamedSubmap, PlotRow):
            schema = model.model_json_schema(ref_template="#/components/schemas/{model}", mode="serialization")
            schemas.update(schema.pop("$defs", {}))
            schemas[model.__name__] = schema
        for path, operations in document["paths"].items():
            for operation in operations.values():
                _plain_answers(operation)
                _guarded(operation)
                if path not in ALWAYS_ANSWERED:
                    _may_be_refused(operation)
        document["components"]["securitySchemes"] = {
            "key": {"type": "http", "scheme": "bearer", "description": "An API key: urq_<id>_<secret>."}
        }
        for unused in ("HTTPValidationError", "ValidationError"):
            schemas.pop(unused, None)
        app.openapi_schema = document
    return app.openapi_schema


def _plain_answers(operation: dict[str, Any]) -> None:
    """Replace what the framework says of itself: remove its validation errors, which the service never sends."""
    for status, response in list(operation["responses"].items()):
        content = response.get("content", {})
        if response["description"] == "Successful Response":
            response["description"] = "Success."
        reference = content.get("application/json", {}).get("schema", {}).get("$ref", "")
        if reference.endswith("/HTTPValidationError"):
            del content["application/json"]
            if not content:
                del operation["responses"][status]


def _guarded(operation: dict[str, Any]) -> None:
    """Add the scope that the operation needs, and the answers to callers without it."""
    scope = SCOPES[operation["operationId"]]
    if scope is None:
        operation["security"] = []
        return
    operation["security"] = [{"key": []}, {}]
    operation["x-scope"] = scope.value
    responses = operation["responses"] | {str(status): said for status, said in problems(401, 403).items()}
    operation["responses"] = dict(sorted(responses.items()))


def _may_be_refused(operation: dict[str, Any]) -> None:
    """Add the answers to requests that come while the service has too much to do."""
    slow = (408,) if "requestBody" in operation else ()
    often = (429,) if SCOPES[operation["operationId"]] is not None else ()
    refusals = {str(status): said for status, said in problems(*slow, *often, 503).items()}
    operation["responses"] = dict(sorted((refusals | operation["responses"]).items()))
