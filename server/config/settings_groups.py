"""Groups of settings for the index, jobs, the log and snapshots."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class IndexSettings(BaseModel):
    """Settings of the index: what it keeps in memory, and when it writes segments."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cache_mb: int = Field(64, ge=0, description="Memory for recently read features, in MB. 0: none.")
    flush_submaps: int = Field(
        2_000,
        ge=1,
        description="Most submaps that changed since the last segment and stay in memory. If there are more, they are "
        "written to a segment.",
    )
    memory_submaps: int = Field(
        5_000,
        ge=1,
        description="Most changed submaps that a query reads into memory. If there are more, it writes them to a "
        "segment first.",
    )
    block_submaps: int = Field(20_000, ge=1, description="Most submaps in a segment when it is first written.")
    maintenance_seconds: float = Field(
        1.0, gt=0, le=3600, description="Seconds between two checks for segments to write or to merge."
    )


class JobSettings(BaseModel):
    """Settings of jobs."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    processes: int | None = Field(
        None,
        ge=1,
        le=256,
        description="Processes that describe imported submaps, including the service itself. By default one for each "
        "core.",
    )
    slice_seconds: float = Field(
        5.0,
        gt=0,
        le=3600,
        description="Seconds after which a job gives way to a waiting job of another key or collection.",
    )
    keep_days: float = Field(7.0, gt=0, le=3650, description="Days for which the results of finished jobs are kept.")
    keep_jobs: int = Field(
        10_000, ge=1, description="Finished jobs that stay in the list. The oldest are deleted first."
    )


class LogSettings(BaseModel):
    """Settings of the log."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal["text", "json"] = Field(
        "text", description="`text`: lines for people. `json`: one JSON object on each line."
    )
    level: Literal["debug", "info", "warning", "error"] = Field(
        "info",
        description="Lowest level that is written. The line of a request has the level `info`, or `warning` if its "
        "status is 500 or more.",
    )


class SnapshotSettings(BaseModel):
    """Settings of snapshots."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    keep: int = Field(
        5,
        ge=0,
        description="Snapshots that are kept. A new one deletes the oldest beyond this number. 0: all are kept.",
    )
