"""`urquhart reference`: the API reference as a Markdown page."""

import tempfile
from pathlib import Path

import typer

from server.app import create_app
from server.config.settings import Settings
from server.http.documentation.reference import reference


def reference_page() -> None:
    """Print the API reference as Markdown."""
    with tempfile.TemporaryDirectory() as folder:
        app = create_app(Settings(database=str(Path(folder) / "none.db")))
        typer.echo(reference(app.openapi()), nl=False)
        app.state.service.database.dispose()
