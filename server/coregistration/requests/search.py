"""How a season's plots are to be searched: what a caller says of it, checked, and made what places one plot."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.collections.crud import get_collection
from server.coregistration.nominal import NominalPlaces
from server.coregistration.placing import PlotPlacer, SearchChoices
from server.coregistration.positions import ReadCentres, SeasonPositions, read_positions
from server.errors import InvalidField
from server.queries.lookup import QueryContext
from server.stem_maps.reader import read_centres
from server.stem_maps.reading.options import ReadOptions
from server.store.records import DEFAULT_FRAME
from server.store.storage import Storage
from urquhart import Budget, Effort

_FRAMES: Final = 5
"""Most map frames that an error names."""
_ANY: Final = 60.0
"""Degrees: a heading that is known no better is not known."""


@dataclass(frozen=True, slots=True)
class SeasonSearch:
    """What a caller says of the search.

    Attributes:
        effort, min_confidence, seed: as of a query.
        at_sigma: metres, standard deviation of where plots ought to be; None to search everywhere.
        positions_crs: the coordinate reference system of a table of positions.
        heading: degrees clockwise from north to the plots' y axes; `heading_sigma` is its standard deviation.
        frame: the map frame that plots ought to be in; None if there is only one.
        noise: metres, roughly how far trees are off in the map.
    """

    effort: Effort = "full"
    min_confidence: float | None = None
    seed: int | None = None
    at_sigma: float | None = None
    positions_crs: str | None = None
    heading: float = 0.0
    heading_sigma: float = 5.0
    frame: str | None = None
    noise: float | None = None

    def fault(self, *, has_positions: bool, named: Callable[[str], str]) -> tuple[str, str] | None:
        """A member that cannot be used as it is, and why in a sentence; `named` writes the name of a member."""
        if self.at_sigma is None and (has_positions or self.frame is not None or self.noise is not None):
            which = ", ".join(map(named, ("positions", "frame"))) + f" and {named('noise')}"
            return "at_sigma", f"{which} need {named('at_sigma')}: how right those positions are"
        if not has_positions and self.positions_crs is not None:
            return "positions_crs", f"{named('positions_crs')} needs {named('positions')}: the file in that system"
        if self.min_confidence is not None and not 0.5 < self.min_confidence < 1.0:
            what = f"{named('min_confidence')} must be more than 0.5 and less than 1, not {self.min_confidence:g}"
            return "min_confidence", what
        return None


def map_frame_of(storage: Storage, collection_id: str, named: str | None) -> str:
    """The map frame that plots ought to be in: the one that is `named`, or the only one of the collection.

    Raises:
        NotFound: there is no such collection.
        InvalidField: it has several, and none is named.
    """
    if named is not None:
        return named
    with storage.read() as tx:
        frames = tx.map_frames(get_collection(tx, collection_id)).in_use(_FRAMES + 1)
    if len(frames) > 1:
        names = ", ".join(frames[:_FRAMES]) + (" and others" if len(frames) > _FRAMES else "")
        raise InvalidField(
            f"must be one of the collection's map frames: {names}", code="frame_id", parameter="frame_id"
        )
    return frames[0] if frames else DEFAULT_FRAME


@dataclass(frozen=True, slots=True)
class SeasonPlan:
    """What places the plots of a season, and what is known of where they ought to be."""

    placer: PlotPlacer
    positions: SeasonPositions | None


def plan_season(
    context: QueryContext,
    place: tuple[str, str | None],
    search: SeasonSearch,
    positions: tuple[Path, ReadOptions] | None,
    *,
    read: ReadCentres = read_centres,
    budget: Budget | None = None,
) -> SeasonPlan:
    """What places plots in a collection.

    Args:
        place: ids of the collection and, with `search.at_sigma`, of the map frame that plots ought to be in.
        positions: a table of where they ought to be, and the options of the plots' files.
        read: reads that table.
        budget: abandoned if the work is to stop.

    Raises:
        NotFound: there is no such collection.
        StemMapError: the table cannot be used.
    """
    collection_id, frame_id = place
    if search.at_sigma is None or frame_id is None:
        choices = SearchChoices(search.effort, search.min_confidence, search.seed)
        return SeasonPlan(PlotPlacer(context, collection_id, choices, budget), None)
    there = None
    if positions is not None:
        path, options = positions
        where = (collection_id, frame_id, search.at_sigma)
        there = read_positions(path, (options, search.positions_crs), context.database, where, read)
    nominal = NominalPlaces(
        frame_id,
        search.at_sigma,
        search.heading if search.heading_sigma < _ANY else None,
        search.heading_sigma,
        search.noise,
        () if there is None else tuple((name, x, y) for name, (x, y) in there.places.items()),
    )
    choices = SearchChoices(search.effort, search.min_confidence, search.seed, nominal)
    return SeasonPlan(PlotPlacer(context, collection_id, choices, budget), there)
