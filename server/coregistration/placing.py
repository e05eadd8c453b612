"""One plot looked up in a collection and, if it is matched, fitted to all trees of the map around it."""

import math
import time
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from server.collections.crud import get_collection
from server.collections.frame_systems import FrameSystem, frame_systems
from server.coregistration.map_trees import MapTrees, trees_around, trees_of_submap
from server.coregistration.nominal import NominalPlaces, NominalPosition
from server.coregistration.places import distinct_places
from server.coregistration.plot_poses import PlotFrame, listed, map_trees_of, plot_pose, plot_trees, pose_of, sigmas_of
from server.coregistration.results import PlotResult, PlotTree
from server.coregistration.season import SeasonPlot
from server.coregistration.sentences import (
    ambiguous_sentence,
    gon_sentence,
    matched_sentence,
    skipped_sentence,
    unmatched_sentence,
)
from server.errors import InvalidLandmarks
from server.index.row_decoding import config_of
from server.queries.lookup import LookupResult, QueryContext, look_up
from server.queries.query import PlaceQuery, QueryLandmarks
from server.store.codec import digest, pack_positions
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction
from urquhart import SE2, Budget, Config, Effort, LandmarkError, describe
from urquhart.verify.map_fit import MapFit, fit_to_map

_MARGIN: Final = 15.0
"""Metres beyond the plot's farthest tree within which trees of the map are read: the plot's edge has neighbours."""
_MOST_TREES: Final = 20_000
"""Trees that the method takes at once; of more around a plot, those nearest to its centre are used."""


_UNHINTED: Final = 5
"""Plots one after the other that were not found, and are not with changed coordinates either, after which none is
searched so any more: what is wrong with coordinates is wrong with most plots, and each search takes up to 10 s."""


@dataclass(frozen=True, slots=True)
class SearchChoices:
    """How plots are looked up; the members are those of a query."""

    effort: Effort = "full"
    min_confidence: float | None = None
    seed: int | None = None
    nominal: NominalPlaces | None = None


