"""`urquhart` as it runs where only its own packages are installed: `as_installed.py serve ...`.

The environment of a benchmark has more: numba imports coverage and PyYAML where they are there, and others do likewise.
A program without imports of this package, because an older commit does not have it.
"""

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Final

PACKAGES: Final = "BENCHMARK_PACKAGES"
"""Environment variable with the names of the installed modules that may be imported."""


class Installed(PathFinder):
    """Finds those, the standard library, and what is not installed."""

    names: frozenset[str] = frozenset()

    @classmethod
    def find_spec(
        cls, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module of that name; None if it is not installed, or hidden."""
        found = super().find_spec(fullname, path, target)
        if found is None or path is not None or fullname in cls.names:
            return found
        places = [found.origin or "", *(found.submodule_search_locations or ())]
        return None if any("site-packages" in place for place in places) else found


def hide_others(names: Sequence[str]) -> None:
    """Let no installed module be imported from now on but those of these names."""
    Installed.names = frozenset(names)
    sys.meta_path[:] = [Installed if finder is PathFinder else finder for finder in sys.meta_path]


if __name__ == "__main__":
    hide_others(os.environ[PACKAGES].split())
    from server.cli import main

    main()
