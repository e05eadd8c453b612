"""What the service says of itself: limits, retention, versions."""

from server.config.settings import Settings
from server.platform.version import service_version
from server.schemas.system import LimitsAnswer, Retention, Versions
from server.store.migrations_runner import expected_revision


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
