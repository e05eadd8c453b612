"""Answers that earlier versions stored: they lack members that this version writes, or have others.

A member with a former name (`Formerly`) gets its new one. A missing member gets the value that means none: its default,
null, or an empty list. A member without such a value is left out, so that the rest can still be read. Future members of
answers need no entry here.
"""

import types
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from server.errors import Gone
from server.schemas.common import Formerly

Model = TypeVar("Model", bound=BaseModel)
_ABSENT = object()


def completed(model: type[BaseModel], members: Mapping[str, Any], *, known_only: bool = False) -> dict[str, Any]:
    """The members of a stored `model`, completed at any depth.

    `known_only`: without members that the model does not have.
    """
    known = dict(members)
    for name, field in model.model_fields.items():
        for earlier in field.metadata:
            if isinstance(earlier, Formerly):
                _renew(known, name, earlier)
    done = {} if known_only else dict(known)
    for name, field in model.model_fields.items():
        if name in known:
            done[name] = _completed(field.annotation, known[name], known_only)
        elif (value := _absent(field)) is not _ABSENT:
            done[name] = value
    return done


def read_older(model: type[Model], members: Mapping[str, Any], what: str) -> Model:
    """A stored `model`, whichever version wrote it. Raises Gone, which calls it `what`, if too much is missing."""
    try:
        return model.model_validate(completed(model, members, known_only=True))
    except ValidationError as error:
        raise gone(what) from error


def gone(what: str) -> Gone:
    """The error for something that another version stored and that cannot be shown."""
    return Gone(
        f"{what} was stored by another version of the service, without what is needed here. Send the query again."
    )


def _renew(members: dict[str, Any], name: str, earlier: Formerly) -> None:
    """Give a member of an earlier version its present name and its present word."""
    if name not in members and earlier.name in members:
        members[name] = members.pop(earlier.name)
    if isinstance(word := members.get(name), str):
        members[name] = earlier.words.get(word, word)


def _completed(annotation: Any, value: Any, known_only: bool) -> Any:
    for kind in _alternatives(annotation):
        inner = get_args(kind)
        if isinstance(kind, type) and issubclass(kind, BaseModel) and isinstance(value, Mapping):
            return completed(kind, value, known_only=known_only)
        if get_origin(kind) is list and isinstance(value, list):
            return [_completed(inner[0], one, known_only) for one in value]
        if get_origin(kind) is dict and isinstance(value, Mapping):
            return {name: _completed(inner[1], one, known_only) for name, one in value.items()}
    return value


def _absent(field: FieldInfo) -> Any:
    """The value of a member that means none; `_ABSENT` if there is no such value."""
    if not field.is_required():
        return field.get_default(call_default_factory=True)
    kinds = _alternatives(field.annotation)
    if types.NoneType in kinds:
        return None
    if any(get_origin(kind) is list for kind in kinds):
        return []
    if any(get_origin(kind) is dict for kind in kinds):
        return {}
    return _ABSENT


def _alternatives(annotation: Any) -> list[Any]:
    """The types that a value may have."""
    if get_origin(annotation) is Annotated:
        return _alternatives(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        return [kind for one in get_args(annotation) for kind in _alternatives(one)]
    return [annotation]
