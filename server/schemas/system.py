"""Bodies of the system routes."""

from typing import Any

from pydantic import Field

from server.schemas.common import Answer


class Liveness(Answer):
    """Answer of a process that is alive."""

    status: str = Field(description="Always `ok`.")


class Load(Answer):
    """How busy the answering process is."""

    in_flight: int = Field(description="Number of requests in progress.")
    capacity: int = Field(description="Number of requests that can be in progress at once.")
    queued: int = Field(description="Number of requests that wait for a place.")
    saturated: bool = Field(description="Whether all places are taken, so that another caller's request has to wait.")


class Readiness(Answer):
    """Answer of a process that has passed all checks."""

    status: str = Field(description="Always `ok`.")
    checks: dict[str, str] = Field(description="Result of each check, by its name.")
    load: Load = Field(description="How busy the process is.")


class Versions(Answer):
    """Versions of the running service."""

    service: str = Field(description="Version of the service.")
    api: str = Field(description="Version of the API, as in its paths.")
    schema_: str = Field(alias="schema", description="Version of the database schema.")


class Retention(Answer):
    """How long the service keeps what it stores on behalf of requests."""

    stored_queries: int = Field(
        description="Number of stored queries that are kept in each collection. The oldest are deleted first."
    )
    idempotency_hours: float = Field(
        description="Hours within which a repetition of a request with the same `Idempotency-Key` gets the first "
        "answer."
    )


class LimitsAnswer(Answer):
    """The limits that requests must keep. An error names the limit that was exceeded as it is named here."""

    limits: dict[str, int | float] = Field(description="Each limit by its name.")
    rates: dict[str, float] = Field(
        description="Requests per second that a key, or an address without a key, may send (`requests_per_second`). "
        "Empty if there is no such limit."
    )
    retention: Retention = Field(description="How long stored queries and answers are kept.")
    versions: Versions = Field(description="Versions of the running service.")


LIMITS_EXAMPLE: dict[str, Any] = {
    "limits": {
        "body_bytes": 8388608,
        "body_values": 250000,
        "landmarks": 20000,
        "properties_bytes": 16384,
        "candidates": 100,
        "excluded_submaps": 10000,
        "query_seconds": 4.5,
        "batch_seconds": 4.5,
        "page_default": 100,
        "page_max": 1000,
        "page_bytes": 4194304,
        "concurrent_requests": 32,
        "key_requests": 0,
        "queued_requests": 256,
        "queue_seconds": 5.0,
        "job_waits": 500,
        "key_job_waits": 100,
        "unsent_bytes": 268435456,
        "connections": 1000,
        "idle_seconds": 75.0,
        "header_seconds": 10.0,
        "body_seconds": 20.0,
        "body_rate": 16384,
        "buffered_bytes": 268435456,
    },
    "rates": {},
    "retention": {"stored_queries": 10000, "idempotency_hours": 24.0},
    "versions": {"service": "0.1.0", "api": "v1", "schema": "0001"},
}

READINESS_EXAMPLE: dict[str, Any] = {
    "status": "ok",
    "checks": {"migrations": "ok", "kernels": "ok", "index": "ok", "database": "ok"},
    "load": {"in_flight": 3, "capacity": 32, "queued": 0, "saturated": False},
}
