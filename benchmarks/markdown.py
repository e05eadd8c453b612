"""A little Markdown: paragraphs filled to the project's line length, tables, lists, pictures."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import Final

WIDTH: Final = 120
_KEPT: Final = "\0"
FOLDER: Final = "results"
"""Where figures and pictures lie beside the page."""


def page(*parts: str) -> str:
    """Parts with a blank line between them; empty ones are left out."""
    return "\n\n".join(part.strip() for part in parts if part.strip()) + "\n"


def prose(text: str) -> str:
    """A paragraph, however it was broken into lines; what stands in backticks stays in one line."""
    parts = " ".join(text.split()).split("`")
    parts[1::2] = [part.replace(" ", _KEPT) for part in parts[1::2]]
    filled = textwrap.fill("`".join(parts), WIDTH, break_long_words=False, break_on_hyphens=False)
    return filled.replace(_KEPT, " ")


def bullets(items: Iterable[str]) -> str:
    """A list of paragraphs."""
    return "\n".join("- " + textwrap.indent(prose(item), "  ").strip() for item in items)


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, words: int = 1) -> str:
    """A table; the first `words` columns to the left, all others to the right."""
    lines = [_row(head), _row(["---"] * words + ["---:"] * (len(head) - words))]
    return "\n".join([*lines, *(_row(row) for row in rows)])


def picture(name: str, what: str) -> str:
    """A picture of the results folder."""
    return f"![{what}]({FOLDER}/{name}.svg)"


def number(value: float | None, digits: int = 2) -> str:
    """A figure with so many digits after the point; a dash where there is none."""
    return "-" if value is None or value != value else f"{value:.{digits}f}"


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
