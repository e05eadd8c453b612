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
from server.coregistration.nominal import NominalPlaces
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
from server.stem_maps.reader import read_centres
from server.stem_maps.reading.options import ReadOptions
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from urquhart import Effort
from urquhart.prior.prior import LEAST_NOISE, MOST_NOISE

_PANEL: Final = "Where the plots ought to be"
_ANY: Final = 60.0
"""Degrees: a heading that is known no better is not known."""
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
Heading = Annotated[
    float,
    typer.Option(metavar="DEG", help="Bearing of the plots' y axes in the map.", rich_help_panel=_PANEL),
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
    if at_sigma is None and (positions, frame, noise) != (None, None, None):
        raise CommandError("--positions, --frame and --noise need --at-sigma: how right those positions are")
    if min_confidence is not None and not 0.5 < min_confidence < 1.0:
        raise CommandError(f"--min-confidence must be more than 0.5 and less than 1, not {min_confidence:g}")
    store = existing_database(settings)
    with ExitStack() as stack:
        stack.callback(store.dispose)
        bring_up_to_date(store)
        metrics = Metrics()
        context = QueryContext(store, LiveIndexes(store, metrics), metrics, settings.limits)
        there = {} if positions is None else read_centres(positions, columns)
        place = None if at_sigma is None else (frame or only_frame(store, collection), at_sigma)
        nominal = _nominal(place, there, (heading, heading_sigma), noise)
        placer = PlotPlacer(context, collection, SearchChoices(effort, min_confidence, seed, nominal))
        files, journal = _files(plots, positions), stack.enter_context(_journal(out))
        season = _read(files, columns, positions, set(there))
        progress = stack.enter_context(ProgressReport(Console(stderr=True), "plots"))
        results, known = _place(season, placer, journal, progress)
        with progress.busy("writing tables, pictures and the report"):
            attention = write_folder(out, collection, results, season.told)
    _tell(results, attention, known, out)
    if season.unread:
        raise typer.Exit(2)


def _files(plots: list[Path], positions: Path | None) -> list[Path]:
    """The files of plots, without the one of their positions. Raises StemMapError."""
    files = plot_files(plots)
    return [one for one in files if positions is None or not one.exists() or not one.samefile(positions)]


def _journal(out: Path) -> Journal:
    """The results so far. Raises CommandError if the folder cannot be used."""
    try:
        return Journal(out)
    except FolderError as error:
        raise CommandError(str(error)) from error


def _nominal(
    place: tuple[str, float] | None,
    positions: dict[str, tuple[float, float]],
    heading: tuple[float, float],
    noise: float | None,
) -> NominalPlaces | None:
    """What is known of where plots are: `place` is the map frame and a sigma, `heading` a bearing and a sigma."""
    if place is None:
        return None
    frame_id, sigma = place
    bearing, turned = heading
    known = tuple((name, x, y) for name, (x, y) in positions.items())
    return NominalPlaces(frame_id, sigma, bearing if turned < _ANY else None, turned, noise, known)


def _read(files: list[Path], columns: ReadOptions, positions: Path | None, placed: set[str]) -> Season:
    """All plots, `placed` being those that the file of positions names. Raises CommandError if there is none."""
    season = read_season(files, columns, reading=reading)
    for line in season.told:
        typer.echo(line)
    if not season.plots:
        raise CommandError(season.unread[0].why if season.unread else "there is no plot in these files")
    if positions is not None:
        _tell_names(positions, {plot.name for plot in season.plots}, placed)
    return season


def _tell_names(positions: Path, plots: set[str], placed: set[str]) -> None:
    """Say which plots have no position, and which positions no plot: a name that is misspelt is both."""
    for names, what in (
        (plots - placed, "have no position and are searched everywhere"),
        (placed - plots, "are no plot"),
    ):
        if names:
            shown = ", ".join(sorted(names)[:5]) + (", ..." if len(names) > 5 else "")
            typer.echo(f"{positions.name}: {len(names)} names {what}: {shown}", err=True)


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
