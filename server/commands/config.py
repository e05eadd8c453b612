"""`urquhart config`: what is set, and where."""

from typing import Annotated

import typer

from server.commands.support.options import ConfigOption
from server.config import settings_loading, settings_report


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
        typer.echo(settings_report.as_markdown(), nl=False)
        return
    settings = settings_loading.load(config=file)
    told = settings_report.describe(settings, config=file)
    typer.echo(settings_report.as_json(told) if as_json else settings_report.as_text(told))
