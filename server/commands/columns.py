"""Options that say what the columns of a stem map mean, shared by the commands that read one."""

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
