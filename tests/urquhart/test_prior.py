"""A search within a prior's window: what it finds, and what it must not."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart import SE2, Budget, Config, Prior, Recognizer, WindowTooLarge, describe
from urquhart.evaluation.simulation import bridson, plantation
from urquhart.prior.superposition import depth_inside, diameter_ratios, rim, superpose, visibility
from urquhart.prior.window import WINDOW, search_window, trees_about
from urquhart.verify.landmark_grid import landmark_grid

CONFIG = Config()
SIGMA = 1.5
X, Y = 40.0, 40.0
CENTRE = np.array([X, Y])
TRUTH = SE2(41.0, 38.5, math.radians(1.0))


def forest(seed: int = 0) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    trees = bridson(80.0, 80.0, 3.0, rng)
    return trees[rng.random(len(trees)) < 0.6]


def collection(trees: NDArray[np.float64], places: dict[int, SE2]) -> Recognizer:
    recognizer = Recognizer(CONFIG)
    for key, place in places.items():
        near = trees[np.hypot(*(trees - (place.x, place.y)).T) < 28.0]
        recognizer.add([(key, describe(place.inverse().apply(near), CONFIG))])
    return recognizer


PLACES = {1: SE2(36.0, 40.0, 0.4), 2: SE2(46.0, 40.0, -1.0)}
TREES = forest()
STORED = collection(TREES, PLACES)


def plot(pose: SE2, noise: float = 0.4) -> NDArray[np.float64]:
    near = TREES[np.hypot(*(TREES - (pose.x, pose.y)).T) < 12.0]
    return pose.inverse().apply(near + np.random.default_rng(1).normal(0.0, noise, near.shape))


PLOT = plot(TRUTH)
PRIOR = Prior(X, Y, SIGMA, 0.0)


def test_a_plot_is_found_within_its_window() -> None:
    found = STORED.recognize_within(describe(PLOT, CONFIG), PRIOR, PLACES)
    assert (found.verdict, found.reason) == ("matched", "verified")
    (best,) = found.candidates
    away, turned = (PLACES[best.key] @ best.transform).distance(TRUTH)
    assert away < 0.5 and turned < math.radians(2.0)
    assert best.level == "given" and best.refused is None and best.confidence > 0.999
    assert len(best.residuals) >= 0.7 * len(PLOT)
    assert np.linalg.eigvalsh(best.covariance).min() > 0.0
    assert found.findings[0].evidence == best.evidence


def test_the_answer_moves_with_the_frame_of_the_observation() -> None:
    moved = SE2(7.0, -3.0, 2.0)
    first, second = (
        STORED.recognize_within(describe(xy, CONFIG), prior, PLACES)
        for xy, prior in (
            (PLOT, PRIOR),
            (moved.apply(PLOT), _prior_of(SE2(X, Y, 0.0) @ moved.inverse())),
        )
    )
    assert first.verdict == second.verdict == "matched"
    a = PLACES[first.candidates[0].key] @ first.candidates[0].transform
    b = PLACES[second.candidates[0].key] @ second.candidates[0].transform @ moved
    assert a.distance(b)[0] < 0.2 and a.distance(b)[1] < 0.02


def _prior_of(pose: SE2) -> Prior:
    return Prior(pose.x, pose.y, SIGMA, pose.yaw)


@pytest.mark.parametrize("away", [(14.0, 0.0), (-13.0, 9.0)])
def test_a_window_without_the_plot_gives_no_match(away: tuple[float, float]) -> None:
    x, y = CENTRE + away
    found = STORED.recognize_within(describe(PLOT, CONFIG), Prior(x, y, SIGMA, 0.0), PLACES)
    assert found.verdict == "no_match"


def test_rows_of_trees_are_never_matched_where_the_plot_is_not() -> None:
    rows = plantation(80.0, 80.0, np.random.default_rng(2), jitter=0.15, survival=0.95)
    stored = collection(rows, PLACES)
    seen = rows[np.hypot(*(rows - (20.0, 40.0)).T) < 9.0] - (20.0, 40.0)
    found = stored.recognize_within(describe(seen, CONFIG), Prior(42.0, 41.0, SIGMA, 0.0), PLACES)
    assert found.verdict != "matched"


def test_nothing_near_the_window_gives_no_match() -> None:
    far = STORED.recognize_within(describe(PLOT, CONFIG), Prior(500.0, 0.0, SIGMA, 0.0), PLACES)
    none = STORED.recognize_within(describe(PLOT, CONFIG), PRIOR, {})
    assert (far.verdict, far.reason) == ("no_match", "no_proposal")
    assert (none.verdict, none.reason) == ("no_match", "all_filtered_out")


def test_a_deadline_ends_the_search() -> None:
    found = STORED.recognize_within(describe(PLOT, CONFIG), PRIOR, PLACES, budget=Budget(seconds=0.0))
    assert (found.verdict, found.reason) == ("no_match", "deadline")


def test_a_vague_prior_is_refused() -> None:
    with pytest.raises(WindowTooLarge, match="smaller sigma or a heading"):
        STORED.recognize_within(describe(PLOT, CONFIG), Prior(X, Y, 100.0), PLACES)


@pytest.mark.parametrize(
    ("change", "message"),
    [({"sigma": 0.0}, "sigma .* positive"), ({"x": math.nan}, "x .* finite"), ({"yaw_sigma": -1.0}, "yaw_sigma")],
)
def test_an_impossible_prior_is_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(PRIOR, **change)


@pytest.mark.parametrize("yaw", [0.5, None])
def test_the_prior_of_a_window_is_a_distribution(yaw: float | None) -> None:
    query, about = describe(PLOT, CONFIG), describe(TREES, CONFIG)
    search = search_window((query, landmark_grid(query, CONFIG.reach)), about, Prior(X, Y, SIGMA, yaw))
    assert np.exp(search.log_prior).sum() == pytest.approx(1.0)
    # The first and the last rotation are decoys of others if the heading is known, and there is none if it is not.
    assert len(search.turned) == (3 if yaw is not None else 0)


def test_trees_of_several_submaps_are_counted_once() -> None:
    submaps = {key: STORED.features(key) for key in PLACES}
    xy, diameters = trees_about(describe(PLOT, CONFIG), PRIOR, submaps, PLACES)
    assert diameters is None
    away = np.hypot(*(xy[:, None] - TREES[None]).transpose(2, 0, 1))
    assert away.min(axis=1).max() < 1e-6
    assert len(np.unique(away.argmin(axis=1))) == len(xy)


@pytest.mark.parametrize("in_both", [True, False])
def test_close_trees_stay_two_trees(in_both: bool) -> None:
    stored, here = Recognizer(CONFIG), SE2(X + 1.0, Y + 1.0, 0.0)
    one = TREES - TREES[0]
    both = np.vstack([one, one[:1] + 0.5 * WINDOW.one_tree])
    stored.add([(1, describe(both if in_both else one, CONFIG)), (2, describe(both, CONFIG))])
    submaps = {key: stored.features(key) for key in (1, 2)}
    xy, _ = trees_about(describe(PLOT, CONFIG), PRIOR, submaps, dict.fromkeys((1, 2), here))
    assert (np.hypot(*(xy - (here.x, here.y)).T) < WINDOW.one_tree).sum() == 2


def test_evidence_without_pairing_agrees_with_its_formula() -> None:
    query, about = describe(PLOT, CONFIG), describe(TREES, CONFIG)
    search = search_window((query, landmark_grid(query, CONFIG.reach)), about, PRIOR)
    pose = search.poses[len(search.poses) // 2]
    points = SE2(*pose.tolist()).inverse().apply(search.trees)
    logs = []
    depth = np.array([depth_inside(search.stems.hull, x, y) for x, y in points]) + search.stems.margin
    mean = search.density[depth > 0.0].mean()
    for noise in (0.3, 0.6, 1.0):
        squared = ((points[:, None] - search.stems.xy[None]) ** 2).sum(axis=2)
        peaks = np.exp(-squared / (2 * noise**2)) / (2 * math.pi * noise**2 * search.density[:, None])
        inside = np.array([0.5 * (1 + math.erf(d / (noise * math.sqrt(2)))) for d in depth])
        for visible in search.stems.visible:
            for clutter in (0.05, 0.2):
                ratio = np.log(1.0 - inside * (1.0 - clutter) + peaks @ visible)[depth > -4.0].sum()
                logs.append(ratio + (1.0 - clutter) * search.stems.area * mean - visible.sum())
    expected = np.logaddexp.reduce(logs) - math.log(len(logs))
    got = superpose(search.stems, search.trees, search.density, np.empty((0, 0)), pose[None])
    assert got[0] == pytest.approx(expected, abs=0.01)


def test_the_rim_has_the_area_that_the_hull_leaves_out() -> None:
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    margin, area = rim(16, square, 100.0)
    assert area == pytest.approx(100.0 / 0.75)
    assert 100.0 + 40.0 * margin + math.pi * margin**2 == pytest.approx(area)


def test_thick_stems_are_seen_where_thin_ones_are_not() -> None:
    thick = np.linspace(60.0, 10.0, 20).astype(np.float32)
    seen = visibility(20, thick)
    assert len(seen) == 4 and (np.diff(seen[2:], axis=1) < 0.0).all()
    assert len(visibility(20, np.empty(0, np.float32))) == 2


def test_diameters_of_one_tree_count_for_a_pair() -> None:
    stems = np.geomspace(10.0, 60.0, 12).astype(np.float32)
    ratios = diameter_ratios(stems, 1.05 * stems, (12, 12))
    assert ratios[0, 0] > 1.0 > ratios[0, 11]
    assert diameter_ratios(stems, np.empty(0, np.float32), (12, 5)).shape == (0, 0)
