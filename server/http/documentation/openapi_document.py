"""The OpenAPI document: what the framework makes of the routes, and what it does not know."""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from server.http.admission.admission import ALWAYS_ANSWERED
from server.http.responses import problems
from server.schemas.common import Problem
from server.security.scopes import SCOPES


def openapi_document(app: FastAPI) -> dict[str, Any]:
    """The document, made once: errors are problems, and every operation says which scope a key needs."""
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title, version=app.version, description=app.description, routes=app.routes, tags=app.openapi_tags
        )
        schemas = document["components"]["schemas"]
        problem = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
        schemas.update(problem.pop("$defs", {}))
        schemas["Problem"] = problem
        for path, operations in document["paths"].items():
            for operation in operations.values():
                _only_problems(operation)
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


def _only_problems(operation: dict[str, Any]) -> None:
    """Leave out the framework's own description of a validation error: it is never sent."""
    for status, response in list(operation["responses"].items()):
        content = response.get("content", {})
        reference = content.get("application/json", {}).get("schema", {}).get("$ref", "")
        if reference.endswith("/HTTPValidationError"):
            del content["application/json"]
            if not content:
                del operation["responses"][status]


def _guarded(operation: dict[str, Any]) -> None:
    """Say which scope is asked for, and how a caller without it is answered."""
    scope = SCOPES[operation["operationId"]]
    if scope is None:
        operation["security"] = []
        return
    operation["security"] = [{"key": []}, {}]
    operation["x-scope"] = scope.value
    responses = operation["responses"] | {str(status): said for status, said in problems(401, 403).items()}
    operation["responses"] = dict(sorted(responses.items()))


def _may_be_refused(operation: dict[str, Any]) -> None:
    """Say how a request is answered when there is too much to do."""
    slow = (408,) if "requestBody" in operation else ()
    often = (429,) if SCOPES[operation["operationId"]] is not None else ()
    refusals = {str(status): said for status, said in problems(*slow, *often, 503).items()}
    operation["responses"] = dict(sorted((refusals | operation["responses"]).items()))
