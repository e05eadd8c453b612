"""Types that several resources share."""

import math
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import chain
from typing import Annotated, Any, Final

from pydantic import (
    AfterValidator,
    AwareDatetime,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    PlainSerializer,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from server.platform.precedence import give_way


@dataclass(frozen=True, slots=True)
class Formerly:
    """What versions before 0.2.0 called a member of a stored answer, and the words in it that have changed since."""

    name: str | None = None
    words: Mapping[str, str] = field(default_factory=dict)


RENAMED_REASONS: Final = Formerly(
    words={
        "runner_up_too_close": "rival_too_close",
        "no_votes": "no_proposal",
        "nothing_left": "all_filtered_out",
    }
)
"""Reasons of verdicts and refusals that have another name since."""
_RFC3339 = re.compile(r"\d{4}-\d{2}-\d{2}[Tt ]\d{2}:\d{2}:\d{2}(\.\d+)?([Zz]|[+-]\d{2}:\d{2})")
_DEPTH = 32
_POINTS_AT_ONCE = 1_000
_ID_MARKS = frozenset("._~-")
_ID_RULE = "1 to 128 letters, digits, '.', '_', '~' or '-'; not '.' or '..'"


def check_id(value: str) -> str:
    """Refuse what cannot be the id of a collection or submap."""
    if not 1 <= len(value) <= 128:
        raise ValueError(f"an id has {_ID_RULE}; this one has {len(value)} characters")
    if value in {".", ".."}:
        raise ValueError(f"an id has {_ID_RULE}")
    for character in value:
        if character not in _ID_MARKS and unicodedata.category(character)[0] not in "LMN":
            raise ValueError(f"an id has {_ID_RULE}; {character!a} is not among them")
    if not unicodedata.is_normalized("NFC", value):
        raise ValueError("an id must be in Unicode's composed form (NFC), so that equal ids are equal bytes")
    return value


def _check_text(value: str) -> str:
    if any(unicodedata.category(character) in {"Cc", "Cs"} for character in value):
        raise ValueError("must not contain control characters")
    return value


def _check_depth(value: dict[str, Any]) -> dict[str, Any]:
    level: list[Any] = [value]
    for _ in range(_DEPTH):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, dict | list)
        ]
        if not level:
            return value
    raise ValueError(f"must not be nested more than {_DEPTH} deep")


def _check_stamp(value: object) -> object:
    if isinstance(value, datetime):
        return value
    if not isinstance(value, str) or _RFC3339.fullmatch(value) is None:
        raise ValueError("must be a string in RFC 3339 form with an offset, such as '2026-05-04T09:30:00Z'")
    return value


def _in_utc(value: datetime) -> datetime:
    """The moment in UTC, as it is stored: one moment is one content, whatever offset it was written with.

    Refuses what is a moment in its own time zone, and none in UTC, where years end with 9999.
    """
    try:
        return value.astimezone(UTC)
    except OverflowError as error:
        raise ValueError("must be in the years 1 to 9999 in UTC, too") from error


def check_digits(value: object) -> object:
    """Refuse what Python would read as a whole number and a caller hardly means as one: `1_0`, `+1`, `1.0`."""
    if isinstance(value, str) and not (value.isascii() and value.removeprefix("-").isdigit()):
        raise ValueError("must be a whole number, in digits")
    return value


def write_stamp(value: datetime) -> str:
    """RFC 3339 in UTC, microseconds only where there are any."""
    return value.astimezone(UTC).isoformat().replace("+00:00", "Z")


ResourceId = Annotated[str, AfterValidator(check_id)]
Label = Annotated[str, Field(min_length=1, max_length=128), AfterValidator(_check_text)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
# Beyond any place on Earth in any projection, and far from where sums and squares overflow.
Metres = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e8, le=1e8)]
STAMPED: Final = (
    "When the trees were observed, in RFC 3339 form with an offset. Stored to the microsecond; further digits are cut "
    "off."
)
FRAME_NAME: Final = "Name of the frame that the landmarks' coordinates are in."
SESSION: Final = "The drive, flight or survey that the submap belongs to."
NEXT: Final = "Cursor of the next page. The last page does not have this member."
Stamp = Annotated[
    AwareDatetime,
    BeforeValidator(_check_stamp),
    AfterValidator(_in_utc),
    PlainSerializer(write_stamp, return_type=str, when_used="json"),
]
Point = tuple[Number, Number]


