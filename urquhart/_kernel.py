"""The one way kernels are compiled: cached on disk, without the GIL, with IEEE arithmetic.

No fast-math: two triangles must find the same length for the edge they share.
"""

import hashlib
import os
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar, cast

from numba import njit, typeof
from numba.core import caching, config
from numba.core.dispatcher import Dispatcher

from urquhart._kernel_loading import StoredKernels

P = ParamSpec("P")
R = TypeVar("R")
_KERNELS: Final[list[Dispatcher]] = []
_IMPORT: Final = re.compile(r"^from ((?:urquhart|server)[\w.]*) import (\([^)]*\)|.*)$", re.MULTILINE)


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` at its first call; keep its type for the checker."""
    before = vars(config)["CACHE_LOCATOR_CLASSES"]
    vars(config)["CACHE_LOCATOR_CLASSES"] = _LOCATORS
    try:
        dispatcher = njit(cache=True, nogil=True, error_model="numpy")(function)
        vars(dispatcher)["_cache"] = _KernelCache(function)  # type: ignore[no-untyped-call]
    finally:
        vars(config)["CACHE_LOCATOR_CLASSES"] = before
    _KERNELS.append(dispatcher)
    return cast(Callable[P, R], dispatcher)


def compile_for(function: Callable[..., object], *examples: object) -> None:
    """Compile a kernel for arguments of the types of `examples`, without calling it, or load it from the cache."""
    cast(Dispatcher, function).compile(tuple(map(typeof, examples)))


def count_kernels() -> tuple[int, int]:
    """Number of kernels that this process has compiled or loaded from the cache, and number of all kernels."""
    return sum(bool(dispatcher.signatures) for dispatcher in _KERNELS), len(_KERNELS)


def are_cached() -> bool:
    """Whether every kernel of the modules that are loaded has been compiled before, by this or another process.

    Only the folders of the cache are looked at, so a cache that was made for another processor counts.
    """
    return all(Path(dispatcher.stats.cache_path or "").is_dir() for dispatcher in _KERNELS)


class _KernelCache(caching.FunctionCache):
    """Also reads a folder that cannot be written, such as that of an image. What is compiled then is not kept."""

    _impl_class = StoredKernels

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """A kernel from the disk, None if it has to be compiled. The compiler's tables are not filled before that."""
        return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled kernel, if that is possible."""
        folder = Path(self.cache_path)
        if not folder.exists() or os.access(folder, os.W_OK):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


class _BySources:
    """Keeps what is compiled in a folder that is named after a hash of the sources.

    numba looks at the time and size of the kernel's own file alone. But a compiled kernel contains the kernels that it
    calls and the constants that it uses, also those of other files, and would go on with them after an update.
    """

    _py_file: str
    _cache_path: str

    def get_cache_path(self) -> str:
        """Where it is kept."""
        return str(Path(self._cache_path) / f"kernels-{_digest(self._py_file)}")

    def get_source_stamp(self) -> str:
        """Nothing: the name of the folder says all, also where files were copied and have other times."""
        return ""


class NamedFolder(_BySources, caching.UserProvidedCacheLocator):
    """The folder that NUMBA_CACHE_DIR names. It need not be writable if the kernels are in it."""

    def ensure_cache_path(self) -> None:
        """Create the folder unless it exists. Raises OSError."""
        if not Path(self.get_cache_path()).is_dir():
            super().ensure_cache_path()  # type: ignore[no-untyped-call]


class BesideSources(_BySources, caching.InTreeCacheLocator):
    """Beside the package, where that can be written."""


class OfTheUser(_BySources, caching.UserWideCacheLocator):
    """The user's folder for caches."""


_LOCATORS: Final = ",".join(f"{__name__}.{one.__name__}" for one in (NamedFolder, BesideSources, OfTheUser))


@cache
def _digest(path: str) -> str:
    """Hash of a module, and of all modules of the product that it imports, directly or not."""
    known, left = dict[Path, bytes](), [Path(path)]
    while left:
        source = left.pop()
        if source not in known:
            known[source], imported = _read(source)
            left += imported
    return hashlib.sha256(b"".join(sorted(known.values()))).hexdigest()[:16]


@cache
def _read(source: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Hash of a file, and the files of the modules that it imports by `from ... import`."""
    content, root, imported = source.read_bytes(), _root(source).parent, list[Path]()
    for module, names in _IMPORT.findall(content.decode("utf-8")):
        place = root.joinpath(*module.split("."))
        for name in ("", *re.findall(r"\w+", names)):
            imported += [(place / name).with_suffix(".py"), place / name / "__init__.py"]
    return hashlib.sha256(content).digest(), tuple(file for file in imported if file.is_file())


def _root(source: Path) -> Path:
    """The folder of the outermost package that a file belongs to."""
    folder = source.parent
    while (folder.parent / "__init__.py").is_file():
        folder = folder.parent
    return folder
