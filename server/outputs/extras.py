"""Packages that only some formats need: imported when such a file is written, and named where they are missing."""

import importlib
import importlib.util
from typing import Any

from server.errors import NotAcceptable


def is_installed(package: str) -> bool:
    """Whether a package can be imported."""
    return importlib.util.find_spec(package) is not None


def import_extra(module: str, extra: str, what: str) -> Any:
    """The `module` that `urquhart[extra]` installs, and that the format `what` needs. Raises NotAcceptable."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.split(".")[0]
        raise NotAcceptable(
            f"{what} needs the package {package}, which is not installed here: pip install 'urquhart[{extra}]'. CSV "
            "and GeoJSON need none.",
            ["text/csv", "application/geo+json"],
        ) from error
