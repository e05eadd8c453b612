"""`urquhart reference`: the API reference as a Markdown page, or the OpenAPI document."""

import json
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from server.app import create_app
from server.config.settings import Settings
from server.http.documentation.reference import reference


def reference_page(
    openapi: Annotated[bool, typer.Option("--openapi", help="Print the OpenAPI document as JSON instead.")] = False,
) -> None:
    """Print the API reference as Markdown."""
    with tempfile.TemporaryDirectory() as folder:
        app = create_app(Settings(database=str(Path(folder) / "none.db")))
        document = app.openapi()
        if openapi:
            typer.echo(json.dumps(document, indent=1, sort_keys=True))
        else:
            typer.echo(reference(document), nl=False)
        app.state.service.database.dispose()
