"""One plot looked up in a collection and, if it is matched, fitted to all trees of the map around it."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.collections.crud import get_collection
from server.coregistration.map_systems import MapSystem, map_system
from server.coregistration.map_trees import MapTrees, trees_around, trees_of_submap
from server.coregistration.places import distinct_places
from server.coregistration.results import MapTree, PlotPose, PlotResult, PlotTree
from server.coregistration.season import SeasonPlot
from server.coregistration.sentences import ambiguous_sentence, matched_sentence, unmatched_sentence
from server.errors import InvalidLandmarks
from server.index.row_decoding import config_of
from server.queries.lookup import LookupResult, QueryContext, look_up
from server.queries.query import PlaceQuery, QueryLandmarks
from server.store.codec import digest, pack_positions
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction
from server.store.submap_records import Place
from urquhart import SE2, Candidate, Config, Effort, LandmarkError, describe
from urquhart.pose_covariance import compose
from urquhart.verify.map_fit import MapFit, fit_to_map

_MARGIN: Final = 15.0
"""Metres beyond the plot's farthest tree within which trees of the map are read: the plot's edge has neighbours."""
_MOST_TREES: Final = 20_000
"""Trees that the method takes at once; of more around a plot, those nearest to its centre are used."""


@dataclass(frozen=True, slots=True)
class SearchChoices:
    """How plots are looked up; the members are those of a query."""

    effort: Effort = "full"
    min_confidence: float | None = None
    seed: int | None = None


class PlotPlacer:
    """Places the plots of a season in one collection. Results of plots are kept apart by their keys."""

    def __init__(self, context: QueryContext, collection_id: str, choices: SearchChoices) -> None:
        """Raises NotFound if there is no such collection."""
        self._context, self._collection_id, self._choices = context, collection_id, choices
        with context.database.read() as tx:
            collection = get_collection(tx, collection_id)
        # A collection that changed may hold plots elsewhere, so its revision is part of every key.
        self._common = f"1 {collection_id} {collection.key} {collection.revision} {choices!r}"
        self._systems: dict[str, MapSystem] = {}

    def key(self, plot: SeasonPlot) -> str:
        """Digest of everything that the plot's result depends on."""
        trees = plot.trees
        dbh = None if trees.dbh_cm is None else trees.dbh_cm.tobytes()
        names = "\n".join(
            (self._common, str(plot.path), plot.name, str(trees.crs), repr((plot.centre, plot.is_local)), *trees.ids)
        )
        return digest(names.encode(), pack_positions(trees.xy), dbh)

    def place(self, plot: SeasonPlot) -> PlotResult:
        """Look the plot up, and fit it to the map if it is matched. A plot that cannot be looked up is `failed`.

        Raises:
            DomainError: the database or the collection is at fault, and not the plot.
        """
        began = time.perf_counter()
        result = self._unplaced(plot)
        limit = self._context.limits.landmarks
        if len(plot.trees) > limit:
            what = f"the plot has {len(plot.trees)} trees, more than the {limit} that a query may have: cut it"
            return replace(result, outcome="failed", reason="too_many_trees", sentence=what)
        try:
            look = look_up(self._context, self._collection_id, self._query(plot))
            result = self._answered(plot, result, look)
        except InvalidLandmarks as error:
            result = replace(result, outcome="failed", reason="invalid_trees", sentence=str(error))
        return replace(result, seconds=round(time.perf_counter() - began, 3))

    def _unplaced(self, plot: SeasonPlot) -> PlotResult:
        """The result of a plot as far as it is known without a search."""
        trees, centre = plot.trees, np.array(plot.centre)
        return PlotResult(
            name=plot.name,
            file=str(plot.path),
            key=self.key(plot),
            outcome="failed",
            reason="",
            sentence="",
            system=trees.crs,
            centre=plot.centre,
            is_local=plot.is_local,
            radius=float(np.hypot(*(trees.xy - centre).T).max(initial=0.0)),
            trees=[
                PlotTree(tree_id, x, y, dbh)
                for tree_id, (x, y), dbh in zip(
                    trees.ids, trees.xy.tolist(), _listed(trees.dbh_cm, len(trees)), strict=True
                )
            ],
        )

    def _query(self, plot: SeasonPlot) -> PlaceQuery:
        """The query of a plot. Its frame has its origin at the plot's centre, which poses are then about."""
        trees, chosen = plot.trees, self._choices
        diameters = None if trees.dbh_cm is None else trees.dbh_cm / 100.0
        if diameters is not None and np.isnan(diameters).all():
            diameters = None
        landmarks = QueryLandmarks(trees.xy - np.array(plot.centre), diameters, list(trees.ids))
        return PlaceQuery(
            landmarks, effort=chosen.effort, min_confidence=chosen.min_confidence, seed=chosen.seed, pairs=False
        )

    def _answered(self, plot: SeasonPlot, result: PlotResult, look: LookupResult) -> PlotResult:
        """The result of a plot whose query was answered."""
        answer = look.answer
        result = replace(result, outcome=answer.verdict, reason=answer.reason)
        if answer.verdict == "no_match":
            return replace(result, sentence=unmatched_sentence(answer))
        with self._context.database.read() as tx:
            collection = get_collection(tx, self._collection_id)
            if answer.verdict == "ambiguous":
                places = distinct_places(tx, collection, look, lambda frame: self._system(tx, collection, frame).origin)
                return replace(result, places=places, sentence=ambiguous_sentence(answer, places))
            return self._fitted(plot, result, look, tx, collection)

    def _fitted(
        self,
        plot: SeasonPlot,
        result: PlotResult,
        look: LookupResult,
        tx: ReadTransaction,
        collection: CollectionRecord,
    ) -> PlotResult:
        """The result of a plot that is matched."""
        candidate, answer = look.candidates[0], look.answer.candidates[0]
        row = tx.candidates(collection.key).read([candidate.key], landmarks=False).get(candidate.key)
        gone = replace(
            result, outcome="failed", reason="map_changed", sentence="the map was changed meanwhile: run again"
        )
        if row is None:
            return gone
        place = row.place
        start = candidate.transform if place is None else _pose_of(place) @ candidate.transform
        middle, radius = start.apply(np.zeros((1, 2)))[0], result.radius + _MARGIN
        if place is None:
            frame_id, system = row.frame_id or row.id, MapSystem()
            there = trees_of_submap(tx, collection, row.id, middle, radius)
        else:
            frame_id = place.map_frame_id
            system = self._system(tx, collection, frame_id)
            there = trees_around(tx, collection, frame_id, middle, radius)
        there = _nearest_trees(there, middle)
        try:
            fit = _fit(plot, there, start, config_of(collection), keep=candidate.level == "given")
        except (LandmarkError, ValueError):
            return gone
        sigmas = _sigmas(fit, candidate, place)
        pose = _placed_pose(plot, fit.transform, sigmas, frame_id, system)
        result = replace(
            result,
            pose=pose,
            inliers=len(fit.residuals),
            share=len(fit.residuals) / len(plot.trees),
            rms=fit.rms,
            scale=fit.scale,
            confidence=answer.confidence,
            warnings=[word for word in fit.warnings if word != "far_origin"],
            trees=_plot_trees(plot, fit, there, system),
            map_trees=_map_trees(fit, there, system),
        )
        return replace(result, sentence=matched_sentence(result))

    def _system(self, tx: ReadTransaction, collection: CollectionRecord, frame_id: str) -> MapSystem:
        if frame_id not in self._systems:
            self._systems[frame_id] = map_system(tx, collection, frame_id)
        return self._systems[frame_id]


