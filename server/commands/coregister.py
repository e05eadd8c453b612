"""`urquhart coregister`: place the plots of a season in a map, with tables, layers, transforms, pictures, a report."""

from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console

from server.commands.locate import MinConfidence
from server.commands.support.database import existing_database, settings_with
from server.commands.support.failure import CommandError
from server.commands.support.file_options import reads_files
from server.commands.support.options import DatabaseOption
from server.commands.support.place_options import only_frame
from server.commands.support.progress import ProgressReport, reading
from server.coregistration.journal import FolderError, Journal
from server.coregistration.outputs.attention import Attention
from server.coregistration.outputs.folder import REPORT, write_folder
from server.coregistration.outputs.layers import MISSING, can_write_layers
from server.coregistration.placing import PlotPlacer
from server.coregistration.positions import SeasonPositions
from server.coregistration.requests.search import SeasonSearch, plan_season
from server.coregistration.results import PlotResult
from server.coregistration.run import coregister as coregister_season
from server.coregistration.season import Season, plot_files, read_season
from server.index.live_indexes import LiveIndexes
from server.observability.metrics import Metrics
from server.queries.lookup import QueryContext
from server.stem_maps.reading.options import ReadOptions
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from urquhart import Effort
from urquhart.prior.prior import LEAST_NOISE, MOST_NOISE

_PANEL: Final = "Where the plots ought to be"
_SHOWN: Final = 10
"""Plots that need eyes, on the terminal; the report has all."""

AtSigma = Annotated[
    float | None,
    typer.Option(
        min=0.01,
        max=1e4,
        metavar="M",
        help="Search each plot where it ought to be first: standard deviation of that, in metres. (default: search "
        "everywhere)",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]
Positions = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Where plots ought to be, such as from GNSS: the columns plot, x and y. (default: the plots' own "
        "coordinates)",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]
PositionsCrs = Annotated[
    str | None,
    typer.Option(
        metavar="CODE",
        help="Coordinate reference system of --positions, such as EPSG:4326. (default: what the file names, then "
        "--crs, then the map's)",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]
Heading = Annotated[
    float,
    typer.Option(
        metavar="DEG",
        help="Bearing of the plots' y axes: from grid north of their system, or of the map if they name none.",
        rich_help_panel=_PANEL,
    ),
]
HeadingSigma = Annotated[
    float,
    typer.Option(
        min=0.01,
        max=180.0,
        metavar="DEG",
        help="Standard deviation of --heading. From 60 on, every heading is searched.",
        rich_help_panel=_PANEL,
    ),
]
Frame = Annotated[
    str | None,
    typer.Option(help="Map frame that plots ought to be in. (default: the only one)", rich_help_panel=_PANEL),
]
Noise = Annotated[
    float | None,
    typer.Option(
        min=LEAST_NOISE,
        max=MOST_NOISE,
        metavar="M",
        help="Roughly how far trees are off in the map, such as tree tops seen from the air. (default: 0.3 to 1)",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]


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
    at_sigma: AtSigma = None,
    positions: Positions = None,
    positions_crs: PositionsCrs = None,
    heading: Heading = 0.0,
    heading_sigma: HeadingSigma = 5.0,
    frame: Frame = None,
    noise: Noise = None,
    database: DatabaseOption = None,
    columns: ReadOptions,
) -> None:
    """Place all plots of a season in a map, and report where each one is.

    Each plot is looked up as `urquhart locate` does, then fitted to all trees of the map around it. DIR gets
    plots.gpkg and plots.csv (verdict, shift and turn about the plot's centre, their standard deviations, paired trees,
    typical distance, scale), trees.gpkg and trees.csv (each tree corrected and as surveyed), pairs.csv, transforms
    (4x4), pictures, and report.html, which opens without a network.

    With --at-sigma, each plot is searched where its own coordinates, or --positions, put it, and elsewhere only if it
    is not there.

    A plot that cannot be read or found is a row, and the others are placed. If the command is stopped, running it again
    goes on where it was; plots whose trees or map changed are looked up again. The exit code is 2 if a plot could not
    be read.
    """
    settings = settings_with(database=database)
    search = SeasonSearch(effort, min_confidence, seed, at_sigma, positions_crs, heading, heading_sigma, frame, noise)
    fault = search.fault(has_positions=positions is not None, named=lambda name: f"--{name.replace('_', '-')}")
    if fault is not None:
        raise CommandError(fault[1])
    store = existing_database(settings)
    with ExitStack() as stack:
        stack.callback(store.dispose)
        bring_up_to_date(store)
        metrics = Metrics()
        context = QueryContext(store, LiveIndexes(store, metrics), metrics, settings.limits)
        place = (collection, None if at_sigma is None else frame or only_frame(store, collection))
        plan = plan_season(context, place, search, None if positions is None else (positions, columns))
        files, journal = _files(plots, positions), stack.enter_context(_journal(out))
        season = _read(files, columns, positions, plan.positions)
        progress = stack.enter_context(ProgressReport(Console(stderr=True), "plots"))
        results, known = _place(season, plan.placer, journal, progress)
        with progress.busy("writing tables, pictures and the report"):
            attention = write_folder(out, collection, results, season.told)
    _tell(results, attention, known, out)
    if season.unread:
        raise typer.Exit(2)


def _files(plots: list[Path], positions: Path | None) -> list[Path]:
    """The files of plots, without the one of their positions; says what is passed over. Raises StemMapError."""
    files = plot_files(plots)
    for line in files.passed_over:
        typer.echo(line, err=True)
    return [one for one in files.paths if positions is None or not one.exists() or not one.samefile(positions)]


def _journal(out: Path) -> Journal:
    """The results so far. Raises CommandError if the folder cannot be used."""
    try:
        return Journal(out)
    except FolderError as error:
        raise CommandError(str(error)) from error


def _read(files: list[Path], columns: ReadOptions, positions: Path | None, there: SeasonPositions | None) -> Season:
    """All plots; `there` is what the file `positions` says. Raises CommandError if there is none."""
    season = read_season(files, columns, reading=reading)
    for line in season.told:
        typer.echo(line)
    if not season.plots:
        raise CommandError(season.unread[0].why if season.unread else "there is no plot in these files")
    if positions is None or there is None:
        return season
    told = there.told_of(positions.name, {plot.name for plot in season.plots})
    for line in told:
        typer.echo(line, err=True)
    return season.with_told(told)


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
