"""Bodies of several queries at once."""

from typing import Annotated, Any

from pydantic import ConfigDict, Field

from server.schemas.common import Answer, Body
from server.schemas.queries import QueryAnswer, QueryInput

_EXAMPLE: Any = QueryInput.model_config["json_schema_extra"]["examples"][0]  # type: ignore[index]


class BatchInput(Body):
    """Several queries, each as it would be asked alone."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"queries": [_EXAMPLE, {"submap_id": "p7"}]}]})

    # Read one by one, so that one that is wrong does not spoil the others.
    queries: list[dict[str, Any]] = Field(min_length=1, description="Bodies of `query`.")
    timeout_ms: Annotated[int, Field(ge=1, le=3_600_000, strict=True)] | None = Field(
        None,
        description="Milliseconds within which the whole batch is needed; at most, and by default, the limit "
        "`batch_seconds`. Queries that were not begun by then have the problem `out-of-time` in their place.",
    )


class BatchProblem(Answer):
    """In the place of an answer: why there is none."""

    problem: dict[str, Any] = Field(description="The problem that the query would have been answered with alone.")


class BatchAnswer(Answer):
    """An answer or a problem for each query, in their order."""

    results: list[QueryAnswer | BatchProblem]
