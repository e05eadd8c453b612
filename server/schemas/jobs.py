"""Bodies of the job routes."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field, PlainSerializer

from server.schemas.common import NEXT, Answer, write_stamp

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]
JobState = Literal["accepted", "running", "successful", "failed", "dismissed"]


class JobLinks(Answer):
    """Paths of a job, its results and its collection."""

    self: str = Field(description="Path of the job.")
    results: str = Field(description="Path of the job's results.")
    errors: str = Field(description="Path of the lines that the job refused.")
    files: str | None = Field(
        None, description="Path of the list of files that the job writes. Null for a type of job that writes none."
    )
    collection: str = Field(description="Path of the collection that the job works on.")


class JobAnswer(Answer):
    """A job: long work that goes on after the request that asked for it."""

    id: str = Field(description="Id of the job.")
    type: str = Field(description="What the job does: `import`, `reindex`, `constraints`, `map` or `coregistration`.")
    collection: str = Field(description="Id of the collection that the job works on.")
    state: str = Field(
        description="How far the job is. `accepted`: it waits for a turn, its first or its next one. `running`: it "
        "works. `successful`, `failed` and `dismissed` are final."
    )
    total: int | None = Field(description="Number of lines, submaps or plots to work on. Null while it is unknown.")
    done: int = Field(description="Number of lines, submaps or plots that were worked on.")
    counts: dict[str, int] = Field(description="Number of lines, submaps or plots by outcome.")
    eta_seconds: float | None = Field(
        description="Estimated seconds until the job ends, from its pace so far. Null while there is no estimate."
    )
    dismissed: bool = Field(description="Whether somebody dismissed the job. It may still have to stop.")
    created: _Written = Field(description="When the job was accepted.")
    started: _Written | None = Field(description="When the job began to work. Null before.")
    finished: _Written | None = Field(description="When the job ended. Null before.")
    problem: dict[str, Any] | None = Field(
        description="Why the job failed, or why the operator ended it: a problem document. Null otherwise."
    )
    links: JobLinks = Field(description="Paths of the job, its results and its collection.")


class LineResult(Answer):
    """The result of one line of an import, as a line of NDJSON. Members that do not apply are left out."""

    line: int = Field(description="Number of the line in the upload, counted from 1.")
    id: str | None = Field(None, description="Id of the submap. Left out if the line has none that can be used.")
    outcome: Literal["created", "replaced", "unchanged", "skipped", "refused"] = Field(
        description="What was done. `skipped`: the id was taken (`on_conflict=skip`), or another line was refused "
        "(`mode=all`)."
    )
    revision: int | None = Field(None, description="Revision of the collection at the last write of the submap.")
    problem: dict[str, Any] | None = Field(
        None, description="Why the line was refused: a problem document, shortened if very many lines are refused."
    )
    lines: int | None = Field(
        None, description="Number of refused lines that this one stands for, if they are only counted."
    )
    last_line: int | None = Field(
        None, description="Number of the last of the refused lines that this one stands for. `line` is the first."
    )


class JobPage(Answer):
    """A page of jobs."""

    jobs: list[JobAnswer] = Field(description="The jobs of the page, newest first.")
    next: str | None = Field(None, description=NEXT)


JOB_EXAMPLE: dict[str, Any] = {
    "id": "01jz9k3v8xq7m2n4p5r6s7t8v9",
    "type": "import",
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
        "files": None,
        "collection": "/v1/collections/plots",
    },
}
