import numpy as np
import pytest

from tests.urquhart import forests
from urquhart import SE2, Config, LandmarkError, Recognition, Recognizer, describe
from urquhart.evaluation.simulation import Sensor, SimulatedObservation, observe, paper_forest, plantation
from urquhart.options import Method

FOREST = paper_forest(np.random.default_rng(0), side=400.0)
CENTRES = [
    SE2(x, y, 0.3 * k) for k, (x, y) in enumerate((x, y) for x in range(60, 360, 40) for y in range(60, 360, 40))
]
SUBMAPS = [
    observe(FOREST, pose, Sensor(40.0, sigma=0.05, detection=0.95), np.random.default_rng(k))
    for k, pose in enumerate(CENTRES)
]


def build(config: Config | None = None) -> Recognizer:
    config = config or Config()
    recognizer = Recognizer(config)
    recognizer.add((key, describe(submap.xy, config)) for key, submap in enumerate(SUBMAPS))
    return recognizer


RECOGNIZER = build()


def look(seed: int, sigma: float = 0.1, detection: float = 0.9) -> SimulatedObservation:
    rng = np.random.default_rng(1000 + seed)
    pose = forests.pose(rng, 80.0, 320.0)
    return observe(FOREST, pose, Sensor(40.0, sigma=sigma, detection=detection), rng)


def error(found: Recognition, observation: SimulatedObservation) -> tuple[float, float]:
    best = found.candidates[0]
    shift, turn = (CENTRES[best.key] @ best.transform).distance(observation.pose)
    return shift, float(np.degrees(turn))


def outline(found: Recognition) -> list[tuple[int, str, float, bytes]]:
    return [(c.key, c.level, c.evidence, c.query_indices.tobytes()) for c in found.candidates]


@pytest.mark.parametrize(
    ("sigma", "detection", "least"), [(0.0, 1.0, 40), (0.1, 0.95, 40), (0.2, 0.9, 40), (0.3, 0.8, 36)]
)
def test_an_observation_is_found_where_it_was_made(sigma: float, detection: float, least: int) -> None:
    right = 0
    for seed in range(40):
        observation = look(seed, sigma, detection)
        found = RECOGNIZER.locate(observation.xy)
        if found.verdict == "matched":
            shift, turn = error(found, observation)
            assert shift < 1.0
            assert turn < 3.0
            right += 1
    assert right >= least


def test_inliers_are_the_same_trees() -> None:
    same = total = 0
    for seed in range(20):
        observation = look(seed)
        best = RECOGNIZER.locate(observation.xy).candidates[0]
        same += int((observation.trees[best.query_indices] == SUBMAPS[best.key].trees[best.submap_indices]).sum())
        total += len(best.query_indices)
        assert best.residuals.max() <= 1.5
        assert 0.0 < best.inlier_ratio <= 1.0
        assert 0.0 < best.overlap_ratio <= 1.0
        assert best.rms == pytest.approx(float(np.sqrt((best.residuals**2).mean())))
    assert same / total > 0.99


def test_the_covariance_covers_the_error() -> None:
    """Squared Mahalanobis distances have three degrees of freedom: three on average."""
    squared = []
    for seed in range(40):
        observation = look(seed)
        best = RECOGNIZER.locate(observation.xy).candidates[0]
        truth = CENTRES[best.key].inverse() @ observation.pose
        off = np.array([best.transform.x - truth.x, best.transform.y - truth.y, best.transform.yaw - truth.yaw])
        off[2] = (off[2] + np.pi) % (2.0 * np.pi) - np.pi
        squared.append(float(off @ np.linalg.solve(best.covariance, off)))
    assert 1.5 < np.mean(squared) < 6.0


@pytest.mark.parametrize("seed", range(40))
def test_a_place_that_is_not_there_is_not_matched(seed: int) -> None:
    rng = np.random.default_rng(seed)
    elsewhere = paper_forest(np.random.default_rng(500 + seed), side=200.0)
    observation = observe(
        elsewhere, SE2(100.0, 100.0, rng.uniform(-3.0, 3.0)), Sensor(40.0, sigma=0.1, detection=0.9), rng
    )
    assert RECOGNIZER.locate(observation.xy).verdict != "matched"


