"""What the page says of the rivals."""

from typing import Any, Final

from benchmarks.markdown import bullets, number, page, prose, table
from benchmarks.scale.charts import RIVAL_NAMES, parts_of, short, sizes_of
from benchmarks.scale.measurement_plan import RIVALS
from benchmarks.scale.tiled_forest import KINDS

_WHAT: Final = (
    """FAISS over quads: the five lengths that our quad index has, range search with a ball of the volume of our box;
    exact up to a thousand submaps, inverted lists beyond (`IndexIVFFlat`, 16 of them looked into); a vote for each
    hit.""",
    """Hashed triangles: the sorted sides of Delaunay triangles, after the Stable Triangle Descriptor (Yuan et
    al., 2023); a vote for each triangle with all three sides within our tolerance, mirror images left out.""",
    """Every submap tried: our last resort over the whole database. Its time is that of one submap times their number:
    what it takes at a thousand, it takes a thousand times at a million.""",
)
_STOPS: Final = """The first two stop at 100k: their tables are made in memory in one piece. A million submaps have
about 240 million quads and 160 million triangles; with the arrays that they are made of, that is more than 12 GB for
either. The third stops at 1k, where a query takes seconds already."""


def rivals(figures: dict[str, Any]) -> str:
    """The section, from the figures of all sizes."""
    rows = []
    for size in sizes_of(figures):
        parts = parts_of(figures, size)
        for name in RIVALS:
            if name not in parts:
                continue
            for kind, found in parts[name]["kinds"].items():
                ours = parts.get(kind, {}).get("first", {}).get(str(parts[name]["asked"]), {})
                rows.append(
                    [
                        f"{short(size)}: {RIVAL_NAMES[name]}, {KINDS[kind].setting}",
                        number(found["listed"], 3),
                        number(found["recall"], 3),
                        number(ours.get("recall"), 3),
                        number(found["search"]["p50"], 1),
                        number(found["milliseconds"]["p50"], 1),
                        number(found["milliseconds"]["p95"], 1),
                        number(ours.get("milliseconds", {}).get("p50"), 1),
                        number(parts[name]["bytes"] / 1000.0, 1),
                    ]
                )
    head = ["submaps: rival, setting", "listed", "right", "ours", "search, ms", "p50, ms", "p95, ms", "ours, p50", "kB"]
    return page(
        "## Other ways to search",
        prose(
            """On the same submaps and the same queries, the first of those above: each rival names 24 submaps with 32
            poses at most in each, which are then verified as ours are, and the one with most evidence is its answer, so
            that only the search differs. *Listed*: the submap nearest to the query is among the 24. *Right*: the answer
            is. *kB*: what is searched, a submap."""
        ),
        table(head, rows),
        bullets(_WHAT),
        prose(_STOPS),
    )
