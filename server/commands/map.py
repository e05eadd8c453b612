"""`urquhart map`: one consistent map of the submaps of a collection, without a service."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import orjson
import typer
from pydantic import BaseModel, ValidationError
from rich.console import Console

from server.collections.crud import get_collection
from server.commands.support.database import upgraded_database
from server.commands.support.failure import CommandError
from server.commands.support.options import DatabaseOption
from server.commands.support.progress import ProgressReport
from server.config.settings import Limits
from server.constraints.extraction import search_of
from server.constraints.rows import export, store_found
from server.constraints.search import search_constraints
from server.index.live_indexes import LiveIndexes
from server.maps.applying import apply_map
from server.maps.building import BuiltMap, build, check_optimiser
from server.maps.documents import edges_of, poses_of, sentence_of, summary_of
from server.maps.files import write_trees
from server.maps.merging import apply_merge, check_frames, merge, pairs_of, searched
from server.maps.merging import summary_of as summary_of_merge
from server.maps.selection import choose, chosen_keys
from server.observability.metrics import Metrics
from server.outputs.files import format_of
from server.parsing.field_errors import sentence
from server.queries.lookup import QueryContext
from server.schemas.constraints import ConstraintsInput
from server.schemas.maps.answers import MapSummary
from server.schemas.maps.constraint_rows import KeptKind, KeptState, StoredFormat
from server.schemas.maps.merges import MergeInput
from server.schemas.maps.request import MapInput
from server.store.repositories.maps.constraint_records import ConstraintFilter
from server.store.sqlite.database import Database
from server.store.submap_records import SubmapFilter, SubmapMetadata

app = typer.Typer(help="Build one consistent map of the submaps of a collection.")


@app.callback()
def _group() -> None:
    """Build one consistent map of the submaps of a collection."""


CollectionArgument = Annotated[str, typer.Argument(metavar="COLLECTION", help="Id of the collection.")]
SessionOption = Annotated[
    list[str] | None, typer.Option(help="Only submaps of this session. May be repeated.", show_default=False)
]
DatetimeOption = Annotated[
    str | None, typer.Option(help="Only submaps with a stamp in this interval.", show_default=False)
]
OdometryOption = Annotated[
    Path | None,
    typer.Option(
        help="NDJSON with relative poses, believed unless matches prove them wrong: from, to, x, y, yaw, covariance.",
        show_default=False,
    ),
]
PriorsOption = Annotated[bool, typer.Option("--use-map-poses", help="Use map poses that have a covariance as priors.")]
AgreeingOption = Annotated[int, typer.Option(min=1, max=2, help="Matches that must agree before one is believed.")]
AssociationOption = Annotated[Literal["joint", "dbscan"], typer.Option(help="How trees of several submaps become one.")]
TreesOption = Annotated[
    Path | None,
    typer.Option(
        help="Write the trees to this file: .csv, .geojson, .gpkg or .parquet. Other parts get files of their own.",
        show_default=False,
    ),
]
PosesOption = Annotated[Path | None, typer.Option(help="Write the poses to this file, NDJSON.", show_default=False)]
ConstraintsOption = Annotated[
    Path | None, typer.Option(help="Write what became of each constraint to this file, NDJSON.", show_default=False)
]
ApplyOption = Annotated[bool, typer.Option("--apply", help="Write the poses into the submaps, all in one transaction.")]


@app.command("build", epilog="Example: `urquhart map build drives --session mon --session tue --trees site.gpkg`")
def build_map(
    collection: CollectionArgument,
    session: SessionOption = None,
    datetime: DatetimeOption = None,
    odometry: OdometryOption = None,
    use_map_poses: PriorsOption = False,
    agreeing: AgreeingOption = 2,
    association: AssociationOption = "joint",
    trees: TreesOption = None,
    poses: PosesOption = None,
    constraints: ConstraintsOption = None,
    apply: ApplyOption = False,
    frame: Annotated[str, typer.Option(help="Map frame of the poses.")] = "map",
    database: DatabaseOption = None,
) -> None:
    """Match the submaps of a collection with each other, optimise their poses, and merge their trees.

    Matches that contradict the others are left out. Parts that nothing connects get map frames of their own. The
    collection keeps the matches; only submaps that are new or changed are matched again. No pose is stored without
    --apply.
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
        format_of(trees)
    with upgraded_database(database) as store:
        built = _built(store, collection, body)
        version = None
        if apply:
            with store.write() as tx:
                version = apply_map(tx, collection, built)
        written = list[tuple[Path, int]]()
        if trees is not None:
            with store.read() as tx:
                written = write_trees(tx, collection, built, trees)
    for path, rows in ((poses, poses_of(built)), (constraints, edges_of(built))):
        if path is not None:
            _write(path, rows)
    _tell(summary_of(built))
    for one in built.poses.contradictions:
        typer.echo(f"{one.outcome}: {sentence_of(built, one)}")
    for file, count in written:
        typer.echo(f"{file}: {count} trees")
    if version is not None:
        typer.echo(f"poses applied: revision {version} of {collection}")


