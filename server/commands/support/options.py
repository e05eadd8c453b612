"""Options that several commands share: the database, the settings file, what the columns of a stem map mean."""

from pathlib import Path
from typing import Annotated, Literal

import typer

DbhUnit = Annotated[
    Literal["cm", "mm", "m", "in"] | None,
    typer.Option(
        help="Unit of a column that is called dbh. (default: cm, where the median can be that of a stand)",
        show_default=False,
    ),
]
Ignored = Annotated[
    list[str] | None,
    typer.Option(
        "--ignore", metavar="COLUMN", help="A column that means nothing here; may be given again.", show_default=False
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
        help="The settings file, TOML. (default: URQUHART_CONFIG, or urquhart.toml where it is there)",
        show_default=False,
    ),
]