def _pose_of(place: Place) -> SE2:
    """map_T_submap."""
    return SE2(place.map_x, place.map_y, place.map_yaw)


def _listed(values: NDArray[np.float64] | None, count: int) -> Sequence[float | None]:
    """Values (N,) with None for NaN."""
    if values is None:
        return [None] * count
    return [None if math.isnan(value) else value for value in values.tolist()]


def _nearest_trees(there: MapTrees, middle: NDArray[np.float64]) -> MapTrees:
    """The trees of the map, at most `_MOST_TREES`, those nearest to `middle` (2,)."""
    if len(there.xy) <= _MOST_TREES:
        return there
    rows = np.sort(np.argsort(np.hypot(*(there.xy - middle).T), kind="stable")[:_MOST_TREES])
    ids = [there.ids[row] for row in rows.tolist()]
    return MapTrees(there.xy[rows], ids, there.dbh_cm[rows], there.height_m[rows])


def _fit(plot: SeasonPlot, there: MapTrees, start: SE2, config: Config, *, keep: bool) -> MapFit:
    """The plot, about its centre, on the trees of the map. Raises LandmarkError and ValueError."""
    dbh = plot.trees.dbh_cm
    measured = None if dbh is None or np.isnan(dbh).all() else dbh / 100.0
    observation = describe(plot.trees.xy - np.array(plot.centre), config, measured)
    return fit_to_map(observation, describe(there.xy, config, there.diameters), start, config, keep=keep)


