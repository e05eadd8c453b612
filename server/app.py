"""The app: `create_app(settings)` builds it from its parts. Nothing is built at import."""

import asyncio
import logging
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

import anyio.to_thread
from fastapi import FastAPI
from fastapi.staticfiles import StaticFiles

from server.config import settings_loading
from server.config.settings import Settings
from server.errors import DomainError
from server.http import problems
from server.http.admission.attempts_in_progress import AttemptsInProgress
from server.http.admission.fair_queue import FairQueue
from server.http.admission.job_waits import JobWaits
from server.http.admission.middleware import AdmissionMiddleware
from server.http.admission.readiness import SHUTDOWN, ReadinessChecks
from server.http.admission.request_admission import AdmissionState
from server.http.admission.revocation import watch_keys
from server.http.body_limit import BodyLimit
from server.http.browser_protection import KnownHosts, SafeAnswers
from server.http.compression import DeflateAnswers, InflateRequests
from server.http.documentation.openapi_document import EncodedDocument, openapi_document
from server.http.request_logging import RequestLogging
from server.index.live_indexes import LiveIndexes
from server.index.maintenance import Maintenance
from server.jobs.folder import JobFolder
from server.jobs.runner import Runner
from server.jobs.running_job import JobContext
from server.jobs.types.job_types import JOB_TYPES
from server.maps.session_poses import SessionPoses
from server.observability import kernel_progress, logs
from server.observability.metrics import Metrics
from server.observability.metrics_exchange import MetricsExchange
from server.parsing import strict_json
from server.platform.precedence import Precedence
from server.platform.request_threads import RequestThreads
from server.platform.thread_limits import pin_threads
from server.platform.version import service_version
from server.routes import (
    collections,
    html_pages,
    imports,
    jobs,
    queries,
    snapshots,
    stands,
    submap_writes,
    submaps,
    system,
)
from server.routes.console import console_keys, console_sessions
from server.routes.console import pages as console_pages
from server.routes.gis import coregistrations, exports, features, landmark_columns
from server.routes.maps import constraint_routes, map_routes, session_routes
from server.security.authenticator import Authenticator, check_exposure
from server.security.rate_limit import RateLimiter
from server.service_parts import JobRuntime, Service
from server.snapshots.snapshot_folder import SnapshotFolder
from server.stem_maps.uploads import UploadReader
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date

_SPARE_THREADS = 8
_WARMING = 1.0
"""Seconds that the shutdown waits for kernels that are still being loaded."""
_log = logging.getLogger(__name__)
# The framework tries one route after the other, so the most frequent and most urgent ones come first.
_ROUTERS = (
    queries.router,
    submap_writes.router,
    submaps.router,
    exports.router,
    features.router,
    landmark_columns.router,
    stands.router,
    collections.router,
    jobs.router,
    map_routes.router,
    constraint_routes.router,
    session_routes.router,
    coregistrations.router,
    imports.router,
    snapshots.router,
    system.router,
    html_pages.router,
    console_sessions.router,
    console_keys.router,
    console_pages.router,
)
_TAGS = [
    {"name": "collections", "description": "Submaps that share a configuration."},
    {"name": "submaps", "description": "Tree positions in one rigid frame: what is stored and found."},
    {"name": "exports", "description": "What a collection holds, as files for GIS."},
    {"name": "features", "description": "OGC API - Features: what QGIS and GDAL read from a running service."},
    {"name": "stands", "description": "What stem maps were stored: listed, read, moved and deleted as a whole."},
    {"name": "queries", "description": "Where is this? A verdict, candidates, and the evidence for each."},
    {
        "name": "jobs",
        "description": "Long work: imports, constraints, rebuilding an index. Jobs survive restarts of the service.",
    },
    {"name": "coregistrations", "description": "A season's plots placed in a map: files in, tables and a report out."},
    {"name": "maps", "description": "Submaps of several drives as one consistent map of trees."},
    {"name": "snapshots", "description": "Copies of the whole database, made while the service runs."},
    {"name": "system", "description": "Probes, metrics, limits."},
    {"name": "pages", "description": "Pages for people, also available as JSON."},
]
_DESCRIPTION = """\
Place recognition for forests: tree positions in, a verified pose out.

Transforms are `submap_T_query`: p_submap = R(yaw) p_query + t, in metres and radians, counter-clockwise.
Errors are `application/problem+json` (RFC 9457), and their `type` leads to an explanation."""


