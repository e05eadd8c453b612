"""Routes of probes, metrics and limits."""

from fastapi import APIRouter, Response

from server.http.authorization import GuardedRoute
from server.http.documentation import published_limits
from server.http.responses import json_response, problems
from server.observability import database_gauges
from server.observability.metrics import Metrics
from server.routes.dependencies import PrincipalDep, ServiceDep
from server.schemas.system import LIMITS_EXAMPLE, READINESS_EXAMPLE, LimitsAnswer, Liveness, Load, Readiness

router = APIRouter(route_class=GuardedRoute, tags=["system"])
# The probes run on the event loop: they never block, and must answer when all threads are busy with queries.


@router.get(
    "/livez",
    operation_id="getLiveness",
    summary="Is the process alive?",
    response_model=Liveness,
    responses={200: {"content": {"application/json": {"example": {"status": "ok"}}}}, **problems()},
)
async def livez() -> Response:
    """Answers 200 as long as the process can answer."""
    return json_response(Liveness(status="ok"))


@router.get(
    "/readyz",
    operation_id="getReadiness",
    summary="Is the service ready?",
    response_model=Readiness,
    responses={
        200: {"content": {"application/json": {"example": READINESS_EXAMPLE}}},
        **problems(503),
    },
)
async def readyz(service: ServiceDep) -> Response:
    """Answers 503 while migrations, kernels or the index are not ready, while the database file is not the one that was
    opened, and when the service is about to stop; `check` says which. Requests that do not need the database are still
    answered.

    `load` shows how busy the process is. Saturation alone does not cause 503, because every caller still gets its
    share.
    """
    service.readiness.require()
    queue = service.fair_queue
    load = Load(in_flight=queue.running, capacity=queue.places, queued=queue.waiting, saturated=queue.is_saturated)
    return json_response(Readiness(status="ok", checks=dict(service.readiness.states()), load=load))


@router.get(
    "/metrics",
    operation_id="getMetrics",
    summary="Metrics for Prometheus",
    response_class=Response,
    responses={
        200: {
            "description": "Prometheus text format.",
            "content": {
                "text/plain": {
                    "schema": {"type": "string"},
                    "example": 'urquhart_query_verdicts_total{verdict="matched"} 12.0',
                }
            },
        },
        **problems(),
    },
)
def metrics(service: ServiceDep, caller: PrincipalDep) -> Response:
    """Returns the metrics of all processes of this service. They name collections, so the key must see them all."""
    caller.require_all()
    told = database_gauges.exposition(service.database, service.metrics, service.exchange)
    return Response(told, headers={"Content-Type": Metrics.content_type})


@router.get(
    "/v1/limits",
    operation_id="getLimits",
    summary="List the limits",
    response_model=LimitsAnswer,
    responses={200: {"content": {"application/json": {"example": LIMITS_EXAMPLE}}}, **problems()},
)
def limits(service: ServiceDep) -> Response:
    """Returns limits on sizes, times and rates, retention periods, versions. Problems use these names in `limit`."""
    answer = published_limits.limits(service.settings)
    return Response(answer.model_dump_json(by_alias=True), media_type="application/json")
