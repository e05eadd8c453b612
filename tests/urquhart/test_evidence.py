"""Evidence by its formula: what the compiled kernels sum up is what a plain sum of logarithms gives."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart import forests
from urquhart import SE2, Config, describe
from urquhart.evaluation.simulation import Sensor, observe, paper_forest
from urquhart.verify.evidence import EVIDENCE, PoseEvidence, evidence_of_pose, evidence_of_row
from urquhart.verify.landmark_grid import GRID, LandmarkGrid, build_landmark_grid, is_inside, landmark_grid
from urquhart.verify.refinement import refine_and_score, verify, verify_best

REACH = 0.75
FOREST = paper_forest(np.random.default_rng(0), side=400.0)


def seen(pose: SE2, seed: int, radius: float = 40.0, **noise: float) -> tuple[LandmarkGrid, SE2]:
    """A pattern seen from `pose`, and `map_T_pattern` of its centred frame."""
    features = describe(observe(FOREST, pose, Sensor(radius, **noise), np.random.default_rng(seed)).xy, Config())
    return landmark_grid(features, REACH), pose @ SE2.shift(features.origin)


def alone(query: LandmarkGrid, submap: LandmarkGrid, found: PoseEvidence) -> int:
    """Landmarks of the overlap that have no partner."""
    there, back = found.transform.apply(query.landmarks), found.transform.inverse().apply(submap.landmarks)
    paired, stored = set(found.query.tolist()), set(found.submap.tolist())
    here = [i for i in range(len(there)) if i not in paired and is_inside(submap, *there[i])]
    missed = [j for j in range(len(back)) if j not in stored and is_inside(query, *back[j])]
    return len(here) + len(missed)


def plain(query: LandmarkGrid, submap: LandmarkGrid, found: PoseEvidence) -> tuple[float, float]:
    """Evidence and noise, by the formula at the head of `evidence`."""
    density = np.maximum(query.density[found.query], submap.density[found.submap])
    lonely, best = alone(query, submap, found), (-np.inf, 0.0)
    for noise, detection in itertools.product(EVIDENCE.noise, EVIDENCE.detection):
        peak = np.exp(-(found.residuals**2) / (2.0 * noise**2)) / (2.0 * np.pi * noise**2 * density)
        total = np.log(1.0 - detection + detection * peak).sum() + lonely * np.log(1.0 - detection)
        best = max(best, (float(total), noise))
    return best


@pytest.mark.parametrize("seed", range(12))
def test_the_logarithm_of_products_is_the_sum_of_logarithms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    submap, map_T_submap = seen(SE2(200.0, 200.0, 0.3), seed, sigma=0.2, detection=0.8)
    query, map_T_query = seen(SE2(210.0, 195.0, 2.0), seed + 50, radius=60.0, sigma=0.2, detection=0.8)
    for pose in (map_T_submap.inverse() @ map_T_query, forests.pose(rng, -20.0, 20.0), forests.pose(rng, -90.0, 90.0)):
        found = evidence_of_pose(query, submap, pose, REACH)
        evidence, noise = plain(query, submap, found)
        assert found.evidence == pytest.approx(evidence, rel=1e-9, abs=1e-9)
        if len(found.query):
            assert found.noise == noise


def many(count: int, side: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Landmarks (N, 2), metres, at least a third of their usual distance from each other."""
    columns = int(np.ceil(np.sqrt(count)))
    cell = side / columns
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(columns)), axis=-1).reshape(-1, 2) * cell
    return grid + rng.uniform(0.0, 0.6 * cell, grid.shape)


