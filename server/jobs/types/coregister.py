"""The job that places a season's plots in a map: what `urquhart coregister` does with files of the host."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import orjson
from pydantic import BaseModel, Field

from server.coregistration.journal import Journal
from server.coregistration.outputs.attention import Attention
from server.coregistration.outputs.folder import write_folder
from server.coregistration.outputs.tables import plots_table
from server.coregistration.requests.archive import unpack
from server.coregistration.requests.reading import SeasonReader
from server.coregistration.requests.search import SeasonPlan, SeasonSearch, plan_season
from server.coregistration.results import PlotResult
from server.coregistration.run import coregister
from server.coregistration.season import Season
from server.errors import InvalidFile
from server.jobs.running_job import JobContext, RunningJob
from server.jobs.types.find_constraints import parameters_of, write_results
from server.platform.disk_errors import disk_errors
from server.queries.lookup import QueryContext
from server.stem_maps.formats.table import StemMapError
from server.stem_maps.reading.options import ReadOptions

_SILENCE: Final = 1.0
"""Seconds after which the job reports, and another one may have its turn."""


_MEMBERS: Final = {
    "E": "east",
    "N": "north",
    "dE": "shift_east",
    "dN": "shift_north",
    "sigma_E": "sigma_east",
    "sigma_N": "sigma_north",
    "rival_E": "rival_east",
    "rival_N": "rival_north",
}
"""Columns of `plots.csv` that are members of other names in JSON."""


class CoregistrationParameters(BaseModel):
    """What a job of this type was accepted with.

    Attributes:
        file: name of the upload: a file of plots, or a zip archive of several.
        positions: name of the file in the archive that says where plots ought to be.
        options: what is known of the files.
        search: how plots are searched; `frame` is set if `at_sigma` is.
    """

    file: str
    positions: str | None = None
    options: ReadOptions = Field(default_factory=ReadOptions)
    search: SeasonSearch = Field(default_factory=SeasonSearch)


def run_coregister(job: RunningJob, context: JobContext) -> None:
    """Place all plots, and write tables, layers, pictures and the report into the folder of the job's files.

    The results are a line for each plot. A plot that was looked up before a kill is not looked up again, unless the
    collection changed. Raises NotFound, InvalidFile, StorageError and others.
    """
    if "written" in job.progress:
        return  # only its end could not be stored
    asked = parameters_of(job, CoregistrationParameters)
    with context.database.read() as tx:
        job.collection(tx)
    unpacked, files = context.folder.unpacked(job.id), context.folder.files(job.id)
    with disk_errors(context.folder.path):
        unpack(context.folder.input(job.id), asked.file, unpacked, context.settings.limits.import_bytes)
    season, plan = _read(job, context, asked, unpacked)
    job.total, job.done = len(season.plots) + len(season.unread), len(season.unread)
    with disk_errors(context.folder.path):
        with Journal(files) as journal:
            results = coregister(season, plan.placer, journal, lambda result, known: _advance(job))
        job.counts = dict(Counter(one.outcome for one in results))
        job.report()
        attention = write_folder(files, job.collection_id, results, season.told)
    size = write_results(job, context, _lines(results, attention))
    with disk_errors(context.folder.path):
        job.report(written=size)


def _read(
    job: RunningJob, context: JobContext, asked: CoregistrationParameters, unpacked: Path
) -> tuple[Season, SeasonPlan]:
    """The plots, and what places them. Raises InvalidFile, NotFound and WorkerLost."""
    queries = QueryContext(context.database, context.indexes, context.metrics, context.settings.limits)
    where = None if asked.positions is None else _sent(unpacked, asked.positions)
    positions = None if where is None else (where, asked.options)
    with SeasonReader(unpacked) as reader:
        try:
            plan = plan_season(
                queries,
                (job.collection_id, asked.search.frame),
                asked.search,
                positions,
                read=reader.centres,
                budget=job.budget,
            )
        except StemMapError as error:
            raise InvalidFile(str(error).replace(f"{unpacked}/", "")) from error
        season = reader.season(asked.options, where, lambda: _stay_alive(job))
    if asked.positions is not None and plan.positions is not None:
        season = season.with_told(plan.positions.told_of(asked.positions, {plot.name for plot in season.plots}))
    return season, plan


def _sent(unpacked: Path, name: str) -> Path:
    """The one file of that name, whatever folder of the archive it is in. Raises InvalidFile."""
    found = [path for path in unpacked.rglob("*") if path.name == name and path.is_file()]
    if len(found) > 1:
        raise InvalidFile(f"The archive has {len(found)} files {name!r}. Give the file of positions another name.")
    return found[0] if found else unpacked / name


def _advance(job: RunningJob) -> None:
    job.done += 1
    if job.since_report > _SILENCE:
        job.report()
        job.yield_turn()


def _stay_alive(job: RunningJob) -> None:
    """Report now and then while files are read: somebody may have cancelled the job."""
    if job.since_report > _SILENCE:
        job.report()


def _lines(results: list[PlotResult], attention: list[Attention]) -> Iterator[bytes]:
    """A line of JSON for each plot: its row of `plots.csv`."""
    table = plots_table(results, attention)
    names = [_MEMBERS.get(column, column) for column in table.columns]
    for row in table.rows:
        yield orjson.dumps(dict(zip(names, row, strict=True))) + b"\n"
