"""A page of stored queries."""

from pydantic import Field

from server.schemas.common import Answer
from server.schemas.queries import QueryLinks
from urquhart import Verdict

QUERY_PAGE_EXAMPLE = {
    "queries": [
        {
            "id": "17",
            "created": "2026-05-04T09:30:00Z",
            "verdict": "matched",
            "reason": "verified",
            "landmark_count": 80,
            "revision": 12,
            "milliseconds": 11.2,
            "submap_id": "p7",
            "inlier_count": 71,
            "confidence": 1.0,
            "links": {
                "self": "/v1/collections/plots/queries/17",
                "collection": "/v1/collections/plots",
                "explanation": "/v1/collections/plots/queries/17/explanation",
            },
        }
    ]
}


class StoredQuery(Answer):
    """A stored query, as in a list."""

    id: str = Field(description="Id of the stored query.")
    created: str = Field(description="When the query was answered.")
    verdict: Verdict = Field(description="The outcome.")
    reason: str = Field(description="Why this verdict, as a stable word: one of those of an answer.")
    landmark_count: int = Field(description="Number of landmarks in the query.")
    revision: int = Field(description="Revision of the collection that was searched.")
    milliseconds: float = Field(description="How long the search took, in milliseconds.")
    submap_id: str | None = Field(description="Submap of the first candidate. Null if there is no candidate.")
    inlier_count: int | None = Field(description="Pairs of landmarks of the first candidate. Null if there is none.")
    confidence: float | None = Field(description="Confidence of the first candidate. Null if there is no candidate.")
    links: QueryLinks = Field(description="Paths that belong to the query.")


class QueryPage(Answer):
    """A page of stored queries, newest first."""

    queries: list[StoredQuery] = Field(description="The queries of the page.")
    next: str | None = Field(None, description="Cursor of the next page. The last page does not have this member.")
