"""`urquhart locate`: look one observation up in the database, without a service."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from server.commands.support.answer_text import print_answer
from server.commands.support.console import wide_console
from server.commands.support.database import existing_database, settings_with
from server.commands.support.explanation_tables import print_explanation
from server.commands.support.failure import CommandError
from server.commands.support.file_options import reads_files
from server.commands.support.options import DatabaseOption
from server.commands.support.place_options import PlaceOptions, reads_place
from server.commands.support.progress import reading
from server.coregistration.located import place_observation
from server.coregistration.outputs.picture import draw_plot
from server.coregistration.outputs.tables import pairs_table
from server.coregistration.results import PlotResult
from server.index.live_indexes import LiveIndexes
from server.observability.metrics import Metrics
from server.parsing.field_errors import sentence
from server.queries.lookup import LookupResult, QueryContext, look_up
from server.queries.query import PlaceQuery
from server.schemas.queries import QueryInput
from server.stem_maps.reader import StemMap, read_stem_map
from server.stem_maps.reading.options import ReadOptions
from server.stem_maps.stands import landmarks_of
from server.stem_maps.tiling import merged_phrase, without_twins
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from urquhart import Effort

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
    svg: Annotated[Path | None, typer.Option(metavar="OUT", help="Draw the match to this file.")] = None,
    pairs: Annotated[
        Path | None, typer.Option(metavar="OUT", help="Write all trees with their partners to this file, as CSV.")
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
        prior = place.prior(store, collection, observation.xy)
        members = {"limit": limit, "effort": effort, "min_confidence": min_confidence, "seed": seed, "prior": prior}
        query = _query(observation, {**members, "explain": explain or explain_svg is not None}, file)
        context = QueryContext(store, LiveIndexes(store, Metrics()), Metrics(), settings.limits)
        asked = replace(PlaceQuery.of(query, settings.limits), hints=True)
        look = look_up(context, collection, asked, to_draw=bool(svg or explain_svg))
        look, placed = _placed(context, collection, (file, observation, look), asked)
        written = list(_write(look, placed, observation.name, _Files(svg, explain_svg, pairs)))
    finally:
        store.dispose()
    if as_json:
        typer.echo(look.answer.model_dump_json(indent=2))
    else:
        console = wide_console()
        print_answer(console, look.answer, placed)
        if explain:
            print_explanation(console, look.answer)
    typer.echo(f"{file.name}: {seen.understood}{_left_out(seen, observation)}", err=as_json)
    for line in [*([placed.sentence] if as_json and placed and placed.reason == "angle_unit" else []), *written]:
        typer.echo(line, err=as_json)


def _in_gon(
    context: QueryContext, collection: str, seen: tuple[StemMap, LookupResult], asked: PlaceQuery
) -> tuple[StemMap, LookupResult] | None:
    """The trees with azimuths in gon, and the answer for these; None if the unit of azimuths is known."""
    observation, look = seen
    trees = observation.in_gon()
    if trees is None:
        return None
    assert asked.landmarks is not None  # the file's
    query = replace(asked, landmarks=replace(asked.landmarks, xy=trees.xy), explain=False, hints=False)
    if look.answer.verdict == "matched":
        query = replace(query, effort="fast")  # only what is surely found can be better than a match
    return trees, look_up(context, collection, query)


def _placed(
    context: QueryContext,
    collection: str,
    seen: tuple[Path, StemMap, LookupResult],
    asked: PlaceQuery,
) -> tuple[LookupResult, PlotResult | None]:
    """The answer, and the trees against all trees of the map, or the places that fit; None if nothing was found.

    The answer is not matched if azimuths that name no unit fit better in gon.
    """
    file, observation, look = seen
    gon = _in_gon(context, collection, (observation, look), asked)
    if look.answer.verdict == "no_match" and (gon is None or gon[1].answer.verdict == "no_match"):
        return look, None
    placed = place_observation(context, collection, file, (observation, look), gon)
    if placed.reason == "angle_unit":
        told = {**look.members, "verdict": placed.outcome, "reason": placed.reason}
        return replace(look, members=told), placed
    return look, None if placed.outcome == "no_match" else placed


def _write(look: LookupResult, placed: PlotResult | None, name: str, files: "_Files") -> Iterator[str]:
    """Write what is asked for: the explanation, the match, the pairs of trees. Yields a line for each."""
    answer, is_placed = look.answer, placed is not None and placed.pose is not None
    if files.explain_svg is not None:
        files.explain_svg.write_text(look.explain(name).to_svg(), encoding="utf-8")
        yield f"drawn: {files.explain_svg}"
    if files.svg is not None:
        if placed is not None and is_placed:
            files.svg.write_text(draw_plot(placed, answer.collection), encoding="utf-8")
        elif answer.candidates:
            best = answer.candidates[0]
            title = f"{name} on {best.submap_id}: {best.inlier_count} inliers"
            files.svg.write_text(look.draw(1, title), encoding="utf-8")
        is_drawn = bool(answer.candidates)
        yield f"drawn: {files.svg}" if is_drawn else "nothing to draw: there is no candidate"
    if files.pairs is not None:
        if placed is not None and is_placed:
            pairs_table([placed]).write_csv(files.pairs)
        yield f"written: {files.pairs}" if is_placed else "no pairs to write: the trees are not matched"


@dataclass(frozen=True, slots=True)
class _Files:
    """Where to write what is asked for, besides the answer."""

    svg: Path | None
    explain_svg: Path | None
    pairs: Path | None


def _observed(file: Path, columns: ReadOptions) -> StemMap:
    """The observed trees. Raises CommandError if they are of several plots."""
    with reading(file):
        seen = read_stem_map(file, columns, allow_empty=True)
    plots = set(seen.plots or ())
    if len(plots) > 1:
        raise CommandError(f"{file}: has {len(plots)} plots: choose one with --only, such as {min(plots)!r}")
    return seen


def _left_out(seen: StemMap, used: StemMap) -> str:
    count = len(seen) - len(used)
    return f"; {merged_phrase(count)}" if count else ""


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
