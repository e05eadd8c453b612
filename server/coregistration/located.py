"""One file of trees that was looked up: where it is, tree by tree, against all trees of the map there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from server.coregistration.placing import PlotPlacer, SearchChoices
from server.coregistration.results import PlotResult
from server.coregistration.season import plot_of
from server.queries.lookup import LookupResult, QueryContext
from server.schemas.common import Members
from server.stem_maps.reader import StemMap
from urquhart import SE2, Candidate
from urquhart.pose_covariance import PoseUncertainty


def place_observation(
    context: QueryContext,
    collection_id: str,
    path: Path,
    seen: tuple[StemMap, LookupResult],
    in_gon: tuple[StemMap, LookupResult] | None = None,
) -> PlotResult:
    """The result of an observation that was looked up in its own coordinates: as that of a plot of a season.

    Args:
        path: the file that the trees are from.
        seen: the trees as they were looked up, and the answer with its candidates.
        in_gon: the same in gon, if azimuths name no unit. If that fits better, the result is not matched.

    Raises:
        NotFound: the collection is gone.
        DomainError: the database cannot be read.
    """
    trees, look = seen
    plot = plot_of(path, trees)
    placer = PlotPlacer(context, collection_id, SearchChoices())
    centre = np.array(plot.centre)
    there = _about(look, centre)
    result = placer.answered(plot, there)
    if in_gon is None:
        return result
    other = replace(plot, trees=in_gon[0])
    return placer.better_in_gon(plot, (result, there), (other, _about(in_gon[1], centre)))


def _about(look: LookupResult, centre: NDArray[np.float64]) -> LookupResult:
    """The same answer for a query whose frame has its origin at `centre` (2,), metres, and the same axes."""
    shift = SE2.shift(centre)
    moved = {name: [_moved(one, shift) for one in look.members[name]] for name in ("candidates", "rivals")}
    candidates = tuple(_moved_candidate(one, shift, centre) for one in look.candidates)
    return replace(look, members={**look.members, **moved}, candidates=candidates)


def _moved(members: Members, shift: SE2) -> Members:
    """The members of a candidate or rival, with the pose of a query frame whose origin is moved by `shift`."""
    pose = members["transform"]
    there = SE2(pose["x"], pose["y"], pose["yaw"]) @ shift
    return {**members, "transform": {**pose, "x": there.x, "y": there.y, "yaw": there.yaw}}


def _moved_candidate(one: Candidate, shift: SE2, centre: NDArray[np.float64]) -> Candidate:
    transform, known = one.transform @ shift, one.uncertainty
    uncertainty = PoseUncertainty.about_point(known.source - centre, transform, known.covariance)
    return replace(one, transform=transform, uncertainty=uncertainty)
