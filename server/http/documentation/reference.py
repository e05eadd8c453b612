"""The OpenAPI document as a Markdown page: operations with parameters, bodies, answers and errors, then all types."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import orjson

from server.problem_types import PROBLEM_TYPES

_METHODS = ("get", "put", "post", "patch", "delete")
_REFERENCE: Final = "#/components/schemas/"
_BEYOND: Final = 1e8
"""Bounds of this size only keep numbers finite, so the page leaves them out."""
_BOUNDS: Final = {
    "minimum": " from",
    "exclusiveMinimum": " above",
    "maximum": " up to",
    "exclusiveMaximum": " below",
}
"""Words for the bounds of numbers, in the order in which they are written."""
_SHORT: Final = 100
"""Characters of an object that is written on one line."""
_HEAD = """\
# API reference

This page is generated from the service's OpenAPI document by `urquhart reference > docs/api.md`. The
[guides](guides.md) show how the calls are used together. Every running service has the same reference under `/docs`,
where you can try the calls.

- A transform `submap_T_query` takes points of the query to the submap: p_submap = R(yaw) p_query + (x, y). Metres,
  radians, counter-clockwise; x east and y north if the frame is geographic.
- Bodies and answers are JSON. Requests may be compressed with gzip (`Content-Encoding`), and answers are if you accept
  it (`Accept-Encoding`). Unknown members, and unknown or repeated query parameters, are refused. Null for an optional
  member of a body is the same as leaving it out; only in a PATCH it removes the member.
- If the service has keys, send one: `Authorization: Bearer urq_...`. Each operation names the scope that the key needs.
  A collection that the key may not see is answered like one that does not exist.
- A request with an `Idempotency-Key` is carried out once. A repetition with the same key gets the first answer, with
  the header `Idempotency-Replayed: true`. Queries need a key only with `store`; other queries change nothing.
- Lists come in pages: `limit` is the size of a page, `next` of one page is the `cursor` of the following one. The last
  page has no `next`.
