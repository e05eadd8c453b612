"""Text that a spreadsheet would take for a formula: written with an apostrophe before it, which the reader takes away.

A tag such as `=HYPERLINK("http://...")` of somebody else's file would otherwise run when a table is opened.
"""

import re
from typing import Final

_FORMULA: Final = re.compile("'*[=+\\-@\t\r\uff1d\uff0b\uff0d\uff20]")
"""How a formula begins; also in the wide letters of East Asian keyboards. Apostrophes that stand before are kept."""


def guarded(text: str) -> str:
    """`text` as it is written into a table for spreadsheets. Numbers, also negative ones, stay as they are."""
    return f"'{text}" if _FORMULA.match(text) and not _is_number(text) else text


def unguarded(text: str) -> str:
    """The text that `guarded` wrote."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