@app.command("constraints", epilog="Example: `urquhart map constraints drives --format g2o --out drives.g2o`")
def write_constraints(
    collection: CollectionArgument,
    form: Annotated[StoredFormat, typer.Option("--format", help="Format of the file.")] = "ndjson",
    kind: Annotated[KeptKind | None, typer.Option(help="Only matches, or only odometry.")] = None,
    state: Annotated[KeptState | None, typer.Option(help="Only constraints in this state.")] = None,
    frame: Annotated[
        str | None, typer.Option(help="Map frame in which the submaps of g2o, TUM and KITTI start.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write to this file.", show_default="the terminal")] = None,
    database: DatabaseOption = None,
) -> None:
    """Write the constraints that a collection keeps: matches that maps and jobs found, and odometry that was posted."""
    with upgraded_database(database) as store:
        content = export(store, collection, ConstraintFilter(kind, state), (form, frame))
    if out is None:
        typer.echo(content.decode(), nl=False)
    else:
        out.write_bytes(content)


@app.command("merge", epilog="Example: `urquhart map merge drives --from robot2 --to robot1 --apply`")
def merge_frames(
    collection: CollectionArgument,
    source: Annotated[str, typer.Option("--from", help="The map frame that is laid onto the other one.")],
    target: Annotated[str, typer.Option("--to", help="The map frame that stays.")],
    pairs: Annotated[
        Path | None, typer.Option(help="Write what became of each match to this file, NDJSON.", show_default=False)
    ] = None,
    apply: Annotated[bool, typer.Option("--apply", help="Move all submaps of --from, in one transaction.")] = False,
    database: DatabaseOption = None,
) -> None:
    """Lay one map frame onto another by the matches between their submaps.

    The pose that most matches agree on joins the frames, if at least 4 of them have no submap in common. Nothing moves
    without --apply.
    """
    body = MergeInput.model_validate({"from": source, "to": target, "apply": apply})
    wanted = searched(body)
    with upgraded_database(database) as store:
        with store.read() as tx:
            check_frames(tx, collection, body)
            keys = tx.submaps(get_collection(tx, collection).key).matching(SubmapFilter(map_frame_id=source))
        _search(store, collection, sorted(keys), wanted)
        with store.read() as tx:
            made = merge(tx, collection, body, search_of(wanted))
        told, version = summary_of_merge(made), None
        if apply:
            with store.write() as tx:
                version = apply_merge(tx, collection, made)
    if pairs is not None:
        _write(pairs, pairs_of(made))
    typer.echo(f"{told.verdict}: {told.used} of {told.used + told.refused} matches used, {told.agreeing} independent")
    if told.transform is not None:
        at = told.transform
        typer.echo(f"{target}_T_{source}: x {at.x:.3f} m, y {at.y:.3f} m, yaw {math.degrees(at.yaw):.3f} degrees")
    if version is not None:
        typer.echo(f"{told.submaps} submaps moved: revision {version} of {collection}")


def _search(store: Database, collection: str, keys: Sequence[int], body: ConstraintsInput) -> None:
    """Look up those of the submaps that are new or changed, and store the constraints that are found."""
    context = QueryContext(store, LiveIndexes(store, Metrics()), Metrics(), Limits())
    with store.read() as tx:
        key = get_collection(tx, collection).key
        rows = tx.submaps(key).some(keys, SubmapMetadata)
        if body.changed_only:
            known = tx.constraints(key).searched(search_of(body))
            rows = [row for row in rows if known.get(row.key) != row.content_revision]
    with ProgressReport(Console(stderr=True), "submaps") as progress:
        advance = progress.task("matching", len(rows))
        found, contradictions = search_constraints(context, collection, rows, body, lambda: advance(1))
    if contradictions:
        typer.echo(f"{contradictions} pairs left out: their two directions contradict each other", err=True)
    with store.write() as tx:
        looked_up = {row.id: (row.key, row.content_revision) for row in rows}
        store_found(tx, key, found, looked_up, (search_of(body), None))


def _built(store: Database, collection: str, body: MapInput) -> BuiltMap:
    """The map: its submaps are matched, then optimised and merged."""
    with store.read() as tx:
        keys = chosen_keys(tx, collection, body)
    _search(store, collection, keys, body)
    with store.read() as tx:
        chosen = choose(tx, collection, body)
        kept = tx.constraints(get_collection(tx, collection).key).page(ConstraintFilter(search=search_of(body)))
    with Console(stderr=True).status("optimising"):
        return build(chosen, kept, body)


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
    connected = [size for size in told.parts if size > 1 or told.submaps == 1]
    alone = len(told.parts) - len(connected)
    typer.echo(f"{told.submaps} submaps: {len(connected)} connected parts ({', '.join(map(str, connected)) or 'none'})")
    if alone:
        typer.echo(f"{alone} submaps that nothing connects with others are left out")
    used = told.constraints - told.contradicted - told.unconfirmed - told.undecided
    typer.echo(
        f"{used} of {told.constraints} constraints used; {told.contradicted} contradicted by others, "
        f"{told.unconfirmed} unconfirmed" + (f", {told.undecided} undecided" if told.undecided else "")
    )
    typer.echo(f"{told.trees} trees, noise {told.noise:.3f} m")
