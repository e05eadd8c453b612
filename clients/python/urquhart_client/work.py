"""What the service says of long work: jobs, their results, snapshots."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from urquhart_client.poses import Model


class SessionSummary(Model):
    """A drive, a flight, a season: how much it left, and when."""

    session: str
    submaps: int
    landmarks: int = 0
    first: datetime | None = None
    last: datetime | None = None


class Job(Model):
    """Long work. `state` is accepted, running, successful, failed or dismissed; `problem` tells why it failed."""

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
        """Whether it is at its end."""
        return self.finished is not None

    @property
    def is_successful(self) -> bool:
        """Whether it did what it was to do."""
        return self.state == "successful"


class JobLine(Model):
    """What became of a line of an import; `problem` is the problem document where it was refused."""

    line: int
    id: str | None = None
    outcome: str
    revision: int | None = None
    problem: Mapping[str, Any] | None = None


class SnapshotCollection(Model):
    """A collection as it was when a snapshot was made."""

    id: str
    revision: int
    submaps: int


class Snapshot(Model):
    """The whole database as it was."""

    name: str
    created: datetime
    bytes: int
    sha256: str
    collections: Sequence[SnapshotCollection] = ()


@dataclass(frozen=True, slots=True)
class Progress:
    """How far something is.

    Attributes:
        phase: `sending` (bytes of the file) or `storing` (lines).
        done, total: of it; total None where it is not known.
        eta_seconds: about how long it still takes.
    """

    phase: str
    done: int
    total: int | None
    eta_seconds: float | None = None