def create_app(settings: Settings, exchange: MetricsExchange | None = None, *, create_database: bool = True) -> FastAPI:
    """The service over the database in the settings. The database is opened when the app starts.

    With an `exchange`, this is one process of several, whose metrics are merged. `create_database`: create the file if
    it does not exist; false for a process that uses what another one has opened.
    """
    service = _build_service(settings, exchange, create_database=create_database)
    app = FastAPI(
        title="Urquhart",
        version=service_version(),
        description=_DESCRIPTION,
        openapi_tags=_TAGS,
        lifespan=_lifespan,
        redirect_slashes=False,
        openapi_url=None,  # the framework would make and encode the document in the event loop
        docs_url=None,
        redoc_url=None,
    )
    # The documentation's scripts come from an installed package, because a forest has no internet.
    app.mount(html_pages.ASSETS, StaticFiles(packages=[("fastapi_offline", "static")]), name="assets")
    app.state.service = service
    app.state.authenticator = Authenticator(settings, service.database)
    app.state.routers = _ROUTERS
    # A few more than there are places, so that probes and metrics always find a thread.
    app.state.threads = RequestThreads(settings.limits.concurrent_requests + _SPARE_THREADS)
    for router in _ROUTERS:
        app.include_router(router)
    problems.install(app)
    _add_middleware(app, service)
    app.openapi = lambda: openapi_document(app)  # type: ignore[method-assign]
    app.state.openapi = EncodedDocument(app)
    return app


def _build_service(settings: Settings, exchange: MetricsExchange | None, *, create_database: bool) -> Service:
    database = Database(
        settings.database_path,
        busy_timeout=settings.busy_timeout_seconds,
        read_only=settings.database_read_only,
        create=create_database,
    )
    metrics = Metrics(settings.metrics_collections)
    indexes = LiveIndexes(database, metrics, settings.index)
    precedence = Precedence()
    context = JobContext(settings, database, indexes, metrics, JobFolder(database), precedence)
    fair_queue, readiness = FairQueue(settings.limits), ReadinessChecks(database.trouble)
    metrics.in_flight.set_function(lambda: fair_queue.running)
    metrics.queued.set_function(lambda: fair_queue.waiting)
    waits = JobWaits(database, settings.limits, lambda: readiness.stopping)
    metrics.job_waits.set_function(lambda: waits.count)
    return Service(
        settings,
        database,
        indexes,
        metrics,
        readiness,
        Maintenance(database, indexes, metrics),
        JobRuntime(context.folder, Runner(context, JOB_TYPES)),
        RateLimiter(settings.limits.requests_per_second),
        exchange,
        fair_queue,
        precedence,
        SnapshotFolder(database.path),
        AttemptsInProgress(),
        waits,
        UploadReader(),
        SessionPoses(database),
    )


def _add_middleware(app: FastAPI, service: Service) -> None:
    settings = service.settings
    # The middleware added last is the outermost.
    app.add_middleware(InflateRequests, limit=settings.limits.body_bytes)
    app.add_middleware(DeflateAnswers)
    app.add_middleware(BodyLimit, limit=settings.limits.body_bytes)
    app.state.shared = AdmissionState(
        settings.limits, service.fair_queue, service.metrics, service.readiness, service.precedence
    )
    app.add_middleware(AdmissionMiddleware, shared=app.state.shared)
    app.add_middleware(
        KnownHosts,
        allowed=settings.host_names,
        authenticator=app.state.authenticator,
        everywhere=settings.host in ("0.0.0.0", "::", "[::]"),
    )
    app.add_middleware(SafeAnswers)
    app.add_middleware(RequestLogging, metrics=service.metrics)


