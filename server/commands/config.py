"""`urquhart config`: print the settings in force, and where each comes from."""

from typing import Annotated

import typer

from server.commands.support.options import ConfigOption
from server.config import settings_loading, settings_report


def config(
    file: ConfigOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the settings as a JSON array.")] = False,
    as_markdown: Annotated[
        bool, typer.Option("--markdown", help="Print the documentation of all settings instead of their values.")
    ] = False,
) -> None:
    """Print every setting with its value, its default and the source of the value.

    Options take precedence over the environment, and the environment over the file. Invalid settings are refused, so
    this also checks a settings file.
    """
    if as_markdown:
        typer.echo(settings_report.as_markdown(), nl=False)
        return
    settings = settings_loading.load(config=file)
    told = settings_report.describe(settings, config=file)
    typer.echo(settings_report.as_json(told) if as_json else settings_report.as_text(told))
