"""Bodies of the job routes."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field, PlainSerializer

from server.schemas.common import Answer, write_stamp

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
JobState = Literal["accepted", "running", "successful", "failed", "dismissed"]


class JobLinks(Answer):
    """Where to go from a job."""

    self: str
    results: str
    errors: str
    collection: str


class JobAnswer(Answer):
    """Long work, and how far it is."""

    id: str
    kind: str = Field(description="import, reindex or constraints.")
    collection: str
    state: str = Field(
        description="`accepted`: waits for a turn, also between two turns. `running`: at work. `successful`, `failed` "
        "and `dismissed` are final."
    )
    total: int | None = Field(description="How much there is to do: lines, or submaps; null where it is not known.")
    done: int
    counts: dict[str, int] = Field(description="What became of it, by outcome.")
    eta_seconds: float | None = Field(description="About how long it will still take, by its pace so far.")
    dismissed: bool = Field(description="Whether somebody asked for its end.")
    created: _Written
    started: _Written | None
    finished: _Written | None
    problem: dict[str, Any] | None = Field(
        description="Why it failed, or why the operator ended it: a problem document."
    )
    links: JobLinks


class JobPage(Answer):
    """A page of jobs."""

    jobs: list[JobAnswer]
    next: str | None = Field(None, description="Cursor of the next page; not there on the last.")


JOB_EXAMPLE: dict[str, Any] = {
    "id": "01jz9k3v8xq7m2n4p5r6s7t8v9",
    "kind": "import",
    "collection": "plots",
    "state": "running",
    "total": 12000,
    "done": 4500,
    "counts": {"created": 4498, "refused": 2},
    "eta_seconds": 3.4,
    "dismissed": False,
    "created": "2026-05-04T09:30:00Z",
    "started": "2026-05-04T09:30:00.4Z",
    "finished": None,
    "problem": None,
    "links": {
        "self": "/v1/jobs/01jz9k3v8xq7m2n4p5r6s7t8v9",
        "results": "/v1/jobs/01jz9k3v8xq7m2n4p5r6s7t8v9/results",
        "errors": "/v1/jobs/01jz9k3v8xq7m2n4p5r6s7t8v9/errors",
        "collection": "/v1/collections/plots",
    },
}
