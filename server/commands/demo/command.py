"""`urquhart demo`: recognise places in real forests over HTTP."""

from pathlib import Path
from typing import Annotated, Final

import typer

from server.commands.support.failure import CommandError

STEM_MAPS: Final = Path(__file__).resolve().parents[3] / "data" / "stem_maps"


def demo(
    keep: Annotated[
        bool, typer.Option("--keep", help="Leave the service running, and say how to use and stop it.")
    ] = False,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of places and noise. The same seed makes the same observations.")
    ] = 1,
    observations: Annotated[
        int, typer.Option(min=2, max=10_000, help="Number of observations in the two stored forests, half in each.")
    ] = 40,
    out: Annotated[Path, typer.Option(help="Folder for the database, the drawings and the log.")] = Path("demo-output"),
    data: Annotated[
        Path,
        typer.Option(
            help="Folder with lansing.csv, bei.csv and longleaf.csv. (default: data/stem_maps of the repository)",
            show_default=False,
        ),
    ] = STEM_MAPS,
) -> None:
    """Recognise places in real forests, over HTTP.

    Stores two stem maps as overlapping submaps, starts the service, and sends it observations from random places in
    them and 10 from a third forest that is not stored. Prints every verdict with its error. The exit code is 0 if at
    least 95 % of the answers are right and none is wrong.
    """
    try:
        # Imported here because the client is a distribution of its own, which the other commands do not need.
        from server.commands.demo.journey import run
        from urquhart_client import UrquhartError
    except ModuleNotFoundError as error:
        if error.name != "urquhart_client":
            raise
        raise CommandError("the demo needs the Python client: pip install ./clients/python") from error
    try:
        passed = run(out, data, seed=seed, observations=observations, keep=keep)
    except UrquhartError as error:
        raise CommandError(
            f"a request of the demo failed: {error} (log of the service: {out / 'server.log'})"
        ) from error
    if not passed:
        raise typer.Exit(1)
