"""What is exported for pose graphs, as the optimisers themselves read it."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.constraints.extraction import measured
from server.constraints.formats import write_out
from urquhart import SE2, Config, Recognizer, describe

gtsam = pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")
g2o = pytest.importorskip("g2opy", reason="there is no wheel of g2o's bindings for this platform")

OFFSETS = {"0": 0.0, "300 m": 300.0, "20 km": 20_000.0, "UTM": 5_000_000.0}
PAIRS = 150


@cache
def pairs(offset: float) -> tuple[list[dict[str, Any]], list[SE2]]:
    """Constraints between submaps whose trees are `offset` metres from their origins, and the true from_T_to."""
    rng = np.random.default_rng(7)
    config, found, truths = Config(), [], []
    for number in range(PAIRS):
        trees = rng.uniform(-22.0, 22.0, (60, 2))
        frames = []
        for _ in range(2):
            angle, yaw = rng.uniform(-np.pi, np.pi, 2).tolist()
            frames.append(SE2(offset * np.cos(angle), offset * np.sin(angle), yaw))
        first, second = (frame.apply(trees) + rng.normal(0.0, 0.05, trees.shape) for frame in frames)
        recognizer = Recognizer(config)
        recognizer.add([(0, describe(first, config))])
        truth = frames[0] @ frames[1].inverse()
        best = recognizer.verify_pose(describe(second, config), 0, truth).candidates[0]
        found.append({"from": f"a{number}", "to": f"b{number}", **measured(best), "stale": False})
        truths.append(truth)
    return found, truths


def exported(tmp_path: Path, name: str, wanted: Any) -> tuple[str, list[SE2]]:
    """The file, and the true poses of its edges."""
    found, truths = pairs(OFFSETS[name])
    file = tmp_path / "graph.g2o"
    file.write_bytes(write_out(found, wanted, {}))
    if wanted == "g2o_middle":
        origins = [line.split()[3:5] for line in file.read_text().splitlines() if line.startswith("# ")]
        shifts = [SE2(float(x), float(y), 0.0) for x, y in origins]
        truths = [shifts[2 * i].inverse() @ truth @ shifts[2 * i + 1] for i, truth in enumerate(truths)]
    return str(file), truths


def check(squared: list[float]) -> None:
    """The errors of three numbers, weighed by their information, are three on average; a gate of 99 % keeps 99 %."""
    assert len(squared) == PAIRS
    assert 2.5 < np.mean(squared) < 3.5
    assert np.mean(np.array(squared) < 11.34) > 0.96


@pytest.mark.parametrize("wanted", ["g2o", "g2o_middle"])
@pytest.mark.parametrize("name", OFFSETS)
def test_gtsam_reads_every_edge_and_weighs_it_right(tmp_path: Path, name: str, wanted: str) -> None:
    file, truths = exported(tmp_path, name, wanted)
    graph, values = gtsam.readG2o(file, False)
    assert (graph.size(), values.size()) == (PAIRS, 2 * PAIRS)
    squared = []
    for i, truth in enumerate(truths):
        at = gtsam.Values()
        first, second = graph.at(i).keys()
        at.insert(first, gtsam.Pose2(0.0, 0.0, 0.0))
        at.insert(second, gtsam.Pose2(truth.x, truth.y, truth.yaw))
        squared.append(2.0 * graph.at(i).error(at))
    check(squared)


@pytest.mark.parametrize(
    ("name", "wanted"), [(name, "g2o_middle") for name in OFFSETS] + [("0", "g2o"), ("300 m", "g2o")]
)
def test_g2o_reads_every_edge_and_weighs_it_right(tmp_path: Path, name: str, wanted: str) -> None:
    """g2o's error is not exact for large arms: from origins that are far away it needs vertices at the trees."""
    file, truths = exported(tmp_path, name, wanted)
    optimizer = g2o.SparseOptimizer()
    assert optimizer.load(file)
    edges = sorted(optimizer.edges(), key=lambda edge: edge.vertices()[0].id())
    assert (len(edges), len(optimizer.vertices())) == (PAIRS, 2 * PAIRS)
    squared = []
    for edge, truth in zip(edges, truths, strict=True):
        first, second = edge.vertices()
        first.set_estimate(g2o.SE2(0.0, 0.0, 0.0))
        second.set_estimate(g2o.SE2(truth.x, truth.y, truth.yaw))
        edge.compute_error()
        squared.append(edge.chi2())
    check(squared)


@pytest.mark.parametrize("name", OFFSETS)
def test_what_is_told_as_json_can_be_inverted(name: str) -> None:
    """The covariance about the trees at any origin; the one about the origin where that is not far away."""
    found, truths = pairs(OFFSETS[name])
    squared, weighed = [], []
    for one, truth in zip(found, truths, strict=True):
        at = one["transform"]
        pose, middle = SE2(at["x"], at["y"], at["yaw"]), at["middle"]
        off = np.append(truth.apply(np.array([middle["source"]]))[0] - middle["target"], truth.yaw - pose.yaw)
        off[2] = (off[2] + np.pi) % (2.0 * np.pi) - np.pi
        squared.append(float(off @ np.linalg.inv(np.reshape(middle["covariance"], (3, 3))) @ off))
        error = pose.inverse() @ truth
        off = np.array([error.x, error.y, error.yaw])
        weighed.append(float(off @ np.reshape(one["information"], (3, 3)) @ off))
        assert np.linalg.eigvalsh(np.reshape(at["covariance"], (3, 3)))[0] >= 0.0
        assert np.linalg.eigvalsh(np.reshape(middle["covariance"], (3, 3)))[0] > 0.0
    check(squared)
    if OFFSETS[name] <= 300.0:
        check(weighed)
