"""Bodies of the system routes."""

from typing import Any

from pydantic import Field

from server.schemas.common import Answer


class Liveness(Answer):
    """The process answers."""

    status: str


class Load(Answer):
    """How busy the process is that answers."""

    running: int = Field(description="Requests that are worked on.")
    places: int = Field(description="Requests that can be worked on at once.")
    waiting: int = Field(description="Requests that wait for a place.")
    saturated: bool = Field(description="Whether all places are taken, so that another caller's request has to wait.")


class Readiness(Answer):
    """All checks are passed."""

    status: str
    checks: dict[str, str]
    load: Load


class Versions(Answer):
    """What is running."""

    service: str
    api: str
    schema_: str = Field(alias="schema")


class Retention(Answer):
    """How long things are kept."""

    stored_queries: int = Field(description="Kept per collection; the oldest go first.")
    idempotency_hours: float = Field(
        description="Hours for which a request sent again with its Idempotency-Key gets the first answer."
    )


class LimitsAnswer(Answer):
    """What requests are held to; the refusal that enforces a limit names it as here."""

    limits: dict[str, int | float]
    rates: dict[str, float] = Field(
        description="`requests_per_second` of a key, or of an address without one; empty where none is enforced."
    )
    retention: Retention
    versions: Versions


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
        "page": 100,
        "page_max": 1000,
        "page_bytes": 4194304,
        "concurrent_requests": 32,
        "key_requests": 0,
        "queued_requests": 256,
        "queue_seconds": 5.0,
        "waits": 500,
        "key_waits": 100,
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
    "load": {"running": 3, "places": 32, "waiting": 0, "saturated": False},
}
