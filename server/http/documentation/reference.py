"""The OpenAPI document as a page to read: every operation with its parameters, bodies, answers and errors."""

from collections.abc import Iterator, Mapping
from typing import Any

import orjson

from server.problem_types import PROBLEM_TYPES

_METHODS = ("get", "put", "post", "patch", "delete")
_HEAD = """\
# API reference

Made from the service's OpenAPI document by `urquhart reference > docs/api.md`; a test holds this page to it. How the
routes are used together is told in [guides.md](guides.md); every service shows the same, to be tried out, at `/docs`.

- Transforms are `submap_T_query`: p_submap = R(yaw) p_query + t; metres, radians, counter-clockwise, x east, y north.
- Bodies and answers are JSON; gzip is read (`Content-Encoding`) and written (`Accept-Encoding`). Unknown members and
  unknown or repeated query parameters are refused.
- Where a service asks for keys: `Authorization: Bearer urq_...`. A collection that a key does not see is answered like
  one that is not there. The scope that an operation asks for stands in its line.
- A request that takes an `Idempotency-Key` can be sent again with the same key: it is done once, and answered as the
  first time (`Idempotency-Replayed: true`). A query takes one, too; it matters with `store`, because other queries
  change nothing and are answered again.
- Lists come in pages: `limit`, `cursor`, `next`; there is no `next` on the last page.
- What can be written over carries an `ETag`: `If-Match` and `If-None-Match` are honoured.
- Every answer has an `X-Request-Id`, the caller's where it sent a plain one; it stands in the log, too.
- Errors are `application/problem+json`; [their types](#problems) are at the end.
"""


def reference(document: Mapping[str, Any]) -> str:
    """The page, in Markdown, of an OpenAPI document."""
    return "\n".join([_HEAD, *_contents(document), *_operations(document), *_problems()]).rstrip() + "\n"


def _contents(document: Mapping[str, Any]) -> Iterator[str]:
    yield "| operation | | scope |"
    yield "| --- | --- | --- |"
    for path, method, operation in _walk(document):
        name = operation["operationId"]
        yield f"| [`{method.upper()} {path}`](#{name.lower()}) | {operation['summary']} | {_scope(operation)} |"
    yield ""


def _operations(document: Mapping[str, Any]) -> Iterator[str]:
    for tag in document["tags"]:
        yield f"## {tag['name'].capitalize()}\n\n{tag['description']}\n"
        for path, method, operation in _walk(document):
            if tag["name"] in operation["tags"]:
                yield from _operation(document, path, method, operation)


def _operation(document: Mapping[str, Any], path: str, method: str, operation: Mapping[str, Any]) -> Iterator[str]:
    yield f"### {operation['operationId']}\n"
    yield f"`{method.upper()} {path}` · scope: {_scope(operation)}\n"
    yield f"{operation['summary']}. {_text(operation.get('description', ''))}\n"
    parameters = [one for one in operation.get("parameters", []) if one["in"] != "path"]
    if parameters:
        yield "| parameter | in | type | |"
        yield "| --- | --- | --- | --- |"
        for one in parameters:
            yield f"| `{one['name']}` | {one['in']} | {_type(one['schema'])} | {_text(one.get('description', ''))} |"
        yield ""
    body = operation.get("requestBody")
    if body is not None:
        for media_type, content in body["content"].items():
            yield f"Body, `{media_type}`:\n"
            schema = _resolved(document, content["schema"])
            yield from _members(schema)
            yield from _example(content.get("example", (schema.get("examples") or [None])[-1]))
    for status, response in operation["responses"].items():
        if int(status) < 400:
            yield f"**{status}** {_text(response['description'])}\n"
            for media_type, content in response.get("content", {}).items():
                yield f"`{media_type}`, for example:\n"
                yield from _example(content.get("example"))
    refused = [status for status in operation["responses"] if int(status) >= 400]
    yield f"Refused with {', '.join(refused)}.\n"


def _members(schema: Mapping[str, Any]) -> Iterator[str]:
    if not schema.get("properties"):
        return
    yield "| member | type | |"
    yield "| --- | --- | --- |"
    needed = schema.get("required", [])
    for name, member in schema["properties"].items():
        mark = " (required)" if name in needed else ""
        yield f"| `{name}`{mark} | {_type(member)} | {_text(member.get('description', ''))} |"
    yield ""


def _example(example: Any) -> Iterator[str]:
    if example is None:
        return
    if isinstance(example, str):
        yield f"```\n{example.rstrip()}\n```\n"
    else:
        yield f"```json\n{orjson.dumps(example, option=orjson.OPT_INDENT_2).decode()}\n```\n"


def _problems() -> Iterator[str]:
    yield "## Problems\n"
    yield "`type` of a problem is `/problems/<slug>`, which the service answers with what stands here.\n"
    yield "| type | status | title | |"
    yield "| --- | --- | --- | --- |"
    for slug, kind in sorted(PROBLEM_TYPES.items()):
        yield f'| <a id="{slug}"></a>`{slug}` | {kind.status} | {kind.title} | {_text(kind.about)} |'


def _walk(document: Mapping[str, Any]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    for path, item in document["paths"].items():
        for method in _METHODS:
            if method in item:
                yield path, method, item[method]


def _scope(operation: Mapping[str, Any]) -> str:
    return str(operation.get("x-scope", "none"))


def _resolved(document: Mapping[str, Any], schema: Mapping[str, Any]) -> Mapping[str, Any]:
    name = schema.get("$ref", "").rsplit("/", 1)[-1]
    return document["components"]["schemas"][name] if name else schema


def _type(schema: Mapping[str, Any]) -> str:
    """A type in a word or two."""
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(_type(one) for one in schema["anyOf"] if one.get("type") != "null"))
    if "$ref" in schema:
        return str(schema["$ref"].rsplit("/", 1)[-1])
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items', {}))}"
    if schema.get("prefixItems"):
        return "pair"
    return str(schema.get("format") or schema.get("type", "any"))


def _text(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
