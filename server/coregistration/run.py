"""A season placed plot by plot. Each result is stored before the next plot is looked up."""

from collections.abc import Callable

from server.coregistration.journal import Journal
from server.coregistration.placing import PlotPlacer
from server.coregistration.results import PlotResult
from server.coregistration.season import Season, UnreadPlot


def coregister(
    season: Season,
    placer: PlotPlacer,
    journal: Journal,
    done: Callable[[PlotResult, bool], object] = lambda result, known: None,
) -> list[PlotResult]:
    """The results of all plots, in the order of the season; those that cannot be read come last.

    A result in the journal counts if nothing that it depends on has changed. `done` is called with each result, and
    with whether it was known.

    Raises:
        DomainError: the database or the collection is at fault, and not a plot.
        OSError: the journal cannot be written.
    """
    results: list[PlotResult] = []
    for plot in season.plots:
        known = journal.find(placer.key(plot))
        result = known or placer.place(plot)
        if known is None:
            journal.add(result)
        done(result, known is not None)
        results.append(result)
    return results + [unread_result(one) for one in season.unread]


def unread_result(plot: UnreadPlot) -> PlotResult:
    """The result of a plot that cannot be read."""
    return PlotResult(
        name=plot.name, file=str(plot.path), key="", outcome="not_read", reason="not_read", sentence=plot.why
    )
