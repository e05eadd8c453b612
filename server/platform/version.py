"""The version of the installed service, for `/v1/limits`, the OpenAPI document and the landing page."""

from functools import cache
from importlib import metadata


@cache
def service_version() -> str:
    """Version of the installed distribution, or `0+source` if it runs from a source tree that is not installed."""
    try:
        return metadata.version("urquhart")
    except metadata.PackageNotFoundError:
        return "0+source"
