"""What a plot's fit to a map means for people: its pose, its trees in the map, and the map's trees around it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from server.collections.frame_systems import FrameSystem
from server.coregistration.map_trees import MapTrees
from server.coregistration.nominal import NominalPosition
from server.coregistration.results import MapTree, PlotPose, PlotTree
from server.coregistration.season import SeasonPlot
from server.store.submap_records import Place
from urquhart import SE2, Candidate
from urquhart.pose_covariance import compose
from urquhart.verify.map_fit import MapFit


def pose_of(place: Place) -> SE2:
    """map_T_submap."""
    return SE2(place.map_x, place.map_y, place.map_yaw)


def listed(values: NDArray[np.float64] | None, count: int) -> Sequence[float | None]:
    """Values (N,) with None for NaN."""
    if values is None:
        return [None] * count
    return [None if math.isnan(value) else value for value in values.tolist()]


def sigmas_of(fit: MapFit, candidate: Candidate, place: Place | None) -> NDArray[np.float64] | None:
    """Standard deviations (3,) of the plot's centre and rotation: metres, metres, radians; None if not known."""
    uncertainty, pose = fit.uncertainty, fit.transform
    if place is not None and place.map_covariance is None:
        return None
    if candidate.level == "given" or (place is not None and any(place.map_covariance or ())):
        # Of the search, and of the submap's own pose in the map, which all partners share.
        given = np.zeros((3, 3)) if place is None else np.asarray(place.map_covariance, dtype=np.float64).reshape(3, 3)
        there = SE2.identity() if place is None else pose_of(place)
        uncertainty, pose = (
            compose(there, given, candidate.transform, candidate.uncertainty),
            there @ candidate.transform,
        )
    return np.sqrt(np.diag(uncertainty.covariance_about(pose, np.zeros(2))))


@dataclass(frozen=True, slots=True)
class PlotFrame:
    """The map that a plot lies in, its system, and where the plot ought to be there; None if nothing says it."""

    frame_id: str
    system: FrameSystem
    position: NominalPosition | None


def plot_pose(plot: SeasonPlot, map_T_plot: SE2, sigmas: NDArray[np.float64] | None, frame: PlotFrame) -> PlotPose:
    """The pose for people, from that of the plot about its centre."""
    (x, y), (e0, n0), crs = plot.centre, frame.system.origin, frame.system.name
    e, n = map_T_plot.x + e0, map_T_plot.y + n0
    c, s = math.cos(map_T_plot.yaw), math.sin(map_T_plot.yaw)
    matrix = [
        [c, -s, 0.0, e - c * x + s * y],
        [s, c, 0.0, n - s * x - c * y],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
    sigma_e = sigma_n = sigma_turn = nominal_e = nominal_n = shift_e = shift_n = None
    if sigmas is not None:
        sigma_e, sigma_n, sigma_turn = float(sigmas[0]), float(sigmas[1]), math.degrees(float(sigmas[2]))
    if frame.position is not None:
        # What is known is the place of one point of the plot; the shift is the same for its centre.
        known = frame.position
        at = map_T_plot.apply(np.array([known.about]) - np.array(plot.centre))[0] + (e0, n0)
        shift_e, shift_n = float(at[0]) - known.there[0], float(at[1]) - known.there[1]
        nominal_e, nominal_n = e - shift_e, n - shift_n
    elif (own := frame.system.point_of(plot.trees.crs, plot.centre)) is not None:
        shift_e, shift_n = e - own[0][0], n - own[0][1]
    turn = turn_cw(plot, map_T_plot.yaw, frame.system)
    return PlotPose(
        *(frame.frame_id, crs, e, n, shift_e, shift_n, turn, nominal_e, nominal_n),
        *(sigma_e, sigma_n, sigma_turn, matrix),
    )


def turn_cw(plot: SeasonPlot, yaw: float, system: FrameSystem) -> float:
    """Degrees clockwise that a plot is turned by in the map, after its coordinates are converted to the map's system.

    `yaw`, radians, counter-clockwise, is the rotation from the plot's own axes. Grids have norths of their own: at the
    edge of a UTM zone they differ by 3 degrees from those of the next.
    """
    own = None if plot.is_local else system.point_of(plot.trees.crs, plot.centre)
    return -math.degrees(math.remainder(yaw - (0.0 if own is None else own[1]), 2.0 * math.pi))


def plot_trees(plot: SeasonPlot, fit: MapFit, there: MapTrees, system: FrameSystem) -> list[PlotTree]:
    """The plot's trees in the map, with their partners."""
    placed = fit.transform.apply(plot.trees.xy - np.array(plot.centre)) + np.array(system.origin)
    partner = dict(
        zip(fit.query_indices.tolist(), zip(fit.map_indices.tolist(), fit.residuals.tolist(), strict=True), strict=True)
    )
    dbh, of_map = listed(plot.trees.dbh_cm, len(plot.trees)), listed(there.dbh_cm, len(there.ids))
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


def map_trees_of(fit: MapFit, there: MapTrees, system: FrameSystem) -> list[MapTree]:
    """The trees of the map around the plot."""
    paired, inside = set(fit.map_indices.tolist()), set(fit.missing.tolist())
    dbh, xy = listed(there.dbh_cm, len(there.ids)), there.xy + np.array(system.origin)
    return [
        MapTree(there.ids[tree], e, n, dbh[tree], tree in paired, tree in paired or tree in inside)
        for tree, (e, n) in enumerate(xy.tolist())
    ]
