"""Where commands print their tables."""

from rich.console import Console


def wide_console() -> Console:
    """Standard output, as wide as it needs to be where it is not looked at but read by a program."""
    console = Console()
    return console if console.is_terminal else Console(width=400)
