"""docs/results.md: one page of all figures that lie beside it, whichever command made them."""

from pathlib import Path

from benchmarks import record
from benchmarks.levels.report import SECTIONS as LEVELS
from benchmarks.levels.report import write_report as write_levels
from benchmarks.markdown import FOLDER, page
from benchmarks.paper.report import SECTIONS as PAPER
from benchmarks.paper.report import write_report as write_paper
from benchmarks.robust.report import SECTIONS as ROBUST
from benchmarks.robust.report import write_report as write_robust
from benchmarks.windows.report import SECTIONS as WINDOWS
from benchmarks.windows.report import write_report as write_windows


def compose(folder: Path) -> str:
    """The page, from the JSON files under `folder`."""
    parts = []
    written = ((ROBUST, write_robust), (WINDOWS, write_windows), (LEVELS, write_levels), (PAPER, write_paper))
    for sections, write in written:
        paths = {name: folder / FOLDER / f"{name}.json" for name in sections}
        results = {name: record.read(path) for name, path in paths.items() if path.exists()}
        parts.append(write(results) if results else "")
    return page(*parts)


def write_page(folder: Path) -> Path:
    """Write the page; where it went."""
    target = folder / "results.md"
    target.write_text(compose(folder), encoding="utf-8")
    return target
