"""Every measurement: where it is made, what has to be there before, and for which sizes."""

from dataclasses import dataclass
from typing import Final

SIZES: Final = (1_000, 10_000, 100_000, 1_000_000)
"""Submaps."""


@dataclass(frozen=True, slots=True)
class Part:
    """A measurement.

    Attributes:
        module: of this package, with a function `run`; imported by no process that measures something else.
        after: what has to be measured before; made again when one of those is.
        runs: how often, each in a fresh process; the median is kept.
        largest: submaps beyond which it is left out.
        asked: queries (a quick run asks fewer).
        forest: what is stored; see `tiled_forest.FORESTS`.
    """

    module: str
    after: tuple[str, ...]
    runs: int = 1
    largest: int = SIZES[-1]
    asked: int = 0
    forest: str = "paper"


PARTS: Final = {
    "simulate": Part("simulate", ()),
    "ingest": Part("ingest", ("simulate",)),
    "compile": Part("start", ("ingest",), largest=SIZES[0], asked=1),
    "start": Part("start", ("ingest",), runs=3, asked=1),
    "inside-20": Part("asking", ("ingest",), asked=1_000),
    "outside-20": Part("asking", ("ingest",), asked=1_000),
    "inside-40": Part("asking", ("ingest",), asked=1_000),
    "outside-40": Part("asking", ("ingest",), asked=1_000),
    "inside-20-full": Part("asking", ("ingest",), asked=300),
    "outside-20-full": Part("asking", ("ingest",), asked=300),
    "inside-40-full": Part("asking", ("ingest",), asked=1_000),
    "dense-simulate": Part("simulate", (), largest=100_000, forest="dense"),
    "dense-ingest": Part("ingest", ("dense-simulate",), largest=100_000, forest="dense"),
    "dense-inside-20": Part("asking", ("dense-ingest",), largest=100_000, asked=500, forest="dense"),
    "dense-outside-20": Part("asking", ("dense-ingest",), largest=100_000, asked=500, forest="dense"),
    "dense-inside-20-full": Part("asking", ("dense-ingest",), largest=100_000, asked=200, forest="dense"),
    "dense-outside-20-full": Part("asking", ("dense-ingest",), largest=100_000, asked=200, forest="dense"),
    "threads": Part("threads", ("ingest",), asked=200),
    "http": Part("http_overhead", ("ingest",), asked=200),
    "rival-quads": Part("rivals.compare", ("simulate",), largest=100_000, asked=200),
    "rival-triangles": Part("rivals.compare", ("simulate",), largest=100_000, asked=200),
    "rival-exhaustive": Part("rivals.compare", ("simulate",), largest=SIZES[0], asked=20),
}
"""In the order in which they are run."""

RIVALS: Final = tuple(name for name in PARTS if name.startswith("rival-"))
EXACT_UP_TO: Final = SIZES[0]
"""Submaps up to which FAISS compares with all; beyond, it has inverted lists."""
COMPARED: Final = tuple(sorted({PARTS[name].asked for name in RIVALS}))
"""Queries that some rival is asked: the first of those from inside."""
_QUICK: Final = 20


def asked(name: str, submaps: int, quick: bool) -> int:
    """Queries that a part asks at a size."""
    usual = PARTS[name].asked
    if quick:
        return min(usual, _QUICK)
    if name == "outside-20" and submaps == 100_000:
        # Where a false match would be found, if one in ten thousand is false.
        return 10_000
    if submaps > 100_000 and name in ("inside-20", "inside-40", "outside-40", "inside-40-full"):
        return usual // 2
    return usual