class PlotPlacer:
    """Places the plots of a season in one collection. Results of plots are kept apart by their keys."""

    def __init__(
        self, context: QueryContext, collection_id: str, choices: SearchChoices, budget: Budget | None = None
    ) -> None:
        """`budget` is abandoned if the work is to stop. Raises NotFound if there is no such collection."""
        self._budget = budget
        self._context, self._collection_id, self._choices = context, collection_id, choices
        with context.database.read() as tx:
            collection = get_collection(tx, collection_id)
        # A collection that changed may hold plots elsewhere, so its revision is part of every key.
        self._common = f"5 {collection_id} {collection.key} {collection.revision} {choices!r}"
        self._systems: dict[str, FrameSystem] = {}
        self._unhinted = 0

    def key(self, plot: SeasonPlot) -> str:
        """Digest of everything that the plot's result depends on."""
        trees = plot.trees
        dbh = None if trees.dbh_cm is None else trees.dbh_cm.tobytes()
        names = "\n".join(
            (self._common, str(plot.path), plot.name, str(trees.crs), repr((plot.centre, plot.is_local)), *trees.ids)
        )
        azimuths = None if trees.assumed_azimuths is None else trees.assumed_azimuths.tobytes()
        return digest(f"{trees.skipped} {names}".encode(), pack_positions(trees.xy), dbh, azimuths)

    def place(self, plot: SeasonPlot) -> PlotResult:
        """Look the plot up, and fit it to the map if it is matched. A plot that cannot be looked up is `failed`.

        Raises:
            DomainError: the database or the collection is at fault, and not the plot.
            Abandoned: the budget was abandoned.
        """
        began = time.perf_counter()
        result = self._unplaced(plot)
        limit = self._context.limits.landmarks
        if len(plot.trees) > limit:
            what = f"the plot has {len(plot.trees)} trees, more than the {limit} that a query may have: cut it"
            return replace(result, outcome="failed", reason="too_many_trees", sentence=what)
        try:
            look, searched = self._looked_up(plot, self._choices.effort, hints=True)
            result = self._answered(plot, replace(result, searched=searched), look)
            in_gon = plot.trees.in_gon()
            if in_gon is not None:
                # Only what is surely found can be better than a match, and `fast` finds that in a part of the time.
                effort = "fast" if look.answer.verdict == "matched" else self._choices.effort
                other = replace(plot, trees=in_gon)
                result = self.better_in_gon(plot, (result, look), (other, self._looked_up(other, effort)[0]))
        except InvalidLandmarks as error:
            result = replace(result, outcome="failed", reason="invalid_trees", sentence=str(error))
        return replace(result, seconds=round(time.perf_counter() - began, 3))

    def answered(self, plot: SeasonPlot, look: LookupResult) -> PlotResult:
        """The result of a plot that was looked up in a frame with its origin at the plot's centre."""
        return self._answered(plot, self._unplaced(plot), look)

    def better_in_gon(
        self, plot: SeasonPlot, degrees: tuple[PlotResult, LookupResult], gon: tuple[SeasonPlot, LookupResult]
    ) -> PlotResult:
        """The result of a plot whose azimuths were taken for degrees; if they fit better in gon, one that says so.

        Azimuths below 360 may be either. What was made in gon and is read in degrees has part of its trees in place,
        so it may be matched with a confidence of 0.999, turned by up to 36 degrees.

        Args:
            plot: as it was looked up in degrees; `degrees` is the result of that, and the answer.
            gon: the same plot in gon, and its answer.
        """
        (result, look), (in_gon, there) = degrees, gon
        if there.answer.verdict == "no_match" or _log_odds(there) <= _log_odds(look):
            return result
        count = _found(self._answered(in_gon, self._unplaced(in_gon), there), there)
        sentence = gon_sentence(len(plot.trees), count, _found(result, look))
        if result.outcome == "no_match":
            return replace(result, reason="angle_unit", sentence=f"not found: {sentence}")
        bare = replace(self._unplaced(plot), searched=result.searched)
        return replace(bare, outcome="ambiguous", reason="angle_unit", sentence=sentence)

    def _unplaced(self, plot: SeasonPlot) -> PlotResult:
        """The result of a plot as far as it is known without a search."""
        trees, centre = plot.trees, np.array(plot.centre)
        known, unused = self._nominal(plot)
        return PlotResult(
            name=plot.name,
            file=str(plot.path),
            key=self.key(plot),
            outcome="failed",
            reason="",
            sentence="",
            system=trees.crs,
            centre=plot.centre,
            is_local=plot.is_local and known is None,
            radius=float(np.hypot(*(trees.xy - centre).T).max(initial=0.0)),
            trees=[
                PlotTree(tree_id, x, y, dbh)
                for tree_id, (x, y), dbh in zip(
                    trees.ids, trees.xy.tolist(), listed(trees.dbh_cm, len(trees)), strict=True
                )
            ],
            notes=[*([unused] if unused else []), *([skipped_sentence(trees.skipped)] if trees.skipped else [])],
        )

    def _nominal(self, plot: SeasonPlot) -> tuple[NominalPosition | None, str]:
        """Where the plot ought to be, or why what is known of that cannot be used."""
        nominal = self._choices.nominal
        if nominal is None:
            return None, ""
        with self._context.database.read() as tx:
            system = self._system(tx, get_collection(tx, self._collection_id), nominal.frame_id)
        return nominal.position(plot, system), nominal.unused(plot, system)

    def _looked_up(
        self, plot: SeasonPlot, effort: Effort, *, hints: bool = False
    ) -> tuple[LookupResult, Literal["near", "everywhere"]]:
        """The answer for a plot, and where it was searched. With `hints`, it may say what would make the plot match."""
        near = self._near(plot, effort)
        if near is not None and near.answer.verdict == "matched":
            return near, "near"
        query = replace(self._query(plot, effort), hints=hints and self._unhinted < _UNHINTED)
        look = look_up(self._context, self._collection_id, query, budget=self._budget)
        if query.hints and look.answer.verdict == "no_match":
            self._unhinted = 0 if look.answer.hints else self._unhinted + 1
        if near is not None and near.answer.verdict == "ambiguous" and look.answer.verdict != "matched":
            return near, "near"
        return look, "everywhere"

    def _near(self, plot: SeasonPlot, effort: Effort) -> LookupResult | None:
        """The answer where the plot ought to be; None if nothing says where, or the map does not reach there."""
        nominal = self._choices.nominal
        if nominal is None:
            return None
        with self._context.database.read() as tx:
            system = self._system(tx, get_collection(tx, self._collection_id), nominal.frame_id)
        prior = nominal.prior(plot, system)
        if prior is None:
            return None
        query = replace(self._query(plot, effort), prior=prior)
        return look_up(self._context, self._collection_id, query, budget=self._budget)

    def _query(self, plot: SeasonPlot, effort: Effort) -> PlaceQuery:
        """The query of a plot. Its frame has its origin at the plot's centre, which poses are then about."""
        trees, chosen = plot.trees, self._choices
        diameters = None if trees.dbh_cm is None else trees.dbh_cm / 100.0
        if diameters is not None and np.isnan(diameters).all():
            diameters = None
        landmarks = QueryLandmarks(trees.xy - np.array(plot.centre), diameters, list(trees.ids))
        return PlaceQuery(landmarks, effort=effort, min_confidence=chosen.min_confidence, seed=chosen.seed, pairs=False)

    def _answered(self, plot: SeasonPlot, result: PlotResult, look: LookupResult) -> PlotResult:
        """The result of a plot whose query was answered."""
        answer = look.answer
        result = replace(result, outcome=answer.verdict, reason=answer.reason)
        if answer.verdict == "no_match":
            return replace(result, sentence=unmatched_sentence(answer))
        with self._context.database.read() as tx:
            collection = get_collection(tx, self._collection_id)
            if answer.verdict == "ambiguous":
                places = distinct_places(tx, collection, look, plot, lambda frame: self._system(tx, collection, frame))
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
        start = candidate.transform if place is None else pose_of(place) @ candidate.transform
        middle, radius = start.apply(np.zeros((1, 2)))[0], result.radius + _MARGIN
        if place is None:
            frame_id = row.frame_id or row.id
            system = FrameSystem(frame_id, None, None)
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
        sigmas = sigmas_of(fit, candidate, place)
        nominal = self._choices.nominal
        known = nominal.position(plot, system) if nominal is not None and nominal.frame_id == frame_id else None
        pose = plot_pose(plot, fit.transform, sigmas, PlotFrame(frame_id, system, known))
        result = replace(
            result,
            pose=pose,
            inliers=len(fit.residuals),
            share=len(fit.residuals) / len(plot.trees),
            rms=fit.rms,
            scale=fit.scale,
            confidence=answer.confidence,
            warnings=[word for word in fit.warnings if word != "far_origin"],
            trees=plot_trees(plot, fit, there, system),
            map_trees=map_trees_of(fit, there, system),
        )
        return replace(result, sentence=matched_sentence(result))

    def _system(self, tx: ReadTransaction, collection: CollectionRecord, frame_id: str) -> FrameSystem:
        if frame_id not in self._systems:
            self._systems[frame_id] = frame_systems(tx, collection, [frame_id])[frame_id]
        return self._systems[frame_id]


def _log_odds(look: LookupResult) -> float:
    """The evidence for the best candidate of an answer."""
    return look.answer.candidates[0].log_odds if look.answer.candidates else -math.inf


def _found(result: PlotResult, look: LookupResult) -> int:
    """Trees of a plot that are in the map, in the best place that was found."""
    if result.pose is not None:
        return result.inliers
    return look.answer.candidates[0].inlier_count if look.answer.verdict != "no_match" else 0


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
