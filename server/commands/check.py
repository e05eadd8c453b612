"""`urquhart check`: what a file of trees holds and how it is understood; stores nothing."""

from pathlib import Path
from typing import Annotated, Final

import typer

from server.commands.support.failure import CommandError
from server.commands.support.file_options import reads_files
from server.commands.support.progress import reading
from server.stem_maps.formats.table import StemMapError
from server.stem_maps.reader import read_trees
from server.stem_maps.reading.options import ReadOptions
from server.stem_maps.reading.plausibility import check_plausible
from server.stem_maps.reading.trees import TreeRows
from server.stem_maps.survey import survey

_SHOWN: Final = 20
"""Bad rows on the terminal; `--errors` gets all."""


@reads_files
def check(
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The trees: a table, a GIS file or a point cloud.")],
    svg: Annotated[Path | None, typer.Option(metavar="OUT", help="Write a drawing of the trees to this file.")] = None,
    errors: Annotated[
        Path | None, typer.Option(metavar="OUT", help="Write every row that cannot be used to this file.")
    ] = None,
    columns: ReadOptions,
) -> None:
    """Show how a file is understood, and what is in it. Nothing is stored.

    The file is read as `urquhart index` and `urquhart locate` read it. If rows cannot be used, they are all listed as
    FILE:LINE: COLUMN: WHAT. The exit code is 2 if `index` would refuse the file.
    """
    with reading(file):
        trees = read_trees(file, columns)
    refused: StemMapError | None = None
    try:
        check_plausible(trees)
    except StemMapError as error:
        refused = error
    found = survey(trees)
    typer.echo(f"{file.name}: {trees.told()}")
    for name, figure in found.lines():
        typer.echo(f"  {name:<11}{figure}")
    if svg is not None and len(trees):
        svg.write_text(found.draw(), encoding="utf-8")
        typer.echo(f"drawn: {svg}")
    has_bad_rows = _list_bad_rows(trees, errors)
    if refused is not None:
        raise refused
    if has_bad_rows:
        raise typer.Exit(2)
    if not len(trees):
        raise CommandError(f"{file}: the file has a header but no trees")


def _list_bad_rows(trees: TreeRows, errors: Path | None) -> bool:
    """List the rows that cannot be used. Returns whether they make the file unusable."""
    lines = [row.described(trees.path) for row in sorted(trees.bad_rows, key=lambda row: row.line)]
    if errors is not None:
        errors.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    if trees.options.skip_bad or not lines:
        return False
    for line in lines[:_SHOWN]:
        typer.echo(line, err=True)
    if len(lines) > _SHOWN:
        where = f"all {len(lines)} are in {errors}" if errors is not None else "--errors FILE lists all"
        typer.echo(f"and {len(lines) - _SHOWN} more: {where}", err=True)
    return True
