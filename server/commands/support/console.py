"""The console for tables."""

from rich.console import Console


def wide_console() -> Console:
    """Standard output. If it is not a terminal, it is as wide as the text needs."""
    console = Console()
    return console if console.is_terminal else Console(width=400)
