"""`urquhart map`: one consistent map of the submaps of a collection, without a service."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

import orjson
import typer
from pydantic import BaseModel, ValidationError
from rich.console import Console

from server.commands.support.database import upgraded_database
from server.commands.support.failure import CommandError
from server.commands.support.options import DatabaseOption
from server.commands.support.progress import progress_bar
from server.config.settings import Limits
from server.constraints.search import search_constraints
from server.index.live_indexes import LiveIndexes
from server.maps.applying import apply_map
from server.maps.building import BuiltMap, build, check_optimiser
from server.maps.documents import edges_of, poses_of, summary_of
from server.maps.files import check_suffix, write_trees
from server.maps.selection import choose, chosen_keys
from server.observability.metrics import Metrics
from server.parsing.field_errors import sentence
from server.queries.lookup import QueryContext
from server.schemas.maps import MapInput, MapSummary
from server.store.sqlite.database import Database
from server.store.submap_records import SubmapMetadata

app = typer.Typer(help="Build one consistent map of the submaps of a collection.")


@app.callback()
def _group() -> None:
    """Build one consistent map of the submaps of a collection."""


@app.command("build", epilog="Example: `urquhart map build drives --session mon --session tue --trees site.gpkg`")
def build_map(
    collection: Annotated[str, typer.Argument(metavar="COLLECTION", help="Id of the collection.")],
    session: Annotated[
        list[str] | None, typer.Option(help="Only submaps of this session. May be repeated.", show_default=False)
    ] = None,
    datetime: Annotated[
        str | None, typer.Option(help="Only submaps with a stamp in this interval.", show_default=False)
    ] = None,
    odometry: Annotated[
        Path | None,
        typer.Option(
            help="NDJSON with relative poses that are believed: from, to, x, y, yaw, covariance.", show_default=False
        ),
    ] = None,
    use_map_poses: Annotated[
        bool, typer.Option("--use-map-poses", help="Use map poses that have a covariance as priors.")
    ] = False,
    agreeing: Annotated[int, typer.Option(min=1, max=2, help="Matches that must agree before one is believed.")] = 2,
    association: Annotated[
        Literal["joint", "dbscan"], typer.Option(help="How trees of several submaps become one.")
    ] = "joint",
    trees: Annotated[
        Path | None, typer.Option(help="Write the trees to this file, CSV or GeoPackage.", show_default=False)
    ] = None,
    poses: Annotated[
        Path | None, typer.Option(help="Write the poses to this file, NDJSON.", show_default=False)
    ] = None,
    constraints: Annotated[
        Path | None,
        typer.Option(help="Write what became of each constraint to this file, NDJSON.", show_default=False),
    ] = None,
    apply: Annotated[
        bool, typer.Option("--apply", help="Write the poses into the submaps, all in one transaction.")
    ] = False,
    frame: Annotated[str, typer.Option(help="Map frame of the poses.")] = "map",
    database: DatabaseOption = None,
) -> None:
    """Match the submaps of a collection with each other, optimise their poses, and merge their trees.

    Matches that contradict the others are left out. Parts that nothing connects get map frames of their own. Nothing
    is stored without --apply.
    """
    body = _input(
        {
            "sessions": session,
            "datetime": datetime,
            "odometry": None if odometry is None else _lines(odometry),
            "use_map_poses": use_map_poses,
            "agreeing": agreeing,
            "association": association,
            "apply": apply,
            "map_frame_id": frame,
        },
        odometry,
    )
    check_optimiser()
    if trees is not None:
        check_suffix(trees)
    with upgraded_database(database) as store:
        built = _built(store, collection, body)
        version = None
        if apply:
            with store.write() as tx:
                version = apply_map(tx, collection, built)
        written = None
        if trees is not None:
            with store.read() as tx:
                written = write_trees(tx, collection, built, trees)
    for path, rows in ((poses, poses_of(built)), (constraints, edges_of(built))):
        if path is not None:
            _write(path, rows)
    _tell(summary_of(built))
    if written is not None:
        typer.echo(f"{written} trees written to {trees}")
    if version is not None:
        typer.echo(f"poses applied: revision {version} of {collection}")


def _built(store: Database, collection: str, body: MapInput) -> BuiltMap:
    """The map: its submaps are matched, then optimised and merged."""
    console = Console(stderr=True)
    context = QueryContext(store, LiveIndexes(store, Metrics()), Metrics(), Limits())
    with store.read() as tx:
        key = tx.collections.get(collection)
        keys = chosen_keys(tx, collection, body)
        rows = [] if key is None else tx.submaps(key.key).some(keys, SubmapMetadata)
    with progress_bar(console) as progress:
        task = progress.add_task("matching", total=len(rows))
        found, contradictions = search_constraints(context, collection, rows, body, lambda: progress.advance(task))
    if contradictions:
        typer.echo(f"{contradictions} pairs left out: their two directions contradict each other", err=True)
    with store.read() as tx:
        chosen = choose(tx, collection, body)
    with console.status("optimising"):
        return build(chosen, found, body)


def _input(members: dict[str, Any], odometry: Path | None) -> MapInput:
    try:
        return MapInput.model_validate(members)
    except ValidationError as error:
        first = error.errors()[0]
        place, *rest = first["loc"]
        if place == "odometry" and rest:
            where = ".".join(map(str, rest[1:])) or "the line"
            raise CommandError(f"{odometry}, line {int(rest[0]) + 1}: {where} {sentence(first)}") from error
        raise CommandError(f"--{str(place).replace('_', '-')} {sentence(first)}") from error


def _lines(path: Path) -> list[Any]:
    """The lines of an NDJSON file. Raises CommandError."""
    found = []
    for number, line in enumerate(path.read_bytes().splitlines(), start=1):
        try:
            found.append(orjson.loads(line))
        except orjson.JSONDecodeError as error:
            raise CommandError(f"{path}, line {number}: is not JSON: {error}") from error
    return found


def _write(path: Path, rows: Iterable[BaseModel]) -> None:
    with path.open("wb") as file:
        file.writelines(row.model_dump_json(by_alias=True).encode() + b"\n" for row in rows)


def _tell(told: MapSummary) -> None:
    """Print a map in numbers."""
    connected = [size for size in told.parts if size > 1]
    alone = len(told.parts) - len(connected)
    typer.echo(f"{told.submaps} submaps: {len(connected)} connected parts ({', '.join(map(str, connected)) or 'none'})")
    if alone:
        typer.echo(f"{alone} submaps that nothing connects with others are left out")
    used = told.constraints - told.contradicted - told.unconfirmed
    typer.echo(
        f"{used} of {told.constraints} constraints used; {told.contradicted} contradicted by others, "
        f"{told.unconfirmed} unconfirmed"
    )
    typer.echo(f"{told.trees} trees, noise {told.noise:.3f} m")