@pytest.mark.parametrize(
    ("count", "spacing"), [(12, 2.0), (5000, 2.0), (5000, 60.0), (2000, 5000.0), (300, 0.02), (2000, 0.3)]
)
def test_thousands_of_inliers_and_any_density_give_finite_evidence(count: int, spacing: float) -> None:
    rng = np.random.default_rng(count)
    trees = many(count, spacing * np.sqrt(count), rng)
    features = describe(trees, Config())
    stand = landmark_grid(features, REACH)
    found = evidence_of_pose(stand, stand, SE2.identity(), REACH)
    assert np.isfinite(found.evidence)
    assert found.evidence == pytest.approx(plain(stand, stand, found)[0], rel=1e-9)
    away = evidence_of_pose(stand, stand, SE2(0.37 * spacing, 0.21 * spacing, 0.01), REACH)
    assert np.isfinite(away.evidence)
    assert away.evidence == pytest.approx(plain(stand, stand, away)[0], rel=1e-9, abs=1e-9)
    assert away.evidence <= found.evidence


@pytest.mark.parametrize("density", [1e-30, 1e-12, 1e12, 1e30])
def test_densities_beyond_all_forests_leave_evidence_finite(density: float) -> None:
    trees = many(400, 60.0, np.random.default_rng(1))
    features = describe(trees, Config())
    stand = build_landmark_grid(
        features.landmarks,
        np.full(len(trees), density, np.float32),
        features.tessellation.hull,
        np.empty(0, np.float32),
        REACH,
    )
    everywhere = stand._replace(cover=np.ones_like(stand.cover))
    found = evidence_of_pose(everywhere, stand, SE2.identity(), REACH)
    assert np.isfinite(found.evidence)
    # A landmark where none is to be expected says much; one among a crowd says no more than that it was not missed.
    assert (found.evidence > 20.0 * len(trees)) == (density < 1e-6)
    assert found.evidence > len(trees) * np.log(1.0 - EVIDENCE.detection[0]) - 1.0


def test_poses_settled_are_those_verified_one_by_one() -> None:
    submap, map_T_submap = seen(SE2(200.0, 200.0, 0.3), 1, sigma=0.3, detection=0.8)
    query, map_T_query = seen(SE2(208.0, 196.0, 2.0), 2, sigma=0.3, detection=0.8)
    truth = map_T_submap.inverse() @ map_T_query
    rng = np.random.default_rng(3)
    starts = np.array([[truth.x, truth.y, truth.yaw], *rng.uniform((-20.0, -20.0, -3.0), (20.0, 20.0, 3.0), (30, 3))])
    starts[1] = starts[0] + [0.4, -0.3, 0.01]
    settled = refine_and_score(query, submap, starts, REACH, 0.0)
    assert settled.shape == (len(starts), 6)
    for start, row in zip(starts, settled, strict=True):
        one = verify(query, submap, SE2(*start.tolist()), REACH)
        there = evidence_of_pose(query, submap, SE2(*row[:3].tolist()), float(row[4]))
        assert REACH <= row[4] <= GRID.loose * REACH
        for found in (one, there, evidence_of_row(query, submap, row)):
            assert found.evidence == pytest.approx(row[3], rel=1e-12, abs=1e-12)
            assert found.transform.distance(SE2(*row[:3].tolist())) == pytest.approx((0.0, 0.0), abs=1e-12)
            assert found.overlap == row[5] == max(found.query_overlap, found.submap_overlap)
    best = verify_best(query, submap, starts, REACH)
    assert best.evidence == settled[:, 3].max()
    assert best.transform.distance(truth)[0] < 0.3
    assert (settled[:, 4] > REACH).any()


def test_a_second_try_is_made_only_where_the_first_is_worth_it() -> None:
    submap, map_T_submap = seen(SE2(200.0, 200.0, 0.3), 1, sigma=0.4)
    query, map_T_query = seen(SE2(205.0, 200.0, 2.0), 2, sigma=0.4)
    truth = map_T_submap.inverse() @ map_T_query
    start = np.array([[truth.x, truth.y, truth.yaw]])
    wide, narrow = (
        refine_and_score(query, submap, start, REACH, 0.0),
        refine_and_score(query, submap, start, REACH, 1e9),
    )
    assert wide[0, 4] > narrow[0, 4] == REACH
    assert wide[0, 3] > narrow[0, 3]
