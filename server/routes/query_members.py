"""Members of a model as query parameters of a route, which gets them as one argument."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any

from fastapi import Query, Response
from pydantic import BaseModel

from server.schemas.landmarks import StemMapOptions
from server.stem_maps.reading.options import ReadOptions

Route = Callable[..., Any]


def takes_members(
    model: type[BaseModel], argument: str, made: Callable[[dict[str, Any]], Any]
) -> Callable[[Route], Route]:
    """Give a route all members of `model` as query parameters; it gets what `made` makes of them as `argument`."""

    def decorate(route: Route) -> Route:
        signature = inspect.signature(route, eval_str=True)
        own = [one for one in signature.parameters.values() if one.name != argument]
        members = {
            name: inspect.Parameter(
                f"{argument}_{name}",
                inspect.Parameter.KEYWORD_ONLY,
                default=member.default,
                annotation=Annotated[
                    member.annotation,
                    *member.metadata,
                    Query(alias=name, description=member.description, examples=member.examples),
                ],
            )
            for name, member in model.model_fields.items()
        }

        def taken(given: dict[str, Any]) -> dict[str, Any]:
            known = {name: given.pop(parameter.name) for name, parameter in members.items()}
            return {**given, argument: made(known)}

        if inspect.iscoroutinefunction(route):

            @wraps(route)
            async def run(**given: Any) -> Response:
                response: Response = await route(**taken(given))
                return response

        else:

            @wraps(route)
            def run(**given: Any) -> Response:
                response: Response = route(**taken(given))
                return response

        del run.__wrapped__
        run.__signature__ = signature.replace(parameters=[*own, *members.values()])  # type: ignore[attr-defined]
        return run

    return decorate


def _read_options(members: dict[str, Any]) -> ReadOptions:
    lists = {name: tuple(filter(None, map(str.strip, (members[name] or "").split(",")))) for name in ("keep", "ignore")}
    return ReadOptions(**members | lists)


reads_files = takes_members(StemMapOptions, "options", _read_options)
"""Give a route what is known of a file of trees as query parameters; it gets them as `options`, a `ReadOptions`."""
