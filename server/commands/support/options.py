"""Options that several commands share: the database and the settings file."""

from pathlib import Path
from typing import Annotated

import typer

DatabaseOption = Annotated[
    Path | None,
    typer.Option("--database", help="The SQLite file. (default: URQUHART_DATABASE or urquhart.db)", show_default=False),
]


ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        help="The settings file, in TOML. (default: URQUHART_CONFIG, or urquhart.toml if it exists)",
        show_default=False,
    ),
]
