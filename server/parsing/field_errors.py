"""Validation errors in sentences that say what to do; of JSON, with pointers (RFC 6901) to the members at fault."""

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from server.errors import InvalidBody

_MOST = 20
_SENTENCES: Mapping[str, str] = {
    "missing": "is required",
    "extra_forbidden": "is not a field of this request; check its spelling or leave it out",
    "float_type": "must be a number, not {given}",
    "float_parsing": "must be a number",
    "int_type": "must be a whole number, not {given}",
    "int_parsing": "must be a whole number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "string_type": "must be a string",
    "list_type": "must be an array",
    "tuple_type": "must be an array",
    "dict_type": "must be an object",
    "model_type": "must be an object",
    "model_attributes_type": "must be an object",
    "finite_number": "must be a finite number",
    "int_from_float": "must be a whole number",
    "greater_than": "must be above {gt:,.10g}",
    "greater_than_equal": "must be at least {ge:,.10g}",
    "less_than": "must be below {lt:,.10g}",
    "less_than_equal": "must be at most {le:,.10g}",
    "literal_error": "must be {expected}",
    "string_too_long": "must have at most {max_length} characters",
    "string_pattern_mismatch": "must be of visible ASCII characters, without spaces",  # the only pattern in the schemas
}

_RENAMED: Mapping[str, str] = {
    "dbh": "dbh is given in centimetres as dbh_cm: 0.31 m is 31",
    "height": "height is given in metres as height_m: 18.5 m is 18.5",
}
"""Members of a landmark as versions before 0.2.0 called them."""


def pointer(parts: Sequence[str | int]) -> str:
    """The JSON pointer of a path into a document."""
    return "".join(f"/{_escape(str(part))}" for part in parts)


def field_problems(found: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The entries for `errors`, at most the first few. Values of the caller are not repeated."""
    entries = []
    for one in _with_whole_tuples(found)[:_MOST]:
        source, *parts = one["loc"]
        entry: dict[str, Any] = {"code": one["type"], "detail": sentence(one)}
        if source == "body":
            entry = {"pointer": pointer(parts)} | entry
        else:
            entry = {"parameter": str(parts[0]) if parts else str(source)} | entry
        entries.append(entry)
    return entries


def _with_whole_tuples(found: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The errors, with one that names a tuple in place of those that name each entry which it lacks."""
    whole: list[Mapping[str, Any]] = []
    for one in found:
        *place, last = one["loc"]
        if one["type"] != "missing" or not isinstance(last, int):
            whole.append(one)
        elif whole and whole[-1]["loc"] == tuple(place):
            whole[-1]["ctx"]["min_length"] = last + 1
        else:
            short = {"actual_length": last, "min_length": last + 1}
            whole.append({"type": "too_short", "loc": tuple(place), "ctx": short})
    return whole


def invalid_body(error: ValidationError) -> InvalidBody:
    """The error for an invalid body that the framework did not read."""
    entries = field_problems([{**one, "loc": ("body", *one["loc"])} for one in error.errors(include_url=False)])
    return InvalidBody(describe(entries), entries)


def describe(entries: Sequence[Mapping[str, Any]]) -> str:
    """The `detail` of a problem with these `errors`: where and what, or how many."""
    if len(entries) > 1:
        return f"{len(entries)} values are wrong; `errors` lists each with its place."
    where = entries[0].get("pointer") or entries[0].get("parameter")
    return f"{where}: {entries[0]['detail']}" if where else str(entries[0]["detail"])


def sentence(error: Mapping[str, Any]) -> str:
    """What is wrong with one value, in a few words. `error`: an entry of `ValidationError.errors()`."""
    kind, context = error["type"], error.get("ctx") or {}
    if kind == "missing" and tuple(error["loc"]) == ("body",):
        return "a body is required: send a JSON object"
    if kind == "extra_forbidden" and "landmarks" in error["loc"][-3:-2] and error["loc"][-1] in _RENAMED:
        return _RENAMED[error["loc"][-1]]
    if kind in _SENTENCES:
        return _SENTENCES[kind].format(**context, given=_json_type(error.get("input")))
    if kind in ("too_short", "string_too_short") and context["min_length"] == 1:
        return "must not be empty"
    if (kind == "too_long" and context.get("field_type") == "Tuple") or kind == "too_short":
        return (
            f"must have {context.get('max_length', context.get('min_length'))} entries, not {context['actual_length']}"
        )
    if kind == "value_error" and "error" in context:
        return str(context["error"])
    message: str = error["msg"]
    return message[:1].lower() + message[1:]


def _json_type(value: object) -> str:
    """What a value of JSON is, with its article."""
    if value is None:
        return "null"
    kinds = ((bool, "a boolean"), (str, "a string"), (list | tuple, "an array"), (Mapping, "an object"))
    return next((name for kind, name in kinds if isinstance(value, kind)), "another type")


def _escape(part: str) -> str:
    short = part if len(part) <= 100 else f"{part[:100]}..."
    return short.replace("~", "~0").replace("/", "~1")