- Resources with an `ETag` support `If-Match` and `If-None-Match`.
- Times are in RFC 3339 form. Answers are in UTC.
- Every answer has an `X-Request-Id`, which the log has, too. You can send your own.
- Errors are `application/problem+json` ([Problem](#problem)); [their types](#problems) are at the end.
"""


def reference(document: Mapping[str, Any]) -> str:
    """The page, in Markdown, of an OpenAPI document."""
    parts = (_HEAD, *_contents(document), *_operations(document), *_types(document), *_problems())
    return "\n".join(parts).rstrip() + "\n"


def _contents(document: Mapping[str, Any]) -> Iterator[str]:
    yield "| operation | what it does | scope |"
    yield "| --- | --- | --- |"
    for path, method, operation in _walk(document):
        name = operation["operationId"]
        yield f"| [`{method.upper()} {path}`](#{name.lower()}) | {operation['summary']} | {_scope(operation)} |"
    yield ""


def _operations(document: Mapping[str, Any]) -> Iterator[str]:
    shown: dict[str, str] = {}
    for tag in document["tags"]:
        yield f"## {tag['name'].capitalize()}\n\n{tag['description']}\n"
        for path, method, operation in _walk(document):
            if tag["name"] in operation["tags"]:
                name = operation["operationId"]
                yield f"### {name}\n"
                yield f"`{method.upper()} {path}` · scope: {_scope(operation)}\n"
                yield from _operation(document, operation, shown)


def _operation(document: Mapping[str, Any], operation: Mapping[str, Any], shown: dict[str, str]) -> Iterator[str]:
    """One operation. `shown`: the examples on the page so far, each with the id of its operation; adds to it."""
    yield f"{_text(operation.get('description', operation['summary']))}\n"
    parameters = [one for one in operation.get("parameters", []) if one["in"] != "path"]
    if parameters:
        yield "| parameter | in | type | meaning |"
        yield "| --- | --- | --- | --- |"
        for one in parameters:
            yield f"| `{one['name']}` | {one['in']} | {_type(one['schema'])} | {_text(one.get('description', ''))} |"
        yield ""
    name = operation["operationId"]
    for media_type, content in operation.get("requestBody", {}).get("content", {}).items():
        yield f"Body, `{media_type}`{_named(content)}"
        yield from _example(document, content, name, shown)
    for status, response in operation["responses"].items():
        if int(status) < 400:
            yield f"**{status}** {_text(response['description'])}\n"
            for media_type, content in response.get("content", {}).items():
                yield f"`{media_type}`{_named(content)}"
                yield from _example(document, content, name, shown)
    refused = [status for status in operation["responses"] if int(status) >= 400]
    yield f"Refused with {', '.join(refused)}.\n"


def _types(document: Mapping[str, Any]) -> Iterator[str]:
    yield "## Types\n"
    yield "The bodies and answers, and the objects in them, by name.\n"
    requested = _bodies(document)
    for name, schema in sorted(document["components"]["schemas"].items()):
        yield f"### {name}\n"
        yield f"{_text(schema['description'])}\n"
        yield "| member | type | meaning |"
        yield "| --- | --- | --- |"
        for member, about in schema["properties"].items():
            mark = " (required)" if name in requested and member in schema.get("required", ()) else ""
            default = _default(about) if name in requested else ""
            meaning = about.get("description") or _resolved(document, about)["description"]
            yield f"| `{member}`{mark} | {_type(about)}{default} | {_text(meaning)} |"
        yield ""


def _bodies(document: Mapping[str, Any]) -> set[str]:
    """Names of the types that requests consist of: those of the bodies, and of their members at any depth."""
    schemas = document["components"]["schemas"]
    found: set[str] = set()
    open_ = [
        name
        for _, _, operation in _walk(document)
        for content in operation.get("requestBody", {}).get("content", {}).values()
        for name in _references(content["schema"])
    ]
    while open_:
        name = open_.pop()
        if name not in found:
            found.add(name)
            open_ += _references(schemas[name])
    return found


def _references(node: Any) -> Iterator[str]:
    """Names of all types that a schema refers to."""
    if isinstance(node, Mapping):
        if isinstance(reference := node.get("$ref"), str):
            yield reference.removeprefix(_REFERENCE)
        for inner in node.values():
            yield from _references(inner)
    elif isinstance(node, list):
        for inner in node:
            yield from _references(inner)


def _example(
    document: Mapping[str, Any], content: Mapping[str, Any], name: str, shown: dict[str, str]
) -> Iterator[str]:
    """The example of a body or answer, or where on the page it is already."""
    schema = _resolved(document, content.get("schema", {}))
    example = content.get("example", (schema.get("examples") or [None])[-1])
    if example is None:
        yield ""
        return
    text = f"```\n{example.rstrip()}\n```" if isinstance(example, str) else f"```json\n{_json(example)}\n```"
    if text in shown:
        yield f"(example: see [{shown[text]}](#{shown[text].lower()}))\n"
    else:
        shown[text] = name
        yield f"\n{text}\n"


def _json(value: Any, indent: str = "") -> str:
    """JSON over several lines, except for objects and lists that are short or have no objects in them."""
    inner = indent + "  "
    if isinstance(value, dict) and value:
        flat = "{" + ", ".join(f"{_json(name)}: {_json(member)}" for name, member in value.items()) + "}"
        if indent and len(flat) <= _SHORT and "\n" not in flat:
            return flat
        members = (f"{inner}{_json(name)}: {_json(member, inner)}" for name, member in value.items())
        return "{\n" + ",\n".join(members) + f"\n{indent}}}"
    if isinstance(value, list):
        if any(isinstance(one, dict) for one in value):
            return "[\n" + ",\n".join(f"{inner}{_json(one, inner)}" for one in value) + f"\n{indent}]"
        return f"[{', '.join(_json(one) for one in value)}]"
    return orjson.dumps(value).decode()


def _problems() -> Iterator[str]:
    yield "## Problems\n"
    yield "The `type` of a problem is `/problems/<slug>`. GET that path to read the explanation given here.\n"
    yield "| slug | status | title | meaning |"
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
    name = schema.get("$ref", "").removeprefix(_REFERENCE)
    return document["components"]["schemas"][name] if name else schema


def _named(content: Mapping[str, Any]) -> str:
    """A link to the type of a body or answer, if it has a name."""
    schema = content.get("schema", {})
    if lines := schema.get("x-line"):
        return f", on each line a {' or '.join(map(_type, lines))}"
    return f": {_type(schema)}" if "$ref" in schema else ""


def _type(schema: Mapping[str, Any]) -> str:
    """A type in a few words, with links to those that have a table."""
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(_type(one) for one in schema["anyOf"] if one.get("type") != "null"))
    if "$ref" in schema:
        name = str(schema["$ref"]).removeprefix(_REFERENCE)
        return f"[{name}](#{name.lower()})"
    if "enum" in schema or "const" in schema:
        return ", ".join(f"`{value}`" for value in schema.get("enum", [schema.get("const")]))
    if schema.get("prefixItems"):
        return f"[{', '.join(_type(one) for one in schema['prefixItems'])}]"
    if schema.get("type") == "array":
        size = f" of {schema['minItems']}" if schema.get("minItems") == schema.get("maxItems", 0) else ""
        return f"list{size}: {_type(schema.get('items', {}))}"
    if isinstance(values := schema.get("additionalProperties"), Mapping):
        return f"object: {_type(values)} by name"
    return f"{schema.get('format') or schema.get('type', 'any')}{_bounds(schema)}"


def _bounds(schema: Mapping[str, Any]) -> str:
    """What a number lies between, without bounds that only keep it finite."""
    limits = {name: schema[name] for name in _BOUNDS if abs(schema.get(name, math.inf)) < _BEYOND}
    if limits.keys() == {"minimum", "maximum"}:
        return f" from {limits['minimum']:,.10g} to {limits['maximum']:,.10g}"
    return " and".join(f"{mark} {limits[name]:,.10g}" for name, mark in _BOUNDS.items() if name in limits)


def _default(schema: Mapping[str, Any]) -> str:
    default = schema.get("default")
    return "" if default in (None, [], {}) or "const" in schema else f", default `{orjson.dumps(default).decode()}`"


def _text(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
