"""What the service says of itself: limits, retention, versions."""

from server.schemas.system import LimitsAnswer, Retention, Versions
from server.settings import Settings
from server.store.schema import expected_revision
from server.version import service_version


def limits(settings: Settings) -> LimitsAnswer:
    """Sizes and times that requests are held to, under the names that a refusal gives."""
    sizes = settings.limits.model_dump()
    kept, often = sizes.pop("stored_queries"), sizes.pop("requests_per_second")
    return LimitsAnswer(
        limits=sizes,
        rates={"requests_per_second": often} if often else {},
        retention=Retention(stored_queries=kept, idempotency_hours=settings.idempotency_hours),
        versions=Versions(service=service_version(), api="v1", schema=expected_revision()),
    )