def _sigmas(fit: MapFit, candidate: Candidate, place: Place | None) -> NDArray[np.float64] | None:
    """Standard deviations (3,) of the plot's centre and rotation: metres, metres, radians; None if not known."""
    uncertainty, pose = fit.uncertainty, fit.transform
    if place is not None and place.map_covariance is None:
        return None
    if candidate.level == "given" or (place is not None and any(place.map_covariance or ())):
        # Of the search, and of the submap's own pose in the map, which all partners share.
        given = np.zeros((3, 3)) if place is None else np.asarray(place.map_covariance, dtype=np.float64).reshape(3, 3)
        there = SE2.identity() if place is None else _pose_of(place)
        uncertainty, pose = (
            compose(there, given, candidate.transform, candidate.uncertainty),
            there @ candidate.transform,
        )
    return np.sqrt(np.diag(uncertainty.covariance_about(pose, np.zeros(2))))


def _placed_pose(
    plot: SeasonPlot, map_T_plot: SE2, sigmas: NDArray[np.float64] | None, frame_id: str, system: MapSystem
) -> PlotPose:
    """The pose for people, from that of the plot about its centre."""
    (x, y), (e0, n0) = plot.centre, system.origin
    e, n = map_T_plot.x + e0, map_T_plot.y + n0
    c, s = math.cos(map_T_plot.yaw), math.sin(map_T_plot.yaw)
    matrix = [
        [c, -s, 0.0, e - c * x + s * y],
        [s, c, 0.0, n - s * x - c * y],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
    sigma_e = sigma_n = sigma_turn = None
    if sigmas is not None:
        sigma_e, sigma_n, sigma_turn = float(sigmas[0]), float(sigmas[1]), math.degrees(float(sigmas[2]))
    turn = -math.degrees(map_T_plot.yaw)
    is_same = not (plot.trees.crs and system.crs) or plot.trees.crs == system.crs
    shift = (e - x, n - y) if is_same else (None, None)
    return PlotPose(frame_id, system.crs, e, n, shift[0], shift[1], turn, sigma_e, sigma_n, sigma_turn, matrix)


def _plot_trees(plot: SeasonPlot, fit: MapFit, there: MapTrees, system: MapSystem) -> list[PlotTree]:
    """The plot's trees in the map, with their partners."""
    placed = fit.transform.apply(plot.trees.xy - np.array(plot.centre)) + np.array(system.origin)
    partner = dict(
        zip(fit.query_indices.tolist(), zip(fit.map_indices.tolist(), fit.residuals.tolist(), strict=True), strict=True)
    )
    dbh, of_map = _listed(plot.trees.dbh_cm, len(plot.trees)), _listed(there.dbh_cm, len(there.ids))
    trees = []
    for tree, (tree_id, (x, y), (e, n)) in enumerate(
        zip(plot.trees.ids, plot.trees.xy.tolist(), placed.tolist(), strict=True)
    ):
        one = PlotTree(tree_id, x, y, dbh[tree], e, n)
        if tree in partner:
            other, residual = partner[tree]
            one = replace(one, partner=there.ids[other], partner_dbh_cm=of_map[other], residual=residual)
        trees.append(one)
    return trees


def _map_trees(fit: MapFit, there: MapTrees, system: MapSystem) -> list[MapTree]:
    """The trees of the map around the plot."""
    paired, inside = set(fit.map_indices.tolist()), set(fit.missing.tolist())
    dbh, xy = _listed(there.dbh_cm, len(there.ids)), there.xy + np.array(system.origin)
    return [
        MapTree(there.ids[tree], e, n, dbh[tree], tree in paired, tree in paired or tree in inside)
        for tree, (e, n) in enumerate(xy.tolist())
    ]