def _take_points(value: Any, check: ValidatorFunctionWrapHandler) -> Any:
    """Points as they were sent, where they are what `check` accepts; it says what is wrong where they are not.

    A thousand at a time: in between, others may have the interpreter, which one long check would keep from them.
    """
    if isinstance(value, list) and all(
        _are_points(value[start : start + _POINTS_AT_ONCE]) for start in range(0, len(value), _POINTS_AT_ONCE)
    ):
        return value
    return check(value)


def _are_points(points: list[Any]) -> bool:
    give_way()
    if set(map(type, points)) != {list} or set(map(len, points)) != {2}:
        return False
    numbers = list(chain.from_iterable(points))
    return set(map(type, numbers)) <= {int, float} and all(map(math.isfinite, numbers))


Points = Annotated[
    list[Point],
    Field(fail_fast=True),
    WrapValidator(_take_points),
    PlainSerializer(lambda points: points, return_type=Any),
]
Free = Annotated[dict[str, Any], AfterValidator(_check_depth)]


class Body(BaseModel):
    """Base of request bodies. Unknown members are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class DefaultedBody(Body):
    """Base of request bodies with members that have a default. There, null is the same as leaving the member out."""

    @model_validator(mode="before")
    @classmethod
    def _without_nulls(cls, sent: Any) -> Any:
        if not isinstance(sent, dict):
            return sent
        if None not in sent.values():
            return sent
        optional = {name for name, member in cls.model_fields.items() if not member.is_required()}
        return {name: value for name, value in sent.items() if value is not None or name not in optional}

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        made = handler(schema)
        properties = handler.resolve_ref_schema(made)["properties"]
        for own, member in cls.model_fields.items():
            name = member.alias or own
            about = properties[name]
            if not member.is_required() and "anyOf" not in about:
                known = {key: about.pop(key) for key in ("title", "description", "default") if key in about}
                properties[name] = {"anyOf": [about, {"type": "null"}], "description": member.description} | known
        return made


Members = dict[str, Any]
"""An answer, or a part of one, as JSON values by name. What most requests ask for is built so, because a model of it
would take several times as long; a test holds it to the model."""


class Answer(BaseModel):
    """Base of answers."""

    model_config = ConfigDict(extra="forbid", ser_json_inf_nan="null")


class Counts(Answer):
    """How much a collection contains."""

    submaps: int = Field(description="Number of submaps.")
    landmarks: int = Field(description="Number of landmarks in all submaps. A tree counts in each of them.")
    polygons: int = Field(description="Number of interior Urquhart polygons in all submaps.")


class FieldProblem(Answer):
    """One fault in a request."""

    pointer: str | None = Field(None, description="JSON pointer (RFC 6901) to the member of the body that is at fault.")
    parameter: str | None = Field(
        None, description="Name of the path, query or header parameter that is at fault, if it is not in the body."
    )
    code: str = Field(description="The type of fault, as a stable word for programs.")
    detail: str = Field(description="What is wrong and what to do.")
    indices: list[int] | None = Field(
        None, description="Positions of the landmarks at fault in the list that was sent, counted from 0."
    )


class Problem(Answer):
    """An error: a problem document of RFC 9457 (`application/problem+json`)."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="The type of problem, as a path. GET it for an explanation.")
    title: str = Field(description="The type of problem in a few words.")
    status: int = Field(description="HTTP status of the answer.")
    detail: str = Field(description="What happened to this request and what to do.")
    request_id: str | None = Field(
        None, description="Id of the request. The header X-Request-Id and the log have the same."
    )
    errors: list[FieldProblem] | None = Field(None, description="The faults of the request, one entry each.")


PROBLEM_EXAMPLE: dict[str, Any] = {
    "type": "/problems/not-found",
    "title": "Not found",
    "status": 404,
    "detail": "There is no collection 'plots' here.",
    "request_id": "0c5f4d1e7a334a6b",
}


_OPTIONAL = ("next", "query")


def to_json(answer: BaseModel) -> bytes:
    """The answer as JSON. The members `next` and `query` are left out if they are None."""
    empty = {name for name in _OPTIONAL if getattr(answer, name, "") is None}
    return answer.model_dump_json(exclude=empty or None, by_alias=True).encode()
