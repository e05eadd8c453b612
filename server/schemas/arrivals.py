"""Bodies of submaps as they come in: stored, and looked up in the same breath where that is asked for."""

from typing import Any, Literal

from pydantic import ConfigDict, Field

from server.schemas.common import Answer
from server.schemas.queries import QueryAnswer, QueryInput, QueryOptions
from server.schemas.submaps import SubmapInput, SubmapLinks

_EXAMPLES: list[Any] = SubmapInput.model_config["json_schema_extra"]["examples"]  # type: ignore[index,assignment]


class ArrivingSubmap(SubmapInput):
    """A submap to store."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [*_EXAMPLES, {**_EXAMPLES[0], "session": "monday", "query": {"exclude": {"session": "monday"}}}]
        }
    )

    query: QueryOptions | None = Field(
        None, description="Ask first where else it was seen, and how: {} as usual. It does not find itself."
    )

    def question(self) -> QueryInput:
        """The query to ask before this is stored."""
        options = self.query or QueryOptions()
        members = {name: getattr(self, name) for name in ("xy", "ids", "landmarks", "frame_id", "stamp")}
        # What is checked already is not checked again.
        return QueryInput.model_construct(
            _fields_set=set(options.model_fields_set),
            **members,
            **{name: getattr(options, name) for name in QueryOptions.model_fields},
            submap_id=None,
            store=False,
        )


class SubmapReceipt(Answer):
    """What became of a submap that was sent."""

    id: str
    collection: str
    outcome: Literal["created", "replaced", "unchanged"]
    counts: dict[str, int] = Field(description="Landmarks, triangles, polygons kept and discarded.")
    etag: str
    revision: int = Field(description="The collection's, at the submap's last write.")
    links: SubmapLinks
    query: QueryAnswer | None = Field(
        None, description="Where else it was seen, before it was stored; not there unless asked for."
    )
