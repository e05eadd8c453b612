"""`urquhart demo`: real forests, recognised over HTTP."""

from pathlib import Path
from typing import Annotated, Final

import typer

from server.commands.support.failure import CommandError

STEM_MAPS: Final = Path(__file__).resolve().parents[3] / "data" / "stem_maps"


def demo(
    keep: Annotated[
        bool, typer.Option("--keep", help="Leave the service running, and say how to reach and stop it.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of places and noise: the same seed asks the same questions.")] = 1,
    observations: Annotated[
        int, typer.Option(min=2, max=10_000, help="Observations of the two forests in the database, half of each.")
    ] = 40,
    out: Annotated[Path, typer.Option(help="Directory for the database, the drawings and the log.")] = Path(
        "demo-output"
    ),
    data: Annotated[
        Path,
        typer.Option(
            help="Directory with lansing.csv, bei.csv and longleaf.csv. (default: data/stem_maps of the repository)",
            show_default=False,
        ),
    ] = STEM_MAPS,
) -> None:
    """Recognise places in real forests, over HTTP.

    Stores two stem maps as overlapping submaps, starts the service, asks it about observations from unknown places in
    them, and about 10 from a third forest that it does not know, and prints every verdict with its error. The exit code
    is 0 when at least 95 % of the answers are right and none is wrong.
    """
    try:
        # Only here: the client is a distribution of its own, and the other verbs do without it.
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
