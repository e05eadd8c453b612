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

    id: str | None = Field(description="The submap's id; null where a POST stored nothing.")
    collection: str
    outcome: Literal["created", "replaced", "unchanged", "not_stored"] = Field(
        description="`not_stored`: the submap was asked about, and too few trees, or trees on one line, make no submap."
    )
    reason: str | None = Field(None, description="Why nothing was stored: the `reason` of `query`; null otherwise.")
    detail: str | None = Field(None, description="Why nothing was stored, in a sentence; null otherwise.")
    counts: dict[str, int] = Field(description="Landmarks, triangles, polygons kept and discarded of what is stored.")
    etag: str | None = Field(description="Entity tag of what is stored under the id now; null where nothing is.")
    revision: int = Field(
        description="The collection's revision at the submap's last write; where there is none, its revision now."
    )
    cleared: list[str] = Field(
        default_factory=list,
        description="Optional members that the submap had before this write and has no more, e.g. `session`, "
        "`map_pose`, or `dbh` of its landmarks: a PUT replaces the whole submap. PATCH keeps what it does not name.",
    )
    links: SubmapLinks | None = Field(description="Where to go from the submap; null where there is none.")
    query: QueryAnswer | None = Field(
        None,
        description="Where else the submap was seen, among all that was stored before it; not there unless asked for.",
    )
