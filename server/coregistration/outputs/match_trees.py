"""The trees of a stored match: each with its partner among all trees of the map there, as a table."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from server.collections.crud import get_collection
from server.collections.frame_systems import FrameSystem, frame_systems
from server.coregistration.map_trees import MapTrees, trees_around, trees_of_submap
from server.errors import Gone
from server.index.row_decoding import config_of
from server.outputs.tables import OutputColumn, OutputLayer, OutputRows
from server.queries.poses import place_pose
from server.queries.stored_queries import Match, stored_landmark_ids
from server.store.storage import Storage
from urquhart import SE2, Config, LandmarkError, describe
from urquhart.verify.map_fit import MapFit, fit_to_map

_MARGIN: Final = 15.0
"""Metres beyond the farthest tree of the query within which trees of the map are read."""
TREE_COLUMNS: Final = (
    OutputColumn("seen", "text"),
    OutputColumn("tag", "text"),
    OutputColumn("partner", "text"),
    OutputColumn("partner_dbh_cm", "real"),
    OutputColumn("residual_m", "real"),
    OutputColumn("frame_id", "text"),
)
"""`seen` is both, query (only there: ingrowth, or missed by the map) or map (only there: felled, or missed)."""


def match_trees(database: Storage, collection_id: str, match: Match) -> tuple[OutputLayer, OutputRows]:
    """A row for each tree of the query, and for each tree of the map in its footprint that has no partner.

    Positions are those in the map: of the query's trees at the pose of the match, of the others as they are stored.
    Pairs are sought among all trees of the map there, or of the submap alone if it is in no map.

    Raises:
        NotFound: the collection is gone.
        Gone: the submap is gone, or fewer than two trees have a partner now.
    """
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        names = stored_landmark_ids(tx, collection, match.query_id)
        row = tx.candidates(collection.key).read([match.candidate.key], landmarks=False).get(match.candidate.key)
        if row is None:
            raise Gone("The submap of this candidate was deleted after the query. Send the query again.")
        start, frame_id = match.candidate.transform, row.frame_id or row.id
        middle, radius = _extent(match.query_xy)
        if row.place is None:
            system = FrameSystem(frame_id, None, None)
            there = trees_of_submap(tx, collection, row.id, start.apply(middle[None])[0], radius)
        else:
            frame_id = row.place.map_frame_id
            system, start = frame_systems(tx, collection, [frame_id])[frame_id], place_pose(row.place) @ start
            there = trees_around(tx, collection, frame_id, start.apply(middle[None])[0], radius)
        fit = _fit(match, there, start, config_of(collection))
    layer = OutputLayer("trees", TREE_COLUMNS, system, leading=3)
    return layer, _rows(match, names, there, fit, system)


def _extent(xy: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Middle (2,) of the query's trees, and the radius in which trees of the map are read; metres."""
    middle = 0.5 * (xy.min(axis=0) + xy.max(axis=0))
    return middle, float(np.hypot(*(xy - middle).T).max()) + _MARGIN


def _fit(match: Match, there: MapTrees, start: SE2, config: Config) -> MapFit:
    """The query on the trees of the map. Raises Gone."""
    try:
        query, trees = describe(match.query_xy, config), describe(there.xy, config)
        return fit_to_map(query, trees, start, config, keep=match.candidate.level == "given")
    except (LandmarkError, ValueError) as error:
        raise Gone("The trees of the map there have changed since the query. Send the query again.") from error


def _rows(match: Match, names: list[str], there: MapTrees, fit: MapFit, system: FrameSystem) -> OutputRows:
    query, alone = fit.transform.apply(match.query_xy), fit.missing
    partner = dict(zip(fit.query_indices.tolist(), fit.map_indices.tolist(), strict=True))
    away = dict(zip(fit.query_indices.tolist(), fit.residuals.tolist(), strict=True))
    partners = [partner.get(i) for i in range(len(query))] + alone.tolist()
    count = len(query) + len(alone)
    values: list[list[Any]] = [
        ["both" if i in partner else "query" for i in range(len(query))] + ["map"] * len(alone),
        [*names, *([None] * len(alone))],
        [None if j is None else there.ids[j] for j in partners],
        [None if j is None else float(there.dbh_cm[j]) for j in partners],
        [away.get(i) for i in range(len(query))] + [None] * len(alone),
        [system.frame_id] * count,
    ]
    return OutputRows(values, system.full(np.concatenate([query, there.xy[alone]])))
