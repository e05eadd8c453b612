"""The parts of a running service, put together by `app` and used by the routes."""

import math
from dataclasses import dataclass

from server.config.settings import Limits, Settings
from server.http.admission.attempts_in_progress import AttemptsInProgress
from server.http.admission.fair_queue import FairQueue
from server.http.admission.job_waits import JobWaits
from server.http.admission.readiness import ReadinessChecks
from server.index.live_indexes import LiveIndexes
from server.index.maintenance import Maintenance
from server.jobs import queue
from server.jobs.folder import JobFolder
from server.jobs.runner import Runner
from server.maps.session_poses import SessionPoses
from server.observability.metrics import Metrics
from server.observability.metrics_exchange import MetricsExchange
from server.platform.precedence import Precedence
from server.queries.lookup import QueryContext
from server.resources.idempotency import IdempotencyKey, StoredResponse
from server.security.principal import Principal
from server.security.rate_limit import RateLimiter
from server.snapshots.snapshot_folder import SnapshotFolder
from server.stem_maps.uploads import UploadReader
from server.store.sqlite.database import Database


@dataclass(frozen=True, slots=True)
class JobRuntime:
    """Where jobs lie, and who does them."""

    folder: JobFolder
    runner: Runner


@dataclass(frozen=True, slots=True)
class Service:
    """The parts of a running service."""

    settings: Settings
    database: Database
    indexes: LiveIndexes
    metrics: Metrics
    readiness: ReadinessChecks
    maintenance: Maintenance
    jobs: JobRuntime
    rates: RateLimiter
    exchange: MetricsExchange | None
    fair_queue: FairQueue
    precedence: Precedence
    snapshots: SnapshotFolder
    repetitions: AttemptsInProgress
    waits: JobWaits
    uploads: UploadReader
    session_poses: SessionPoses

    def hand_back(self) -> None:
        """Let jobs and the maintenance of the index end soon; what they did not finish is resumed at the next start."""
        self.indexes.stopping.set()
        self.jobs.runner.hand_back()

    def accept_job(
        self, collection_id: str, caller: Principal, job: queue.NewJob, idempotency_key: IdempotencyKey | None
    ) -> StoredResponse:
        """Accept a job, unless the request was carried out before, and wake the runner. Raises as `queue.accept`."""
        response = queue.accept(self.database, collection_id, caller, job, idempotency_key, self.settings.limits)
        self.jobs.runner.wake()
        return response

    @property
    def limits(self) -> Limits:
        """The limits in force. While the kernels are still being compiled or loaded, queries have no deadline: the
        first ones wait for that.
        """
        if self.readiness.is_open("kernels"):
            return self.settings.limits.model_copy(update={"query_seconds": math.inf, "batch_seconds": math.inf})
        return self.settings.limits

    @property
    def queries(self) -> QueryContext:
        """What queries work with, under the limits in force."""
        return QueryContext(self.database, self.indexes, self.metrics, self.limits)
