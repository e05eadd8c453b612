"""`urquhart index`: cut stem maps into overlapping submaps and store them, without a service."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

import urquhart
from server.collections.crud import ensure
from server.commands.support.database import open_database, settings_with
from server.commands.support.failure import CommandError
from server.commands.support.file_options import reads_files
from server.commands.support.options import DatabaseOption
from server.commands.support.progress import ProgressReport, reading
from server.config.settings import Limits, Settings
from server.config.settings_groups import IndexSettings
from server.errors import StorageError
from server.index.live_indexes import LiveIndexes
from server.index.maintenance import Maintenance
from server.observability.metrics import Metrics
from server.schemas.collections import CollectionPut
from server.schemas.common import check_id
from server.stem_maps.reader import StemMap, StemMapError, read_stem_map
from server.stem_maps.reading.options import ReadOptions
from server.stem_maps.stands import StandError, StandReport, cut_stand, store_stand, whole_stand
from server.stem_maps.tiling import Cut, CuttingError, left_out
from server.store.sqlite.database import Database
from server.submaps.bulk_ingest import LineOptions
from server.submaps.described_batches import describers


@reads_files
def index(
    *,
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Stem maps: tables, GIS files or point clouds.")
    ],
    collection: Annotated[str, typer.Option(help="Collection to store in. It is created if it does not exist.")],
    radius: Annotated[float | None, typer.Option(help="Radius of a submap, in metres.", show_default=False)] = None,
    spacing: Annotated[
        float | None,
        typer.Option(help="Distance between the centres of neighbouring submaps, in metres.", show_default=False),
    ] = None,
    one_submap: Annotated[
        bool,
        typer.Option("--one-submap", help="Make each file, or each of its plots, one submap, however large it is."),
    ] = False,
    database: DatabaseOption = None,
    processes: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=256,
            help="Number of processes that describe submaps, including this one. (default: one for each core)",
            show_default=False,
        ),
    ] = None,
    columns: ReadOptions,
) -> None:
    """Cut stem maps into overlapping submaps and store them.

    A stem map is a file with one tree on each row: CSV, xlsx, GeoPackage, Shapefile, FlatGeobuf, GeoJSON, KML, GPX, or
    LAS and LAZ whose points are numbered by tree. Columns have well-known names (x_m, y_m, dbh_cm and more), or are
    named by options or in a columns.toml beside the file. The command says how it understood them.

    Each submap contains the trees within the radius of a point of a square grid, in a frame of its own, and its pose in
    the map, which has the name of the file. With --one-submap, each file is one submap, or each of its plots. Indexing
    a corrected file with the same name replaces all its submaps in one step. Indexing the same file again changes
    nothing.

    Of several files, one that cannot be stored is a row of the report, and the others are stored; the exit code is then
    2. Nothing is stored if two files have one name, or two coordinate reference systems.
    """
    settings = settings_with(database=database)
    _check_names(files)
    cut_map = _cutting(radius, spacing, one_submap, settings.limits)
    inputs = [_prepared(path, columns, cut_map) for path in files]
    readable = [one for one in inputs if one.stand is not None]
    if len(inputs) == 1 and not readable:
        raise CommandError(inputs[0].error)
    _check_systems(readable)
    if readable:
        store = open_database(settings)
        try:
            ensure_collection(store, collection)
            _store_all(store, collection, readable, settings, processes)
        finally:
            store.dispose()
    if len(inputs) == 1 and inputs[0].error:
        raise CommandError(inputs[0].error)
    _tell(inputs)


@dataclass(slots=True)
class _IndexedFile:
    """A file, what became of it, and why it was not stored if `error` is not empty."""

    path: Path
    stem_map: StemMap | None = None
    stand: Cut | None = None
    report: StandReport | None = None
    error: str = ""


def _cutting(radius: float | None, spacing: float | None, one_submap: bool, limits: Limits) -> Callable[[StemMap], Cut]:
    """What makes submaps of a stem map. Raises CommandError unless the options say it, once."""
    if one_submap:
        if radius is not None or spacing is not None:
            raise CommandError("--one-submap makes whole files or plots submaps: leave out --radius and --spacing")
        return partial(whole_stand, limits=limits)
    if radius is None or spacing is None:
        raise CommandError("say how to cut: give --radius and --spacing, or --one-submap (see urquhart index --help)")
    return partial(cut_stand, radius=radius, spacing=spacing, limits=limits)


def _prepared(path: Path, columns: ReadOptions, cut_map: Callable[[StemMap], Cut]) -> _IndexedFile:
    """A file read and made into submaps; a file that cannot be stored does not keep others from it."""
    one = _IndexedFile(path)
    try:
        with reading(path):
            one.stem_map = read_stem_map(path, columns)
        one.stand = cut_map(one.stem_map)
    except StemMapError as error:
        one.error = str(error)
    except (CuttingError, StandError) as error:
        one.error = f"{path}: {error}"
    return one


def _store_all(
    store: Database, collection: str, inputs: list[_IndexedFile], settings: Settings, processes: int | None
) -> None:
    """Store each stand in a transaction of its own, then write the index."""
    console = Console(stderr=True)
    with console.status("loading the kernels"):  # compiled at the first use, so not counted in the rate
        urquhart.describe(np.random.default_rng(0).uniform(0.0, 50.0, (30, 2)), urquhart.Config())
    with describers(processes) as workers, ProgressReport(console, "submaps") as progress:
        options = LineOptions(limits=settings.limits, workers=workers)
        for one in inputs:
            assert one.stem_map is not None and one.stand is not None
            advance = progress.task(one.path.name, len(one.stand.discs))
            try:
                one.report = store_stand(store, collection, one.stem_map, one.stand, options, advance=advance)
            except StandError as error:
                one.error = f"{one.path}: {error}"
        _write_index(store, settings.index, collection, progress.task("index", None))


def _tell(inputs: list[_IndexedFile]) -> None:
    """Print what became of each file, in their order. Raises CommandError if one of them was not stored."""
    for one in inputs:
        if one.stem_map is not None and one.report is not None:
            typer.echo(f"{one.stem_map.name}: {one.stem_map.understood}")
            typer.echo(sentence(one.report))
        else:
            typer.echo(f"not stored: {' '.join(one.error.split())}")
    count = sum(one.report is None for one in inputs)
    if count:
        raise CommandError(f"{count} of {len(inputs)} files were not stored: see the rows that begin with 'not stored'")


def _check_names(files: list[Path]) -> None:
    """Raise CommandError if two files would be stands of one name."""
    names = [path.stem for path in files]
    for name in names:
        if names.count(name) > 1:
            raise CommandError(f"two files are called {name!r}, and their submaps would have the same ids: rename one")


def _check_systems(inputs: list[_IndexedFile]) -> None:
    """Raise CommandError if files are in different coordinate reference systems."""
    known = [(one.path, one.stem_map.crs) for one in inputs if one.stem_map is not None and one.stem_map.crs]
    other = next(((path, crs) for path, crs in known if crs != known[0][1]), None)
    if other is not None:
        raise CommandError(
            f"{known[0][0]} is in {known[0][1]}, but {other[0]} is in {other[1]}: convert all to one system with "
            f"--project {known[0][1]}"
        )


def _write_index(store: Database, settings: IndexSettings, collection: str, advance: Callable[[int], Any]) -> None:
    """Write the new submaps to segments if there are many, so that a service need not do it before it answers."""
    metrics = Metrics()
    maintenance = Maintenance(store, LiveIndexes(store, metrics, settings), metrics)
    try:
        maintenance.flush_and_merge(collection, least=settings.flush_submaps + 1, progress=advance)
    except (OSError, StorageError) as error:
        typer.echo(f"all submaps are stored, but the index is not written: {error}", err=True)


def ensure_collection(database: Database, collection: str) -> None:
    """Create the collection if it does not exist.

    Raises:
        Failure: the name is not one that a collection can have.
    """
    try:
        check_id(collection)
    except ValueError as error:
        raise CommandError(f"collection {collection!r}: {error}") from error
    ensure(database, collection, CollectionPut())


def sentence(report: StandReport) -> str:
    """The outcome of one stem map, in one line."""
    stand, outcome = report.cut, report.outcome
    rate = f"{report.submaps / report.seconds:.0f} submaps/s" if report.seconds > 0 else ""
    parts = [
        f"{report.name}: {stand.trees} trees -> {report.submaps} submaps "
        f"({outcome.created} new, {outcome.replaced} replaced, {outcome.unchanged} unchanged) "
        f"in {report.seconds:.1f} s, {rate}",
        f"{outcome.removed} removed that the stand had before",
        *left_out(stand),
    ]
    if outcome.before is not None and outcome.before != (stand.radius, stand.spacing):
        radius, spacing = outcome.before
        parts.append(f"before, the radius was {radius:g} m and the spacing {spacing:g} m")
    if outcome.adopted:
        parts.append(f"{outcome.adopted} stored submaps that belonged to no stand were taken for this one's")
    if outcome.alike:
        parts.append(f"the stand {outcome.alike[0]!r} has the same trees")
    if outcome.refused:
        parts.append(f"{len(outcome.refused)} submaps refused, the first: {outcome.refused[0].error}")
    return "; ".join(parts)
