"""Parameters of routes: the service, the caller, preconditions, the idempotency key, ids and pages."""

import hashlib
from collections.abc import Iterator
from contextlib import AsyncExitStack, contextmanager
from typing import Annotated

from fastapi import Depends, Header, Path, Query, Request
from pydantic import BeforeValidator

from server.errors import DeadlineExceeded
from server.http.authorization import get_principal, get_visitor
from server.http.direct_call import UNTIL_ANSWERED
from server.http.responses import entity_tags
from server.resources.idempotency import IdempotencyKey
from server.resources.preconditions import Preconditions
from server.schemas.common import ResourceId, check_digits
from server.security.principal import Principal
from server.service_parts import Service
from urquhart import Budget
from urquhart.budget import DeadlinePassed


# `async`, because the framework would send a plain function to a thread and back.
async def get_service(request: Request) -> Service:
    """The service that the app was built with."""
    service: Service = request.app.state.service
    return service


async def get_preconditions(
    if_match: Annotated[
        str | None, Header(description="Proceed only if the entity tag is one of these; * for any.")
    ] = None,
    if_none_match: Annotated[
        str | None, Header(description="Proceed only if the entity tag is none of these; * if nothing must exist.")
    ] = None,
) -> Preconditions:
    """If-Match and If-None-Match."""
    return Preconditions(entity_tags(if_match), entity_tags(if_none_match))


IdempotencyKeyHeader = Annotated[
    str | None,
    Header(
        description="A name of your choice for this request. A repetition with the same name is not carried out "
        "again: it gets the first answer.",
        min_length=1,
        max_length=255,
        pattern=r"^[\x21-\x7e]+$",
    ),
]


def idempotency_key_of(service: Service, caller: Principal, key: str | None, sent: bytes) -> IdempotencyKey | None:
    """The idempotency key of a request, bound to all that was sent with it; None without one."""
    if key is None:
        return None
    return IdempotencyKey(caller.id, key, hashlib.sha256(sent).hexdigest(), service.settings.idempotency_hours)


async def get_idempotency_key(
    request: Request,
    caller: Annotated[Principal, Depends(get_principal)],
    service: Annotated[Service, Depends(get_service)],
    idempotency_key: IdempotencyKeyHeader = None,
) -> IdempotencyKey | None:
    """The idempotency key of this request; None without the header.

    If another attempt of the request is in progress in this process, this one waits for it. Raises StillRunning.
    """
    if idempotency_key is None:
        return None  # most queries have none, so their bodies are not copied
    conditions = [request.headers.get(name) for name in ("if-match", "if-none-match")]
    about = "".join(f"\n{condition}" for condition in conditions if condition is not None)
    sent = f"{request.url.query}{about}\n".encode() + await request.body()
    turn = service.repetitions.turn((caller.id, request.method, request.url.path, idempotency_key))
    # Not by `yield`: to open and close a dependency costs every request without a key a tenth of a millisecond.
    open_until_answered: AsyncExitStack = request.scope[UNTIL_ANSWERED]
    await open_until_answered.enter_async_context(turn)
    return idempotency_key_of(service, caller, idempotency_key, sent)


@contextmanager
def in_time(service: Service, budget: Budget) -> Iterator[Budget]:
    """What a request may use of its budget for a picture, or for other work whose answer is all or nothing.

    Raises DeadlineExceeded where the work is left because the limit `query_seconds` has passed.
    """
    seconds = service.limits.query_seconds
    try:
        yield budget.within(seconds - budget.elapsed)
    except DeadlinePassed:
        raise DeadlineExceeded(
            "query_seconds", seconds, "Ask for application/json, or try again when the service is less busy."
        ) from None


ServiceDep = Annotated[Service, Depends(get_service)]


PrincipalDep = Annotated[Principal, Depends(get_principal)]


IdempotencyKeyDep = Annotated[IdempotencyKey | None, Depends(get_idempotency_key)]


VisitorDep = Annotated[Principal, Depends(get_visitor)]


PreconditionsDep = Annotated[Preconditions, Depends(get_preconditions)]


Accept = Annotated[str | None, Header(description="Media types that you accept.")]


IfNoneMatch = Annotated[str | None, Header(description="Entity tag of the copy that you have; 304 if it is current.")]


CollectionId = Annotated[
    ResourceId,
    Path(
        description="Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'.",
        examples=["plots"],
        alias="collection",
    ),
]


PageLimit = Annotated[
    int | None, BeforeValidator(check_digits), Query(description="Entries on the page, at most 1000.", examples=[100])
]


PageCursor = Annotated[str | None, Query(description="`next` of the previous page.")]


SubmapId = Annotated[
    ResourceId,
    Path(
        description="Id of the submap: 1 to 128 letters, digits, '.', '_', '~', '-'.", examples=["p7"], alias="submap"
    ),
]