@pytest.mark.parametrize(
    ("spacing", "jitter", "survival"), [((3.0, 3.0), 0.15, 0.95), ((3.0, 3.0), 0.4, 0.95), ((2.5, 3.5), 0.3, 0.9)]
)
def test_another_plantation_of_the_same_pattern_is_not_matched(
    spacing: tuple[float, float], jitter: float, survival: float
) -> None:
    rng = np.random.default_rng(7)
    mapped, foreign = (
        plantation(100.0, 100.0, rng, spacing=spacing, jitter=jitter, survival=survival) for _ in range(2)
    )
    recognizer = Recognizer(Config())
    recognizer.add(
        (k, describe(observe(mapped, SE2(x, y, 0.0), Sensor(20.0), rng).xy, Config()))
        for k, (x, y) in enumerate((x, y) for x in range(20, 90, 12) for y in range(20, 90, 12))
    )
    verdicts = []
    for _ in range(8):
        pose = forests.pose(rng, 25.0, 75.0)
        verdicts.append(
            recognizer.locate(observe(foreign, pose, Sensor(20.0, sigma=0.1, detection=0.9), rng).xy).verdict
        )
    assert "matched" not in verdicts
    inside = observe(mapped, SE2(50.0, 50.0, 2.0), Sensor(20.0, sigma=0.02), rng)
    assert recognizer.locate(inside.xy).verdict == "matched"


@pytest.mark.parametrize("seed", range(5))
def test_moving_or_reordering_the_observation_moves_the_answer_with_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    observation = look(seed)
    plain = RECOGNIZER.locate(observation.xy).candidates[0]

    motion = forests.pose(rng, -500.0, 500.0)
    moved = RECOGNIZER.locate(motion.apply(observation.xy)).candidates[0]
    assert moved.key == plain.key
    shift, turn = (moved.transform @ motion).distance(plain.transform)
    assert shift < 1e-6
    assert turn < 1e-8

    order = rng.permutation(len(observation.xy))
    reordered = RECOGNIZER.locate(observation.xy[order]).candidates[0]
    assert reordered.key == plain.key
    pairs = set(zip(order[reordered.query_indices].tolist(), reordered.submap_indices.tolist(), strict=True))
    assert pairs == set(zip(plain.query_indices.tolist(), plain.submap_indices.tolist(), strict=True))


def test_adding_replacing_and_removing_is_seen_at_once() -> None:
    recognizer, observation = Recognizer(Config()), look(3)
    assert recognizer.locate(observation.xy).reason == "empty_collection"
    true = {c.key for c in RECOGNIZER.locate(observation.xy, limit=3).candidates if c.refused is None}
    recognizer.add((key, describe(SUBMAPS[key].xy, Config())) for key in range(len(SUBMAPS)) if key not in true)
    [other] = [min(true)]
    recognizer.add([(other, describe(forests.uniform(np.random.default_rng(0)), Config()))])
    size = len(recognizer)
    recognizer.add([(other, describe(SUBMAPS[other].xy, Config()))])
    assert len(recognizer) == size
    assert other in recognizer
    found = recognizer.locate(observation.xy)
    assert found.verdict == "matched"
    recognizer.remove([other, 12345])
    assert other not in recognizer
    assert other not in {c.key for c in recognizer.locate(observation.xy, limit=99).candidates}


def test_a_history_of_changes_answers_like_a_fresh_build() -> None:
    rng = np.random.default_rng(0)
    recognizer = Recognizer(Config())
    for key in rng.permutation(len(SUBMAPS)).tolist():
        recognizer.add([(key, describe(SUBMAPS[int(rng.integers(0, 9))].xy, Config()))])
        recognizer.add([(key, describe(SUBMAPS[key].xy, Config()))])
    for seed in range(5):
        observation = look(seed)
        assert outline(recognizer.locate(observation.xy)) == outline(RECOGNIZER.locate(observation.xy))


