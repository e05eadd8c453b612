"""Compiled kernels on the disk: used again while their sources are the same, and never after that."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import urquhart

INNER = """\
from typing import NamedTuple

from urquhart._kernel import kernel


class {name}(NamedTuple):
    factor: float = {factor}


NUMBERS = {name}()


@kernel
def scaled(x: float) -> float:
    return NUMBERS.factor * x
"""
OUTER = """\
from urquhart._kernel import kernel
from urquhart.inner import (
    scaled,
)


@kernel
def shifted(x: float) -> float:
    return scaled(x) + 1.0
"""
ASK = """\
from numba.core.runtime import rtsys
from urquhart.outer import shifted as f
print(f(1.0), sum(f.stats.cache_hits.values()), rtsys._init)
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package of two modules, one of which calls a kernel of the other."""
    folder = tmp_path / "urquhart"
    folder.mkdir()
    (folder / "__init__.py").touch()
    for module in ("_kernel.py", "_kernel_loading.py"):
        shutil.copy(Path(urquhart.__file__).with_name(module), folder / module)
    (folder / "inner.py").write_text(INNER.format(name="Numbers", factor="2.0"))
    (folder / "outer.py").write_text(OUTER)
    return folder


def asked(package: Path, cache: Path | None = None) -> tuple[float, int]:
    """What the outer kernel says in a new process, and whether it came from the disk."""
    environment = {**os.environ, "PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    if cache is not None:
        environment |= {"NUMBA_CACHE_DIR": str(cache), "NUMBA_CPU_NAME": "generic"}
    done = subprocess.run(
        [sys.executable, "-c", ASK], cwd=package.parent, env=environment, capture_output=True, text=True, check=True
    )
    value, hits, compiler = done.stdout.split()
    assert (compiler == "True") == (hits == "0"), "the compiler gets ready only if there is something to compile"
    return float(value), int(hits)


def test_a_kernel_is_compiled_again_when_one_that_it_calls_has_changed_and_only_then(package: Path) -> None:
    inner = package / "inner.py"
    assert asked(package) == (3.0, 0)
    # An image that was built elsewhere does not compile again, though its files have other times.
    os.utime(package / "outer.py", (0, 0))
    os.utime(inner, (0, 0))
    assert asked(package) == (3.0, 1)
    # A constant, then the name of a class, too. Times and sizes say nothing of it, as after an update that was unpacked
    # with old times.
    for name, factor, value in (("Numbers", "3.0", 4.0), ("Factors", "4.0", 5.0)):
        inner.write_text(INNER.format(name=name, factor=factor))
        os.utime(inner, (0, 0))
        assert asked(package) == (value, 0)


def test_a_kernel_is_compiled_with_one_that_was_loaded_from_the_disk(package: Path) -> None:
    assert asked(package) == (3.0, 0)
    (package / "outer.py").write_text(OUTER.replace("+ 1.0", "+ 2.0"))
    assert asked(package) == (4.0, 0)


def test_a_copied_cache_is_used_and_need_not_be_written_to(package: Path, tmp_path: Path) -> None:
    made, copied = tmp_path / "made", tmp_path / "copied"
    assert asked(package, made) == (3.0, 0)
    shutil.copytree(made, copied, copy_function=shutil.copyfile)
    for folder in (path for path in copied.rglob("*") if path.is_dir()):
        folder.chmod(0o555)
    before = {path: path.stat().st_mtime_ns for path in copied.rglob("*")}
    assert asked(package, copied) == (3.0, 1)
    assert {path: path.stat().st_mtime_ns for path in copied.rglob("*")} == before
