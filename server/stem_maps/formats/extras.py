"""Packages that only some formats need: imported at the first such file, and named where they are missing."""

import importlib
from pathlib import Path
from typing import Any

from server.stem_maps.formats.table import StemMapError


def import_extra(path: Path, extra: str, package: str) -> Any:
    """The module `package`, which `urquhart[extra]` installs and which is needed to read `path`.

    Raises:
        StemMapError: it is not installed.
    """
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise StemMapError(
            path,
            f"{path.suffix} files need the package {package}, which is not installed: pip install 'urquhart[{extra}]'",
        ) from error
