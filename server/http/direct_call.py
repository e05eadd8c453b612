"""Endpoints called without the framework's solver of dependencies, which costs more than all layers before it.

Of a query of 2 ms over the library, the solver took 0.2 ms (`python -m benchmarks.service --only waterfall`). What an
endpoint takes is known at the start, so its arguments are put together from a short list. A request of which anything
is invalid or unusual is left to the framework, which says what is wrong with it.
"""

import inspect
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from types import UnionType
from typing import Annotated, Any, Final, Union, cast, get_args, get_origin

from fastapi import Request, Response
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from server.platform.request_threads import RequestThreads

UNTIL_ANSWERED: Final = "fastapi_inner_astack"
"""Where the framework keeps, in the scope of a request, what is to be closed after the answer: an AsyncExitStack."""
_UNSUPPORTED: Final = (
    "websocket_param_name",
    "http_connection_param_name",
    "response_param_name",
    "background_tasks_param_name",
    "security_scopes_param_name",
    "cookie_params",
    "concurrency",
)
"""What no endpoint of this service takes. One that does is left to the framework."""


class _Unsuitable(Exception):
    """An endpoint or a request that only the framework can handle."""


class _Parameter:
    """A parameter in the path, the query or a header of a request."""

    def __init__(self, taken: Any) -> None:
        """`taken`: a field of the framework. Raises _Unsuitable for a list or a model."""
        if _is_several(taken.field_info.annotation):
            raise _Unsuitable
        self.name: str = taken.name
        self._alias: str = taken.validation_alias or taken.alias
        self._validate = taken.validate
        self._default = taken.get_default()

    def read(self, given: Mapping[str, str]) -> Any:
        """Its value. Raises _Unsuitable for an invalid one."""
        value = given.get(self._alias)
        if value is None:
            if self._default is PydanticUndefined:
                raise _Unsuitable
            return deepcopy(self._default)
        read, errors = self._validate(value)
        if errors:
            raise _Unsuitable
        return read


def _is_several(annotation: Any) -> bool:
    """Whether a parameter of this type takes more than one value of the request."""
    kind = get_origin(annotation) or annotation
    if kind in (Annotated, Union, UnionType):
        return any(map(_is_several, get_args(annotation)))
    return inspect.isclass(kind) and issubclass(kind, BaseModel | list | tuple | set | frozenset)


@dataclass(frozen=True, slots=True)
class _Step:
    """A function to call, and where its arguments are from.

    Attributes:
        call: a dependency, or the endpoint itself.
        path, query, headers: parameters of the request.
        request: the argument that is the request itself, if there is one.
        needs: the steps before it whose results it takes, and the names of those arguments.
        opened: the same as a context manager, if it is open until the answer is sent.
    """

    call: Callable[..., Any]
    path: Sequence[_Parameter]
    query: Sequence[_Parameter]
    headers: Sequence[_Parameter]
    request: str | None
    needs: Sequence[tuple[int, str]]
    opened: Callable[..., Any] | None

    def read(self, request: Request) -> dict[str, Any]:
        """The arguments that are parameters. Raises _Unsuitable."""
        values: dict[str, Any] = {}
        for parameter in self.path:
            values[parameter.name] = parameter.read(request.path_params)
        if self.query:
            if request.scope["query_string"]:
                raise _Unsuitable
            for parameter in self.query:
                values[parameter.name] = parameter.read({})
        for parameter in self.headers:
            values[parameter.name] = parameter.read(request.headers)
        if self.request is not None:
            values[self.request] = request
        return values


class DirectCall:
    """An endpoint with the dependencies that it needs, in an order in which they can be called."""

    def __init__(self, steps: Sequence[_Step], body: Any) -> None:
        self._steps, self._body = steps, body
        self._in_thread = not inspect.iscoroutinefunction(steps[-1].call)

    @staticmethod
    def of(route: APIRoute) -> "DirectCall | None":
        """The endpoint of a route; None if only the framework can call it."""
        if inspect.isgeneratorfunction(route.endpoint) or inspect.isasyncgenfunction(route.endpoint):
            return None
        returned = inspect.signature(route.endpoint).return_annotation
        if not (inspect.isclass(returned) and issubclass(returned, Response)):
            return None
        if route.dependant.body_params not in ([], [route.body_field]):
            return None
        steps: list[_Step] = []
        try:
            _add(route.dependant, steps)
        except _Unsuitable:
            return None
        return DirectCall(steps, route.body_field)

    async def __call__(self, request: Request, sent: Any = None) -> Response | None:
        """The endpoint's answer; None if the framework must handle the request. `sent`: JSON of the body."""
        try:
            arguments = [step.read(request) for step in self._steps]
        except _Unsuitable:
            return None
        if self._body is not None:
            model, errors = self._body.validate(sent, loc=("body",))
            if errors:
                return None
            arguments[-1][self._body.name] = model
        stack: AsyncExitStack = request.scope[UNTIL_ANSWERED]
        results: list[Any] = []
        for step, values in zip(self._steps[:-1], arguments, strict=False):
            for number, name in step.needs:
                values[name] = results[number]
            if step.opened is not None:
                results.append(await stack.enter_async_context(step.opened(**values)))
            else:
                results.append(await step.call(**values))
        endpoint, values = self._steps[-1], arguments[-1]
        for number, name in endpoint.needs:
            values[name] = results[number]
        if self._in_thread:
            threads: RequestThreads = request.app.state.threads
            return cast(Response, await threads.run(partial(endpoint.call, **values)))
        return await cast(Awaitable[Response], endpoint.call(**values))


def _add(dependant: Dependant, steps: list[_Step]) -> int:
    """Add a function after all that it needs, unless it is there already; its place. Raises _Unsuitable."""
    known = [step.call for step in steps]
    if dependant.call in known:
        return known.index(dependant.call)
    if dependant.call is None or any(getattr(dependant, name, None) for name in _UNSUPPORTED):
        raise _Unsuitable
    needs = [(_add(other, steps), other.name or "") for other in dependant.dependencies]
    opened = None
    if any(not name for _, name in needs):
        raise _Unsuitable
    if inspect.isasyncgenfunction(dependant.call):
        if dependant.scope == "function":
            raise _Unsuitable  # what it opens would be closed before the answer is sent
        opened = asynccontextmanager(cast(Callable[..., AsyncIterator[Any]], dependant.call))
    elif dependant.name is not None and not inspect.iscoroutinefunction(dependant.call):
        raise _Unsuitable  # a plain function as a dependency runs in a thread
    path, query, headers = (
        [_Parameter(taken) for taken in fields]
        for fields in (dependant.path_params, dependant.query_params, dependant.header_params)
    )
    steps.append(_Step(dependant.call, path, query, headers, dependant.request_param_name, needs, opened))
    return len(steps) - 1
