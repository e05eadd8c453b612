"""The limits, retention times and versions that the service publishes."""

from server.config.settings import Settings
from server.platform.version import service_version
from server.schemas.system import LimitsAnswer, Retention, Versions
from server.store.schema_version import expected_revision


def limits(settings: Settings) -> LimitsAnswer:
    """The limits of requests, under the names that errors use."""
    sizes = settings.limits.model_dump()
    kept, often = sizes.pop("stored_queries"), sizes.pop("requests_per_second")
    return LimitsAnswer(
        limits=sizes,
        rates={"requests_per_second": often} if often else {},
        retention=Retention(stored_queries=kept, idempotency_hours=settings.idempotency_hours),
        versions=Versions(service=service_version(), api="v1", schema=expected_revision()),
    )
