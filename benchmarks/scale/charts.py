"""Pictures of the figures against the number of submaps, drawn from the JSON."""

from collections.abc import Callable
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from benchmarks.scale.measurement_plan import RIVALS
from benchmarks.scale.requirements import look, per, resident
from benchmarks.scale.tiled_forest import KINDS, PLAIN

OURS: Final = "#1a1a1a"
COLOURS: Final = {
    "inside-20": OURS,
    "outside-20": "#d55e00",
    "inside-40": "#0072b2",
    "outside-40": "#e69f00",
    "rival-quads": "#009e73",
    "rival-triangles": "#cc79a7",
    "rival-exhaustive": "#999999",
}
RIVAL_NAMES: Final = {
    "rival-quads": "FAISS over quads",
    "rival-triangles": "hashed triangles",
    "rival-exhaustive": "every submap tried",
}
_PLAIN: Final = FuncFormatter(lambda value, _: f"{value:g}")
Read = Callable[[dict[str, Any]], float | None]


def sizes_of(figures: dict[str, Any]) -> list[int]:
    """Sizes that were measured, ascending."""
    return sorted(int(size) for size in figures["sizes"])


def parts_of(figures: dict[str, Any], size: int) -> dict[str, Any]:
    """Figures of a size by part, none where it was not measured."""
    found: dict[str, Any] = figures["sizes"].get(str(size), {}).get("parts", {})
    return found


def series(figures: dict[str, Any], read: Read) -> tuple[list[int], list[float]]:
    """Sizes for which there is such a figure, and the figures."""
    found = [(size, read(parts_of(figures, size))) for size in sizes_of(figures)]
    known = [(size, value) for size, value in found if value is not None]
    return [size for size, _ in known], [value for _, value in known]


def recall(figures: dict[str, Any]) -> Figure:
    """Share of the queries found, ours in both settings and the rivals', against the number of submaps."""
    figure = Figure(figsize=(9.6, 3.8), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for ax, kind in zip(axes, ("inside-20", "inside-40"), strict=True):
        _line(ax, figures, look(kind, "recall"), OURS, "this project")
        for name in RIVALS:
            _line(ax, figures, look(name, "kinds", kind, "recall"), COLOURS[name], RIVAL_NAMES[name])
        ax.set(title=str(KINDS[kind].setting), ylim=(-0.02, 1.02))
        _grow(ax, figures)
    axes[0].set_ylabel("first candidate right")
    axes[0].legend(loc="lower left")
    return figure


def latency(figures: dict[str, Any]) -> Figure:
    """Milliseconds of a query, median and 95th percentile, by kind; and of the rivals."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for name in PLAIN:
        _line(left, figures, look(name, "milliseconds", "p50"), COLOURS[name], str(KINDS[name]))
        _line(left, figures, look(name, "milliseconds", "p95"), COLOURS[name], None, style=":")
    _line(right, figures, look("inside-20", "milliseconds", "p50"), COLOURS["inside-20"], "this project")
    for name in RIVALS:
        for percentile, style in (("p50", "-"), ("p95", ":")):
            label = RIVAL_NAMES[name] if style == "-" else None
            read = look(name, "kinds", "inside-20", "milliseconds", percentile)
            _line(right, figures, read, COLOURS[name], label, style=style)
    left.set(title="this project", ylabel="milliseconds: p50, dotted p95", yscale="log")
    right.set(title="20 cm, 90 %, inside: rivals, with our verification", yscale="log")
    for ax in (left, right):
        ax.legend(loc="best")
        _grow(ax, figures)
    left.yaxis.set_major_formatter(_PLAIN)
    return figure


def cost(figures: dict[str, Any]) -> Figure:
    """Bytes, memory, start and ingest."""
    figure = Figure(figsize=(9.6, 6.0), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True).ravel()
    _line(axes[0], figures, per(1e3, look("ingest", "database_bytes")), "#0072b2", "database")
    _line(axes[0], figures, per(1e3, look("ingest", "index_bytes")), OURS, "index")
    for name in RIVALS[:2]:
        _line(axes[0], figures, per(1e3, look(name, "bytes")), COLOURS[name], RIVAL_NAMES[name])
    axes[0].set(title="a submap", ylabel="kB", ylim=(0.0, None))
    _line(axes[1], figures, resident, OURS, "resident")
    for key, colour in (("own", "#0072b2"), ("files", "#009e73")):
        _line(axes[1], figures, per(1e3, look("inside-20", "memory", key)), colour, _MEMORY[key])
    axes[1].set(title="memory after the queries", ylabel="GB", yscale="log")
    for key, colour in (("ready_seconds", OURS), ("index_seconds", "#0072b2"), ("kernels_seconds", "#009e73")):
        _line(axes[2], figures, look("start", key), colour, _START[key])
    axes[2].set(title="start", ylabel="s", yscale="log")
    _line(axes[3], figures, look("ingest", "submaps_per_second"), OURS, "until a query finds them")
    axes[3].set(title="ingest", ylabel="submaps a second", ylim=(0.0, None))
    for ax in axes:
        ax.legend(loc="best")
        _grow(ax, figures)
        ax.yaxis.set_major_formatter(_PLAIN)
        if ax.get_yscale() == "log":
            ax.yaxis.set_minor_formatter(_PLAIN)
    return figure


_MEMORY: Final = {"own": "of its own", "files": "pages of files"}
_START: Final = {
    "ready_seconds": "to the first answer",
    "index_seconds": "of it the index",
    "kernels_seconds": "before it the kernels",
}


def _line(ax: Axes, figures: dict[str, Any], read: Read, colour: str, label: str | None, *, style: str = "-") -> None:
    sizes, values = series(figures, read)
    if sizes:
        # What this project does lies on top of what others do as well.
        ax.plot(sizes, values, style, marker="o", color=colour, label=label, zorder=3 if colour == OURS else 2)


def _grow(ax: Axes, figures: dict[str, Any]) -> None:
    sizes = sizes_of(figures)
    ax.set(xscale="log", xlabel="submaps")
    ax.set_xticks(sizes, [short(size) for size in sizes])
    ax.xaxis.set_minor_locator(NullLocator())


def short(size: int) -> str:
    """A number of submaps, as a heading has room for it."""
    for unit, sign in ((1_000_000, "M"), (1_000, "k")):
        if size >= unit and size % unit == 0:
            return f"{size // unit}{sign}"
    return str(size)


PICTURES: Final[dict[str, Callable[[dict[str, Any]], Figure]]] = {
    "scale_recall": recall,
    "scale_latency": latency,
    "scale_cost": cost,
}
