"""`urquhart coregister`: place the plots of a season in a map, with tables, layers, transforms, pictures, a report."""

from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from server.commands.locate import MinConfidence
from server.commands.support.database import existing_database, settings_with
from server.commands.support.failure import CommandError
from server.commands.support.file_options import reads_files
from server.commands.support.options import DatabaseOption
from server.commands.support.progress import ProgressReport, reading
from server.coregistration.journal import FolderError, Journal
from server.coregistration.outputs.attention import Attention
from server.coregistration.outputs.folder import REPORT, write_folder
from server.coregistration.outputs.layers import MISSING, can_write_layers
from server.coregistration.placing import PlotPlacer, SearchChoices
from server.coregistration.results import PlotResult
from server.coregistration.run import coregister as coregister_season
from server.coregistration.season import Season, plot_files, read_season
from server.index.live_indexes import LiveIndexes
from server.observability.metrics import Metrics
from server.queries.lookup import QueryContext
from server.stem_maps.reading.options import ReadOptions
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from urquhart import Effort

_SHOWN = 10
"""Plots that need eyes, on the terminal; the report has all."""


@reads_files
def coregister(
    *,
    plots: Annotated[
        list[Path],
        typer.Argument(metavar="PLOTS...", help="Files of one plot or many, with a column of plots; or folders."),
    ],
    collection: Annotated[str, typer.Option(help="Collection with the map.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results. It is created.")],
    effort: Annotated[Effort, typer.Option(help="How far to search if a plot is not found.")] = "full",
    min_confidence: MinConfidence = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of random choices. The same seed gives the same results.")
    ] = None,
    database: DatabaseOption = None,
    columns: ReadOptions,
) -> None:
    """Place all plots of a season in a map, and report where each one is.

    Each plot is looked up as `urquhart locate` does, then fitted to all trees of the map around it. DIR gets
    plots.gpkg and plots.csv (verdict, shift and turn about the plot's centre, their standard deviations, paired trees,
    typical distance, scale), trees.gpkg and trees.csv (each tree corrected and as surveyed), pairs.csv, transforms
    (4x4), a picture of each plot, and report.html, which opens without a network.

    A plot that cannot be read or found is a row, and the others are placed. If the command is stopped, running it again
    goes on where it was; plots whose trees or map changed are looked up again. The exit code is 2 if a plot could not
    be read.
    """
    settings = settings_with(database=database)
    if min_confidence is not None and not 0.5 < min_confidence < 1.0:
        raise CommandError(f"--min-confidence must be more than 0.5 and less than 1, not {min_confidence:g}")
    store = existing_database(settings)
    with ExitStack() as stack:
        stack.callback(store.dispose)
        bring_up_to_date(store)
        metrics = Metrics()
        context = QueryContext(store, LiveIndexes(store, metrics), metrics, settings.limits)
        placer = PlotPlacer(context, collection, SearchChoices(effort, min_confidence, seed))
        files = plot_files(plots)
        try:
            journal = stack.enter_context(Journal(out))
        except FolderError as error:
            raise CommandError(str(error)) from error
        season = _read(files, columns)
        progress = stack.enter_context(ProgressReport(Console(stderr=True), "plots"))
        results, known = _place(season, placer, journal, progress)
        with progress.busy("writing tables, pictures and the report"):
            attention = write_folder(out, collection, results, season.told)
    _tell(results, attention, known, out)
    if season.unread:
        raise typer.Exit(2)


def _read(files: list[Path], columns: ReadOptions) -> Season:
    """All plots. Raises CommandError if there is none."""
    season = read_season(files, columns, reading=reading)
    for line in season.told:
        typer.echo(line)
    if not season.plots:
        raise CommandError(season.unread[0].why if season.unread else "there is no plot in these files")
    return season


def _place(
    season: Season, placer: PlotPlacer, journal: Journal, progress: ProgressReport
) -> tuple[list[PlotResult], int]:
    """The results, and how many of them were known from an earlier run."""
    advance, known = progress.task("placing", len(season.plots)), 0

    def done(result: PlotResult, was_known: bool) -> None:
        nonlocal known
        known += was_known
        advance(1)

    return coregister_season(season, placer, journal, done), known


def _tell(results: list[PlotResult], attention: list[Attention], known: int, out: Path) -> None:
    """Print what was found, what needs eyes, and where the report is."""
    counts = Counter(one.outcome for one in results)
    told = ", ".join(f"{count} {outcome.replace('_', ' ')}" for outcome, count in counts.most_common())
    earlier = f" ({known} known from an earlier run)" if known else ""
    typer.echo(f"{len(results)} plots: {told}{earlier}")
    for one in attention[:_SHOWN]:
        typer.echo(f"look at {one.result.name}: {one.result.outcome.replace('_', ' ')}: {one.why[0]}")
    if len(attention) > _SHOWN:
        typer.echo(f"and at {len(attention) - _SHOWN} more plots, which the report lists")
    if not can_write_layers():
        typer.echo(MISSING)
    typer.echo(f"report: {out / REPORT}")
