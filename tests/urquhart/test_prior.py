"""A search within a prior's window: what it finds, and what it must not."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart import SE2, Budget, Config, Prior, Recognizer, WindowTooLarge, describe
from urquhart.evaluation.simulation import bridson, plantation
from urquhart.prior.region import REGION, Region
from urquhart.prior.superposition import (
    depth_inside,
    diameter_ratios,
    edges_of,
    rim,
    superpose,
    trial_noise,
    visibility,
)
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
PRIOR = Prior.with_sigma(X, Y, SIGMA, 0.0)


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
    return Prior.with_sigma(pose.x, pose.y, SIGMA, pose.yaw)


@pytest.mark.parametrize("away", [(14.0, 0.0), (-13.0, 9.0)])
def test_a_window_without_the_plot_gives_no_match(away: tuple[float, float]) -> None:
    x, y = CENTRE + away
    found = STORED.recognize_within(describe(PLOT, CONFIG), Prior.with_sigma(x, y, SIGMA, 0.0), PLACES)
    assert found.verdict == "no_match"


def test_rows_of_trees_are_never_matched_where_the_plot_is_not() -> None:
    rows = plantation(80.0, 80.0, np.random.default_rng(2), jitter=0.15, survival=0.95)
    stored = collection(rows, PLACES)
    seen = rows[np.hypot(*(rows - (20.0, 40.0)).T) < 9.0] - (20.0, 40.0)
    found = stored.recognize_within(describe(seen, CONFIG), Prior.with_sigma(42.0, 41.0, SIGMA, 0.0), PLACES)
    assert found.verdict != "matched"


def test_nothing_near_the_window_gives_no_match() -> None:
    far = STORED.recognize_within(describe(PLOT, CONFIG), Prior.with_sigma(500.0, 0.0, SIGMA, 0.0), PLACES)
    none = STORED.recognize_within(describe(PLOT, CONFIG), PRIOR, {})
    assert (far.verdict, far.reason) == ("no_match", "no_proposal")
    assert (none.verdict, none.reason) == ("no_match", "all_filtered_out")


def test_a_deadline_ends_the_search() -> None:
    found = STORED.recognize_within(describe(PLOT, CONFIG), PRIOR, PLACES, budget=Budget(seconds=0.0))
    assert (found.verdict, found.reason) == ("no_match", "deadline")


def test_a_vague_prior_is_refused() -> None:
    with pytest.raises(WindowTooLarge, match="a heading or a smaller"):
        STORED.recognize_within(describe(PLOT, CONFIG), Prior.with_sigma(X, Y, 100.0), PLACES)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": math.nan}, "x .* finite"),
        ({"covariance": np.zeros((3, 3))}, "positive definite over x, y and yaw"),
        ({"yaw": None, "covariance": np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 0.0]])}, "over x and y:"),
        ({"covariance": np.full((3, 3), math.inf)}, "finite numbers"),
        ({"about": (math.nan, 0.0)}, "finite coordinates"),
        ({"noise": 9.0}, "0.1 to 2 m, not 9"),
    ],
)
def test_an_impossible_prior_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(PRIOR, **change)


@pytest.mark.parametrize("sigmas", [{"sigma": 0.0}, {"sigma": 1.0, "yaw_sigma": -1.0}])
def test_a_standard_deviation_is_positive(sigmas: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="sigma of a prior must be a positive number"):
        Prior.with_sigma(X, Y, yaw=0.0, **sigmas)


def test_the_window_of_a_covariance_is_as_long_and_as_narrow_as_that() -> None:
    c, s = math.cos(0.5), math.sin(0.5)
    axes = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    covariance = axes @ np.diag([4.0**2, 0.5**2, 0.02**2]) @ axes.T
    region = Region.of(Prior(X, Y, covariance, 0.0), describe(PLOT, CONFIG), np.zeros(2))
    poses, log_prior = region.grid(12.0)
    assert np.exp(log_prior).sum() == pytest.approx(1.0)
    here = poses[np.abs(poses[:, 2]) < 1e-9][:, :2]
    away = (here - here.mean(axis=0)) @ axes[:2, :2]
    assert np.abs(away).max(axis=0) == pytest.approx([REGION.wide * 4.0, REGION.wide * 0.5])
    assert np.isneginf(region.log_density(poses + np.array([8.0, -15.0, 0.0]))).all()
    assert np.isneginf(region.log_density(poses + np.array([0.0, 0.0, 0.2]))).all()


def test_position_and_heading_that_go_together_make_a_narrower_window() -> None:
    covariance = np.array([[4.0, 0.0, 0.0], [0.0, 4.0, 0.038], [0.0, 0.038, 0.0004]])
    region = Region.of(Prior(X, Y, covariance, 0.0), describe(PLOT, CONFIG), np.zeros(2))
    assert region.spread[1, 1] < 0.5 < region.spread[0, 0]
    turned = region.grid(12.0)[0]
    left, right = turned[turned[:, 2] < -0.06], turned[turned[:, 2] > 0.06]
    assert right[:, 1].mean() - left[:, 1].mean() > 10.0


def test_a_prior_about_a_far_point_is_the_same_prior() -> None:
    moved = dataclasses.replace(PRIOR, about=(30.0, -20.0), x=X + 30.0, y=Y - 20.0)
    found = [STORED.recognize_within(describe(PLOT, CONFIG), prior, PLACES).candidates[0] for prior in (PRIOR, moved)]
    assert found[0].transform.distance(found[1].transform)[0] < 0.3


@pytest.mark.parametrize("noise", [0.05, 0.4])
@pytest.mark.parametrize("over", [0.2, 0.6, 1.2])
@pytest.mark.parametrize("sigma", [0.1, SIGMA])
def test_a_place_just_outside_of_the_window_is_not_matched_at_its_edge(sigma: float, over: float, noise: float) -> None:
    away = REGION.wide * sigma + over
    prior = Prior.with_sigma(TRUTH.x - 0.6 * away, TRUTH.y + 0.8 * away, sigma, 0.0)
    found = STORED.recognize_within(describe(plot(TRUTH, noise), CONFIG), prior, PLACES)
    assert found.verdict == "no_match"
    # Farther away, the edge of the window has no evidence of its own.
    assert found.reason == "outside_prior" or over > 1.0
    if found.reason == "outside_prior":
        (best,) = found.candidates
        assert best.refused == "outside_prior"
        assert sigma < SIGMA or (PLACES[best.key] @ best.transform).distance(TRUTH)[0] < 0.3


@pytest.mark.parametrize("over", [0.5, 1.5, -0.5])
def test_a_heading_just_outside_of_the_window_is_not_matched_at_its_edge(over: float) -> None:
    turn = math.radians(2.0) * REGION.wide + math.radians(over)
    prior = Prior.with_sigma(TRUTH.x, TRUTH.y, SIGMA, TRUTH.yaw - turn)
    found = STORED.recognize_within(describe(plot(TRUTH, 0.05), CONFIG), prior, PLACES)
    assert found.reason == ("outside_prior" if over > 0.0 else "verified")
    assert (PLACES[found.candidates[0].key] @ found.candidates[0].transform).distance(TRUTH)[1] < math.radians(0.5)


def test_a_place_just_inside_of_the_window_is_matched_where_it_is() -> None:
    prior = Prior.with_sigma(TRUTH.x + REGION.wide * SIGMA - 0.1, TRUTH.y, SIGMA, 0.0)
    found = STORED.recognize_within(describe(plot(TRUTH, 0.05), CONFIG), prior, PLACES)
    assert found.verdict == "matched"
    assert (PLACES[found.candidates[0].key] @ found.candidates[0].transform).distance(TRUTH)[0] < 0.1


def test_nothing_outside_of_the_window_is_matched() -> None:
    away = Prior.with_sigma(TRUTH.x + 1.2, TRUTH.y, 0.3, 0.0)
    found = STORED.recognize_within(describe(PLOT, CONFIG), away, PLACES)
    assert found.verdict == "no_match"
    for one in (one for one in found.candidates if one.refused is None):
        pose = PLACES[one.key] @ one.transform
        assert math.hypot(pose.x - away.x, pose.y - away.y) < REGION.wide * 0.3 + 0.1


def test_the_noise_that_is_known_is_tried_instead_of_the_usual() -> None:
    np.testing.assert_allclose(trial_noise(2.0), [3.0, 1.5])
    np.testing.assert_allclose(trial_noise(None), [1.1, 0.55, 0.275])


@pytest.mark.parametrize("yaw", [0.5, None])
def test_the_prior_of_a_window_is_a_distribution(yaw: float | None) -> None:
    query, about = describe(PLOT, CONFIG), describe(TREES, CONFIG)
    search = search_window((query, landmark_grid(query, CONFIG.reach)), about, Prior.with_sigma(X, Y, SIGMA, yaw))
    assert np.exp(search.log_prior).sum() == pytest.approx(1.0)
    # Two windows beside this one, and two turned away from it if the heading is known.
    assert len(search.moves) == (4 if yaw is not None else 2)
    assert np.hypot(*search.moves[0][:2]) > 2.0 * REGION.wide * SIGMA


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
    edges = edges_of(search.stems.hull)
    depth = np.array([depth_inside(edges, x, y) for x, y in points]) + search.stems.margin
    mean = search.density[depth > 0.0].mean()
    for noise in trial_noise(None).tolist():
        squared = ((points[:, None] - search.stems.xy[None]) ** 2).sum(axis=2)
        peaks = np.exp(-squared / (2 * noise**2)) / (2 * math.pi * noise**2 * search.density[:, None])
        inside = 1 / (1 + np.exp(-1.702 * depth / noise))
        for visible in search.stems.visible:
            for clutter in (0.05, 0.2):
                ratio = np.log(1.0 - inside * (1.0 - clutter) + peaks @ visible)[depth > -4.4].sum()
                logs.append(ratio + (1.0 - clutter) * search.stems.area * mean - visible.sum())
    expected = np.logaddexp.reduce(logs) - math.log(len(logs))
    got = superpose(search.stems, search.trees, search.density, 0.1, np.empty((0, 0)), pose[None])
    assert got[0] == pytest.approx(expected, abs=0.01)


def test_a_gap_beside_a_clump_is_not_matched_with_two_pairs() -> None:
    """The footprint of a pose in the gap has few trees, and those are of the clump: its density is not the forest's."""
    rng, gap = np.random.default_rng(2), np.array([14.0, 9.0])
    trees = rng.uniform(-60.0, 60.0, (200, 2))
    trees = trees[np.hypot(*(trees - gap).T) > 14.0]
    trees = np.concatenate([trees, gap + (19.0, 0.0) + rng.normal(0.0, 0.7, (40, 2))])
    seen = trees[np.hypot(*trees.T) < 20.0]
    stored = Recognizer(CONFIG)
    stored.add([(1, describe(trees + rng.normal(0.0, 0.15, trees.shape), CONFIG))])
    prior = Prior(0.0, 1.5, np.diag([25.0, 25.0, math.radians(2.0) ** 2]), 0.0)
    query = describe(seen + rng.normal(0.0, 0.05, seen.shape), CONFIG)
    found = stored.recognize_within(query, prior, {1: SE2.identity()})
    pose = found.candidates[0].transform
    assert found.verdict != "matched" or math.hypot(pose.x, pose.y) < 0.5


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