def test_excluded_submaps_are_not_considered() -> None:
    observation = look(5)
    best = RECOGNIZER.locate(observation.xy).candidates[0].key
    assert best not in {c.key for c in RECOGNIZER.locate(observation.xy, exclude=[best], limit=99).candidates}
    everything = RECOGNIZER.locate(observation.xy, exclude=range(len(SUBMAPS)))
    assert (everything.verdict, everything.reason) == ("no_match", "all_filtered_out")


@pytest.mark.parametrize(
    ("xy", "reason"),
    [
        ([], "too_few_landmarks"),
        ([[1.0, 2.0], [3.0, 4.0]], "too_few_landmarks"),
        ([[float(i), 0.0] for i in range(9)], "collinear_landmarks"),
    ],
)
def test_seeing_too_little_is_an_answer(xy: list[list[float]], reason: str) -> None:
    found = RECOGNIZER.locate(xy)
    assert (found.verdict, found.reason, found.candidates) == ("no_match", reason, ())


def test_wrong_input_is_an_error() -> None:
    with pytest.raises(LandmarkError, match="not a finite number"):
        RECOGNIZER.locate([[0.0, 0.0], [1.0, 0.0], [0.0, np.nan]])
    with pytest.raises(LandmarkError, match="closer than"):
        RECOGNIZER.locate([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]])


def test_three_trees_are_never_enough() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        corner = SUBMAPS[seed].xy[describe(SUBMAPS[seed].xy, Config()).tessellation.triangles[5]]
        assert RECOGNIZER.locate(corner + rng.normal(0.0, 0.02, (3, 2))).verdict != "matched"


def test_features_of_another_configuration_are_refused() -> None:
    recognizer = Recognizer(Config())
    with pytest.raises(ValueError, match="another configuration"):
        recognizer.add([(1, describe(SUBMAPS[0].xy, Config(samples=32)))])
    assert len(recognizer) == 0


@pytest.mark.parametrize("method", ["robust", "paper"])
def test_the_same_seed_gives_the_same_bytes(method: Method) -> None:
    observation = look(8)
    a, b = (RECOGNIZER.locate(observation.xy, method=method, rng=np.random.default_rng(4)) for _ in range(2))
    assert outline(a) == outline(b)
    assert (a.verdict, a.lead) == (b.verdict, b.lead)


def test_the_paper_finds_its_way_on_easy_data() -> None:
    right = 0
    for seed in range(20):
        observation = look(seed, 0.05, 0.98)
        found = RECOGNIZER.locate(observation.xy, method="paper")
        if found.verdict == "matched":
            assert error(found, observation)[0] < 1.0
            assert found.candidates[0].level == "paper"
            right += 1
    assert right >= 16


def test_limit_and_stages() -> None:
    found = RECOGNIZER.locate(look(9).xy, limit=3)
    assert len(found.candidates) == 3
    evidence = [c.evidence for c in found.candidates]
    assert evidence == sorted(evidence, reverse=True)
    names = [stage.name for stage in found.stages]
    assert names[:4] == ["describe", "search quads", "verify quads", "find rivals"]
    assert all(stage.milliseconds >= 0.0 for stage in found.stages)


@pytest.mark.parametrize("config", [Config(squared=True), Config(samples=32), Config(keep_hull=True), Config(gamma=8)])
def test_other_configurations_find_it_too(config: Config) -> None:
    recognizer, observation = build(config), look(11)
    methods: tuple[Method, ...] = ("robust", "paper")
    for method in methods:
        found = recognizer.locate(observation.xy, method=method)
        if method == "robust":
            assert found.verdict == "matched"
        if found.verdict == "matched":
            assert error(found, observation)[0] < 1.0


def test_landmarks_in_map_coordinates_change_nothing() -> None:
    """A query in UTM metres: the transform takes the large numbers, the inliers stay the same."""
    observation = look(12)
    offset = np.array([432_000.0, 5_310_000.0])
    plain, far = (
        RECOGNIZER.locate(observation.xy).candidates[0],
        RECOGNIZER.locate(observation.xy + offset).candidates[0],
    )
    np.testing.assert_array_equal(plain.query_indices, far.query_indices)
    np.testing.assert_allclose(plain.residuals, far.residuals, atol=1e-6)
    assert (far.transform @ SE2.shift(offset)).distance(plain.transform)[0] < 1e-6
