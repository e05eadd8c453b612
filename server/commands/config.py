"""`urquhart config`: what is set, and where."""

from pathlib import Path
from typing import Annotated

import typer

from server import configuration

ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        help="The settings file, TOML. (default: URQUHART_CONFIG, or urquhart.toml where it is there)",
        show_default=False,
    ),
]


def config(
    file: ConfigOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON array.")] = False,
    as_markdown: Annotated[
        bool, typer.Option("--markdown", help="Print the documentation of all settings, not what is set.")
    ] = False,
) -> None:
    """Print every setting with its value, its default and where the value comes from.

    An option goes before the environment, the environment before the file. What cannot be used is refused, so this
    also checks a file before a service is started with it.
    """
    if as_markdown:
        typer.echo(configuration.as_markdown(), nl=False)
        return
    settings = configuration.load(config=file)
    told = configuration.told(settings, config=file)
    typer.echo(configuration.as_json(told) if as_json else configuration.as_text(told))
