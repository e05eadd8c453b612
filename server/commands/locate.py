"""`urquhart locate`: look one observation up in the database, without a service."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError
from rich.console import Console
from rich.table import Table

from server.commands.support.console import wide_console
from server.commands.support.database import existing_database, settings_with
from server.commands.support.explanation_tables import print_explanation
from server.commands.support.failure import CommandError
from server.commands.support.file_options import reads_files
from server.commands.support.options import DatabaseOption
from server.commands.support.place_options import PlaceOptions, reads_place
from server.commands.support.pose_text import pose_lines
from server.commands.support.progress import reading
from server.index.live_indexes import LiveIndexes
from server.observability.metrics import Metrics
from server.parsing.field_errors import sentence
from server.queries.lookup import LookupResult, QueryContext, look_up
from server.queries.query import PlaceQuery
from server.schemas.queries import QueryAnswer, QueryInput
from server.stem_maps.reader import StemMap, read_stem_map
from server.stem_maps.reading.options import ReadOptions
from server.stem_maps.stands import landmarks_of
from server.stem_maps.tiling import without_twins
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from urquhart import Effort
from urquhart.report.explanation import sentence as reason_sentence
from urquhart.verify.distortion import WARNINGS

MinConfidence = Annotated[
    float | None, typer.Option(help="Least confidence that is matched. (default: the collection's)")
]


@reads_files
@reads_place
def locate(
    *,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="The observed trees: a table, a GIS file or a point cloud.")
    ],
    collection: Annotated[str, typer.Option(help="Collection to search.")],
    svg: Annotated[
        Path | None, typer.Option(metavar="OUT", help="Write a drawing of the best candidate's match to this file.")
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Also say what each stage found, and why it rejected it.")
    ] = False,
    explain_svg: Annotated[
        Path | None, typer.Option(metavar="OUT", help="Write a drawing of the explanation to this file.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the whole answer as JSON, as the service returns it.")
    ] = False,
    limit: Annotated[int, typer.Option(min=1, help="Most candidates to print.")] = 5,
    effort: Annotated[Effort, typer.Option(help="How far to search if nothing is found.")] = "full",
    min_confidence: MinConfidence = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of random choices. The same seed gives the same answer.")
    ] = None,
    database: DatabaseOption = None,
    columns: ReadOptions,
    place: PlaceOptions,
) -> None:
    """Find where trees were observed, in the whole collection or, with --at, near a place.

    The observation is a file with one tree on each row, in any frame, read as `urquhart index` does. Diameters count
    if the collection has them, too. The exit code is 0 for every verdict: matched, ambiguous and no_match.
    """
    seen = _observed(file, columns)
    observation = without_twins(seen)
    settings = settings_with(database=database)
    store = existing_database(settings)
    try:
        bring_up_to_date(store)
        indexes, metrics = LiveIndexes(store, Metrics()), Metrics()
        prior = place.prior(store, collection, observation.xy)
        members = {"limit": limit, "effort": effort, "min_confidence": min_confidence, "seed": seed, "prior": prior}
        query = _query(observation, {**members, "explain": explain or explain_svg is not None}, file)
        asked, to_draw = PlaceQuery.of(query, settings.limits), svg is not None or explain_svg is not None
        look = look_up(QueryContext(store, indexes, metrics, settings.limits), collection, asked, to_draw=to_draw)
        _draw(look, observation.name, svg, explain_svg)
    finally:
        store.dispose()
    answer = look.answer
    if as_json:
        typer.echo(answer.model_dump_json(indent=2))
    else:
        console = wide_console()
        _print(console, answer)
        if explain:
            print_explanation(console, answer)
    typer.echo(f"{file.name}: {seen.understood}{_left_out(seen, observation)}", err=as_json)
    for path, is_drawn in ((explain_svg, True), (svg, bool(answer.candidates))):
        if path is not None:
            typer.echo(f"drawn: {path}" if is_drawn else "nothing to draw: there is no candidate", err=as_json)


def _observed(file: Path, columns: ReadOptions) -> StemMap:
    """The observed trees. Raises CommandError if they are of several plots."""
    with reading(file):
        seen = read_stem_map(file, columns, allow_empty=True)
    plots = set(seen.plots or ())
    if len(plots) > 1:
        raise CommandError(f"{file}: has {len(plots)} plots: choose one with --only, such as {min(plots)!r}")
    return seen


def _draw(look: LookupResult, name: str, svg: Path | None, explain_svg: Path | None) -> None:
    """Write the requested drawings: of the best candidate, and of the explanation."""
    answer = look.answer
    if svg is not None and answer.candidates:
        best = answer.candidates[0]
        svg.write_text(look.draw(1, f"{name} on {best.submap_id}: {best.inlier_count} inliers"), encoding="utf-8")
    if explain_svg is not None:
        explain_svg.write_text(look.explain(name).to_svg(), encoding="utf-8")


def _left_out(seen: StemMap, used: StemMap) -> str:
    count = len(seen) - len(used)
    return f"; {count} trees merged with a thicker neighbour within 1 cm" if count else ""


def _query(observation: StemMap, members: Mapping[str, object], file: Path) -> QueryInput:
    try:
        return QueryInput.model_validate({"landmarks": landmarks_of(observation), **members})
    except ValidationError as error:
        first = error.errors()[0]
        if first["loc"][0] == "min_confidence":
            raise CommandError(
                f"--min-confidence {sentence(first)}, not {first['input']} (see urquhart locate --help)"
            ) from error
        raise CommandError(f"{file}: tree value {first['input']!r} {sentence(first)}") from error


def _print(console: Console, answer: QueryAnswer) -> None:
    console.print(f"[bold]{answer.verdict}[/bold] ({answer.reason}), {answer.landmark_count} trees", highlight=False)
    if answer.verdict == "matched":
        best = answer.candidates[0]
        for line in pose_lines(best):
            console.print(line, highlight=False, markup=False, soft_wrap=True)
        console.print(
            f"inliers: {best.inlier_count} of {answer.landmark_count} trees, rms {best.rms:.3f} m", highlight=False
        )
    best_warnings = answer.candidates[0].warnings if answer.verdict == "matched" else []
    for word in (*answer.warnings, *best_warnings):
        console.print(f"warning: {WARNINGS[word]} ({word})", highlight=False, markup=False, soft_wrap=True)
    if answer.verdict == "no_match" and answer.search is not None:
        began = answer.search.stopped_by != "not_started"
        effort = "" if answer.search.stopped_by == "window" else f"effort {answer.effort}: "
        why = f"{effort}{answer.search.sentence}" if began else reason_sentence(answer.reason)
        console.print(why, highlight=False, markup=False, soft_wrap=True)
    if answer.verdict == "ambiguous":
        for rival in answer.rivals:
            there = rival.transform
            console.print(
                f"rival in {rival.submap_id}: x {there.x:.3f} m, y {there.y:.3f} m, "
                f"yaw {math.degrees(there.yaw):.2f} deg; evidence {rival.evidence:.1f}, {rival.inlier_count} inliers",
                highlight=False,
                markup=False,
                soft_wrap=True,
            )
    if answer.candidates:
        console.print(_table(answer))


def _table(answer: QueryAnswer) -> Table:
    """The candidates, a row each."""
    table = Table(box=None)
    table.add_column("rank", justify="right")
    table.add_column("submap", no_wrap=True)  # never cut short: it is the answer
    for name in ("inliers", "ratio", "rms m", "overlap", "support", "level", "log odds", "confidence"):
        table.add_column(name, justify="right")
    table.add_column("refused")
    for one in answer.candidates:
        table.add_row(
            str(one.rank),
            one.submap_id,
            str(one.inlier_count),
            f"{one.inlier_ratio:.2f}",
            f"{one.rms:.3f}",
            f"{one.overlap_ratio:.2f}",
            str(one.support),
            one.level,
            f"{one.log_odds:.1f}",
            f"{one.confidence:.3f}",
            one.refused or "",
        )
    return table
