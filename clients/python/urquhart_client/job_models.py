"""Jobs, their results, and snapshots."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from pydantic import Field

from urquhart_client.poses import Model, Transform


class Job(Model):
    """A job. `state` is accepted, running, successful, failed or dismissed. `problem` says why it failed."""

    id: str
    type: str
    collection: str
    state: str
    total: int | None = None
    done: int = 0
    counts: Mapping[str, int] = {}
    eta_seconds: float | None = None
    created: datetime
    started: datetime | None = None
    finished: datetime | None = None
    problem: Mapping[str, Any] | None = None

    @property
    def is_finished(self) -> bool:
        """Whether the job has ended."""
        return self.finished is not None

    @property
    def is_successful(self) -> bool:
        """Whether the job has ended successfully."""
        return self.state == "successful"


class JobLine(Model):
    """The result of one line of an import. `problem` is the problem document if it was refused."""

    line: int
    id: str | None = None
    outcome: str
    revision: int | None = None
    problem: Mapping[str, Any] | None = None


class Constraint(Model):
    """A constraint that a collection keeps: `transform` is from_T_to, p_from = R(yaw) p_to + t.

    `kind` is match or odometry; `state` is active, stale (a submap changed) or refused (`refused` says why the map
    `refused_by` left it out). `job` found it, None if it was posted. `rank`, `inlier_count`, `rms` (metres) and
    `confidence` are those of a match.
    """

    id: str
    kind: str
    source: str
    job: str | None = None
    state: str
    refused: str | None = None
    refused_by: str | None = None
    from_id: str = Field(alias="from")
    to_id: str = Field(alias="to")
    from_revision: int
    to_revision: int
    transform: Transform
    rank: int | None = None
    inlier_count: int | None = None
    rms: float | None = None
    confidence: float | None = None
    created: datetime


class SnapshotCollection(Model):
    """A collection as it is in a snapshot."""

    id: str
    revision: int
    submaps: int


class Snapshot(Model):
    """A copy of the whole database."""

    name: str
    created: datetime
    bytes: int
    sha256: str
    collections: Sequence[SnapshotCollection] = ()


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of an upload or import.

    Attributes:
        phase: `sending` (bytes of the file) or `storing` (lines).
        done, total: of it; total None where it is not known.
        eta_seconds: about how long it still takes.
    """

    phase: str
    done: int
    total: int | None
    eta_seconds: float | None = None
