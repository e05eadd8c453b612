"""A season that a caller has sent, read in a process of its own: a file that ends it is a row, and the others are read.

Sentences and results name files as the caller did, without the folder that they were written to.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Final

from server.coregistration.season import FilePlots, Season, UnreadPlot, plot_files, read_file, season_of
from server.errors import InvalidFile
from server.platform.isolated_process import IsolatedProcess
from server.stem_maps.formats.table import StemMapError
from server.stem_maps.reader import read_centres
from server.stem_maps.reading.centres import Centres
from server.stem_maps.reading.options import ReadOptions

_SECONDS: Final = 120.0
"""That a file may take. A million trees as CSV take 17 s (docs/files.md)."""


class SeasonReader(AbstractContextManager["SeasonReader"]):
    """Reads the files of one folder. The process starts with the first file, and ends with the block."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process = IsolatedProcess(_load)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.close()

    def season(
        self, options: ReadOptions, positions: Path | None, advance: Callable[[], object] = lambda: None
    ) -> Season:
        """All plots, and those that cannot be read; `positions` is no file of plots. Calls `advance` after each file.

        Raises:
            InvalidFile: there is no plot at all.
            WorkerLost: no process can be started.
        """
        try:
            files = plot_files([self._folder], with_folders=True)
        except StemMapError as error:
            raise InvalidFile(self._told(str(error))) from error
        parts = []
        for path in files.paths:
            if path != positions:
                parts.append(self._file(path, options))
                advance()
        season = season_of(parts)
        if not season.plots:
            why = season.unread[0].why if season.unread else "there is no plot in these files"
            raise InvalidFile(f"No plot can be read: {why}")
        notes = tuple(line.replace(f"{self._folder.name}: ", "", 1) for line in files.passed_over)
        return replace(season, told=(*notes, *season.told))

    def centres(self, path: Path, options: ReadOptions, assumed: str | None) -> Centres:
        """As `read_centres`, of a file in the folder. Raises InvalidFile and WorkerLost."""
        outcome = self._process.attempt(_read_centres, (path, options, assumed), _SECONDS)
        if outcome.error is not None:
            raise outcome.error
        if outcome.lost is not None:
            raise InvalidFile(f"{path.name} was not read: {outcome.lost}. It is damaged, or too large.")
        if isinstance(outcome.result, Centres):
            return outcome.result
        raise InvalidFile(self._told(str(outcome.result)))

    def _file(self, path: Path, options: ReadOptions) -> FilePlots:
        outcome = self._process.attempt(_read_file, (path, options), _SECONDS)
        if outcome.error is not None:
            raise outcome.error
        if outcome.lost is not None:
            why = f"{path.name}: was not read: {outcome.lost}. It is damaged, or too large to be sent"
            return FilePlots((), (UnreadPlot(path.stem, path.relative_to(self._folder), why),), ())
        found: FilePlots = outcome.result
        return FilePlots(
            tuple(replace(one, path=one.path.relative_to(self._folder)) for one in found.plots),
            tuple(
                replace(one, path=one.path.relative_to(self._folder), why=self._told(one.why)) for one in found.unread
            ),
            found.told,
        )

    def _told(self, sentence: str) -> str:
        return sentence.replace(f"{self._folder}/", "").replace(f"{self._folder}: ", "")


def _load() -> None:
    """What the process does before its first file: nothing more than importing this module."""


def _read_file(task: tuple[Path, ReadOptions]) -> FilePlots:
    return read_file(*task)


def _read_centres(task: tuple[Path, ReadOptions, str | None]) -> Centres | str:
    """The centres, or why they cannot be read."""
    try:
        return read_centres(*task)
    except StemMapError as error:
        return str(error)