def create_app_from_env() -> FastAPI:
    """The app with settings from file and environment: `uvicorn --factory server.app:create_app_from_env`.

    Raises Misconfigured.
    """
    settings = settings_loading.load()
    logs.configure(settings.log)
    return create_app(settings)


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    service: Service = app.state.service
    try:
        await anyio.to_thread.run_sync(bring_up_to_date, service.database)
        await anyio.to_thread.run_sync(check_exposure, service.settings, service.database)
    except BaseException:
        service.database.dispose()
        raise
    # Bodies are read on the event loop, which must not wait for a compiler.
    with kernel_progress.reports(_log.info):
        await anyio.to_thread.run_sync(strict_json.warm_up)
    service.readiness.passed("migrations")
    # Those of other work: keys, uploads, compression.
    threads = anyio.to_thread.current_default_thread_limiter()
    threads.total_tokens = service.settings.limits.concurrent_requests + _SPARE_THREADS
    if service.exchange is not None:
        service.exchange.start(service.metrics)
    await anyio.to_thread.run_sync(_clean_up_snapshots, service)
    stop, warm = threading.Event(), threading.Event()
    service.maintenance.start(warm)
    warm_up = threading.Thread(target=_warm_up, args=(service, stop, warm), name="warm-up", daemon=True)
    warm_up.start()
    service.jobs.runner.start()
    key_watch = asyncio.create_task(watch_keys(app.state.shared, app.state.authenticator))
    try:
        yield
    finally:
        key_watch.cancel()
        service.readiness.report(SHUTDOWN, "the service is stopping")
        stop.set()
        # Maintenance first, which also stops the job that rewrites an index.
        await anyio.to_thread.run_sync(service.maintenance.stop)
        await anyio.to_thread.run_sync(service.jobs.runner.stop)
        await anyio.to_thread.run_sync(service.uploads.close)
        await anyio.to_thread.run_sync(service.session_poses.close)
        await anyio.to_thread.run_sync(warm_up.join, _WARMING)
        app.state.threads.stop()
        await anyio.to_thread.run_sync(service.database.dispose)
        if service.exchange is not None:
            await anyio.to_thread.run_sync(service.exchange.stop)


def _clean_up_snapshots(service: Service) -> None:
    """Remove what was left of a snapshot whose process ended while creating it."""
    try:
        if not service.database.read_only:
            service.snapshots.clean_up()
    except OSError as error:
        _log.warning("left-over snapshots cannot be removed: %s", error)


def _report_kernels(service: Service, progress: str) -> None:
    _log.info("%s", progress)
    service.readiness.report("kernels", progress)


def _warm_up(service: Service, stop: threading.Event, warm: threading.Event) -> None:
    """Compile the kernels and open the indexes while requests are already answered, if slowly."""
    try:
        pin_threads()
        service.readiness.report("kernels", "loading")
        load_the_others = kernel_progress.warm_up(partial(_report_kernels, service), alone=service.exchange is None)
        service.readiness.passed("kernels")
        service.readiness.report("index", "catching up")
        for collection_id, done, total in service.indexes.warm_up():
            # Only in the log, because everybody can read the readiness, and not everybody may know the collections.
            _log.debug("caught up %d of %d collections, last %s", done, total, collection_id)
            if stop.is_set():
                return
        service.readiness.passed("index")
    except Exception as error:  # noqa: BLE001  whatever it is: without a report nobody would know why it is not ready
        # Stays not ready and says why. Queries try again by themselves.
        _log.exception("the warm-up failed")
        why = str(error) if isinstance(error, DomainError) else "the warm-up failed; the log says why"
        service.readiness.report("kernels" if service.readiness.is_open("kernels") else "index", why)
        return
    finally:
        warm.set()
    # Beside the first queries. One that needs these kernels waits for the compiler.
    load_the_others()
