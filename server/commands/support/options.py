"""Options that several commands share: the database, the settings file, the columns of a stem map."""

from pathlib import Path
from typing import Annotated, Literal

import typer

DbhUnit = Annotated[
    Literal["cm", "mm", "m", "in"] | None,
    typer.Option(
        help="Unit of a column that is named dbh. (default: cm, if the median is plausible for a stand)",
        show_default=False,
    ),
]
Ignored = Annotated[
    list[str] | None,
    typer.Option(
        "--ignore", metavar="COLUMN", help="A column to ignore. Repeat the option for several.", show_default=False
    ),
]


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
