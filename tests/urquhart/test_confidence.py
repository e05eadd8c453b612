"""Confidence: what the odds do as evidence, leads and overlaps change, and when two poses rival each other."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from urquhart import SE2, Config, Gates, describe
from urquhart.decide.confidence import (
    chance_logit,
    combine,
    comparable,
    extrapolated,
    log_odds,
    odds_of_coincidence,
    odds_of_coincidence_nearby,
    probability,
    refusal,
    rival_logit,
    rival_threshold,
    unexplained,
)
from urquhart.decide.rivals import RivalSearch, distinct, find_rivals, hill_climb, pose_row, same_place
from urquhart.evaluation.simulation import Sensor, observe, paper_forest, plantation
from urquhart.propose.query import log_volume
from urquhart.verify.evidence import PoseEvidence, evidence_of_row
from urquhart.verify.landmark_grid import LandmarkGrid, landmark_grid
from urquhart.verify.refinement import verify

CONFIG = Config()
MARGIN = CONFIG.lead_per_landmark
REACH = 0.75
FAR_BELOW, ODDS = -8.0, np.linspace(-7.9, 40.0, 60)


def pose_with(evidence: float = 50.0, overlap: int = 40, inliers: range = range(30)) -> PoseEvidence:
    """A pose with this evidence, as many landmarks in the overlap, and these landmarks of the query as inliers."""
    indices = np.array(inliers, np.int64)
    return PoseEvidence(
        SE2.identity(), evidence, 0.0, indices, indices, np.zeros(len(indices)), overlap, overlap - 5, 0.1
    )


def laid(trees: np.ndarray, pose: SE2, seed: int, radius: float) -> tuple[LandmarkGrid, SE2]:
    """What is seen from `pose`, and `map_T_pattern` of its centred frame."""
    seen = observe(trees, pose, Sensor(radius, sigma=0.05, detection=0.95), np.random.default_rng(seed))
    features = describe(seen.xy, CONFIG)
    return landmark_grid(features, REACH), pose @ SE2.shift(features.origin)


def test_better_odds_against_chance_are_never_worth_less() -> None:
    worth = [chance_logit(odds) for odds in ODDS]
    assert all(a < b for a, b in itertools.pairwise(worth))
    assert worth[0] < 0.0 < worth[-1]


def test_below_the_floor_odds_against_chance_stay_what_they_are() -> None:
    floor = chance_logit(FAR_BELOW)
    assert [chance_logit(odds) for odds in (-math.inf, -1e6, -9.0)] == [floor] * 3
    assert chance_logit(FAR_BELOW + 0.1) > floor


def test_a_lead_counts_by_what_it_is_more_than_the_overlap_lets_expect() -> None:
    verified = pose_with(overlap=40)
    # A rival with evidence of its own is discounted; one without is not.
    alone = replace(verified, evidence=5.0)
    gates, told = Gates.of(CONFIG), MARGIN * 40
    assert rival_logit(alone, told + gates.lead, MARGIN) == pytest.approx(CONFIG.gate)
    assert rival_logit(pose_with(overlap=50), told + gates.lead, MARGIN) < CONFIG.gate
    assert rival_logit(replace(verified, evidence=90.0), 20.0, MARGIN) < rival_logit(alone, 20.0, MARGIN)
    worth = [rival_logit(verified, lead, MARGIN) for lead in (-20.0, 0.0, 10.0, 20.0, 60.0)]
    assert worth == sorted(set(worth))
    # More trees in the overlap, of either side, and the same lead says less.
    assert rival_logit(pose_with(overlap=80), 20.0, MARGIN) < rival_logit(verified, 20.0, MARGIN)
    swapped = replace(verified, query_overlap=verified.submap_overlap, submap_overlap=verified.query_overlap)
    assert rival_logit(swapped, 20.0, MARGIN) == rival_logit(verified, 20.0, MARGIN)


def test_without_a_rival_nothing_stands_against_it() -> None:
    assert rival_logit(pose_with(), None, MARGIN) == math.inf
    assert combine(3.0, math.inf) == pytest.approx(3.0)


@pytest.mark.parametrize("chance", [-30.0, -5.0, 0.0, 6.9, 50.0])
@pytest.mark.parametrize("rival", [-30.0, -5.0, 0.0, 6.9, 50.0])
def test_both_odds_together_are_no_better_than_the_worse_and_not_much_worse(chance: float, rival: float) -> None:
    both, worse = combine(chance, rival), min(chance, rival)
    assert worse - math.log(2.0) <= both + 1e-12
    assert both <= worse
    assert combine(rival, chance) == pytest.approx(both)
    if abs(chance - rival) > 5.0:
        assert both == pytest.approx(worse, abs=0.01)


@pytest.mark.parametrize("odds", [-3.0, 0.0, 6.9, 13.8])
@pytest.mark.parametrize("margin", [0.0, 0.25, 1.0])
def test_evidence_surely_behind_leaves_just_those_odds(odds: float, margin: float) -> None:
    best = pose_with(evidence=70.0, overlap=50)
    behind = rival_threshold(best, odds, margin)
    assert rival_logit(best, best.evidence - behind, margin) == pytest.approx(odds)
    assert rival_logit(best, best.evidence - behind - 1.0, margin) < odds


@pytest.mark.parametrize(
    "config", [Config(), Config(gate=3.0, lead_per_landmark=0.0), Config(gate=10.0, lead_per_landmark=1.0)]
)
def test_the_gates_named_are_the_gates_in_force(config: Config) -> None:
    gates, verified, little = Gates.of(config), pose_with(overlap=40), 1e-6
    assert refusal(verified, gates.log_odds + little, None, config.lead_per_landmark, config.gate) is None
    assert refusal(verified, gates.log_odds - little, None, config.lead_per_landmark, config.gate) == "below_gate"
    assert probability(verified, gates.log_odds, None, config) == pytest.approx(gates.confidence)
    # Far beyond chance the lead alone decides.
    sure = gates.log_odds + 1000.0
    needed = gates.lead + 40 * gates.lead_per_landmark
    lead = needed + gates.lead_ratio * max(verified.evidence - needed, 0.0) / (1.0 + gates.lead_ratio)
    assert refusal(verified, sure, lead + little, config.lead_per_landmark, config.gate) is None
    assert refusal(verified, sure, lead - little, config.lead_per_landmark, config.gate) is not None
    close = replace(verified, evidence=lead + 50.0)
    assert refusal(close, sure, lead - little, config.lead_per_landmark, config.gate) == "rival_too_close"
    assert probability(verified, sure, lead, config) == pytest.approx(gates.confidence)
    # Neither is enough where both are just reached: one may be wrong in either way.
    both = refusal(verified, gates.log_odds + little, lead + little, config.lead_per_landmark, config.gate)
    assert both == "below_gate"


def test_what_speaks_against_itself_is_refused_whatever_the_odds() -> None:
    assert refusal(pose_with(evidence=0.0), 100.0, None, MARGIN, CONFIG.gate) == "verification_failed"
    assert refusal(pose_with(evidence=-3.0), 100.0, 100.0, MARGIN, CONFIG.gate) == "verification_failed"


def test_a_rival_that_explains_nothing_itself_makes_nothing_ambiguous() -> None:
    weak = pose_with(evidence=20.0)
    lead = 5.0 + weak.evidence
    assert rival_logit(weak, lead, MARGIN) < CONFIG.gate
    assert refusal(weak, 40.0, lead, MARGIN, CONFIG.gate) == "below_gate"
    assert refusal(weak, 40.0, weak.evidence - 5.0, MARGIN, CONFIG.gate) == "rival_too_close"


def test_confidence_is_a_probability_that_grows_with_odds_and_lead() -> None:
    verified = pose_with(overlap=40)
    leads = [None, *np.linspace(200.0, -200.0, 41).tolist()]
    table = np.array([[probability(verified, float(odds), lead, CONFIG) for lead in leads] for odds in ODDS])
    assert ((table >= 0.0) & (table <= 1.0)).all()
    assert (np.diff(table, axis=0) >= 0.0).all()
    assert (np.diff(table, axis=1) <= 0.0).all()
    # Neither line goes on for ever: a pose of which nothing is known is right now and then.
    assert 0.0 < table[0, -1] < 0.02
    assert table[-1, 0] > 1.0 - 1e-6


def test_poses_that_claim_other_trees_are_no_rivals() -> None:
    best = pose_with(inliers=range(30))
    assert not comparable(pose_with(inliers=range(30, 60)), best)
    assert not comparable(pose_with(inliers=range(16, 60)), best)
    assert comparable(pose_with(inliers=range(15, 60)), best)
    assert comparable(best, best)
    # It is the best pose's trees that count: one that claims a few of them and no others is none.
    assert not comparable(pose_with(inliers=range(14)), best)
    assert comparable(best, pose_with(inliers=range(14)))


def test_submaps_of_one_region_are_the_same_place() -> None:
    forest = paper_forest(np.random.default_rng(0), 400.0)
    query, there = SE2(200.0, 200.0, 0.4), SE2(260.0, 130.0, 1.0)
    one, map_T_one = laid(forest, SE2(190.0, 200.0, 1.0), 1, 40.0)
    two, map_T_two = laid(forest, SE2(210.0, 205.0, -2.0), 2, 40.0)
    far, _ = laid(forest, there, 3, 40.0)
    first, second = map_T_one.inverse() @ query, map_T_two.inverse() @ query
    assert same_place(one, first, two, second, CONFIG)
    assert same_place(two, second, one, first, CONFIG)
    assert not same_place(one, first, far, second, CONFIG)
    # Two poses in one submap that are not the same: the forest does not explain itself five metres off.
    assert not same_place(one, first, one, SE2.shift(np.array([5.0, 0.0])) @ first, CONFIG)


@pytest.mark.parametrize("jitter", [0.3, 0.2, 0.1, 0.05, 0.0])
def test_two_ends_of_one_plantation_are_not_the_same_place(jitter: float) -> None:
    rows = plantation(150.0, 60.0, np.random.default_rng(4), jitter=jitter, survival=0.97)
    one, map_T_one = laid(rows, SE2(30.0, 30.0, 0.3), 5, 20.0)
    two, map_T_two = laid(rows, SE2(120.0, 30.0, -1.0), 6, 20.0)
    query = SE2(30.0, 30.0, 0.0)
    # A query at one end, laid over the other end along the rows: every tree falls onto a tree.
    mistaken = map_T_two.inverse() @ SE2.shift(np.array([90.0, 0.0])) @ query
    chained = verify(two, one, map_T_one.inverse() @ query @ mistaken.inverse(), REACH)
    assert chained.evidence > 0.0
    assert not same_place(one, map_T_one.inverse() @ query, two, mistaken, CONFIG)


def test_rivals_in_rows_are_distinct_places_that_explain_much() -> None:
    rows = plantation(80.0, 80.0, np.random.default_rng(7), jitter=0.05, survival=0.97)
    stand, _ = laid(rows, SE2(40.0, 40.0, 0.2), 8, 20.0)
    best = verify(stand, stand, SE2.identity(), REACH)
    rivals = find_rivals(stand, stand, pose_row(best.transform), RivalSearch(REACH, 0.0, 4))
    assert rivals.shape[1] == 6
    assert all(distinct(rival, pose_row(best.transform), stand.spacing, REACH) for rival in rivals)
    strongest = evidence_of_row(stand, stand, rivals[rivals[:, 3].argmax()])
    assert comparable(strongest, best)
    assert strongest.evidence > 0.5 * best.evidence


def test_what_overlaps_less_is_extrapolated_at_the_rate_of_what_is_seen() -> None:
    evidence, overlap = np.array([30.0, 30.0, 30.0, 30.0]), np.array([10.0, 20.0, 40.0, 80.0])
    np.testing.assert_allclose(extrapolated(evidence, overlap, 40), [120.0, 60.0, 30.0, 30.0])


def test_credit_never_lowers_and_what_speaks_against_is_left_alone() -> None:
    rng = np.random.default_rng(0)
    evidence, overlap = rng.normal(0.0, 60.0, 500), rng.integers(0, 120, 500).astype(np.float64)
    for wanted in (0, 1, 40, 1000):
        given = extrapolated(evidence, overlap, wanted)
        assert np.isfinite(given).all()
        assert (given >= evidence).all()
        unchanged = (evidence <= 0.0) | (overlap >= wanted)
        np.testing.assert_array_equal(given[unchanged], evidence[unchanged])
        assert (given[~unchanged & (overlap > 0.0)] > evidence[~unchanged & (overlap > 0.0)]).all()
    assert extrapolated(np.empty(0), np.empty(0), 40).shape == (0,)


def test_a_rival_that_chance_explains_adds_its_share_of_the_odds_of_error_only() -> None:
    best, evidence = pose_with(evidence=60.0, overlap=12, inliers=range(10)), 45.0
    whole = rival_logit(best, best.evidence - evidence, MARGIN)
    counted = [unexplained(evidence, odds) for odds in ODDS]
    assert all(a <= b for a, b in itertools.pairwise(counted))
    assert counted[-1] == pytest.approx(evidence)
    for odds in (-6.0, -1.0, 0.0, 3.0):
        partly = rival_logit(best, best.evidence - unexplained(evidence, odds), MARGIN)
        assert math.exp(-partly) == pytest.approx(math.exp(-whole) / (1.0 + math.exp(-odds)))
    assert unexplained(evidence, -math.inf) == unexplained(evidence, FAR_BELOW) < evidence


def test_chance_explains_less_of_a_rival_in_the_same_submap_than_of_one_in_a_collection() -> None:
    forest = paper_forest(np.random.default_rng(3), 120.0)
    query, _ = laid(forest, SE2(60.0, 60.0, 0.3), 4, 30.0)
    rival = pose_with(evidence=20.0, inliers=range(5))
    here = odds_of_coincidence_nearby(rival, query, query.area)
    for submaps in (1, 1_000):
        volume = log_volume(submaps, query)
        anywhere = odds_of_coincidence(rival, query, volume)
        assert log_odds(rival, query, volume) < anywhere < here < rival.evidence
    assert odds_of_coincidence_nearby(rival, query, 4.0 * query.area) == pytest.approx(here - math.log(4.0))
    assert odds_of_coincidence_nearby(pose_with(inliers=range(1)), query, query.area) == -math.inf


def test_rivals_are_the_strongest_first_and_none_is_surely_behind() -> None:
    rows = plantation(80.0, 80.0, np.random.default_rng(7), jitter=0.1, survival=0.97)
    stand, _ = laid(rows, SE2(40.0, 40.0, 0.2), 8, 20.0)
    start, found = verify(stand, stand, SE2.identity(), REACH), []
    for odds in (100.0, 300.0, 1000.0):
        best, rivals = hill_climb(stand, stand, start, odds, CONFIG)
        evidence = [counted for _, counted in rivals]
        assert evidence == sorted(evidence, reverse=True)
        assert all(counted > rival_threshold(best, odds, MARGIN) for counted in evidence)
        assert all(counted >= rival.evidence for rival, counted in rivals)
        assert all(
            distinct(pose_row(one.transform), pose_row(other.transform), stand.spacing, REACH)
            for one, other in itertools.combinations([best, *(rival for rival, _ in rivals)], 2)
        )
        found.append(len(rivals))
    assert found == sorted(found)
    assert found[-1] > 0


def test_in_one_submap_a_rival_that_claims_other_trees_is_one_too_but_is_not_extrapolated() -> None:
    """The query has two edges of stands in it, the submap one: it fits either, turned about."""
    rng = np.random.default_rng(6)
    half = plantation(24.0, 48.0, rng, spacing=(4.0, 4.0), jitter=0.02, survival=1.0)
    here = landmark_grid(describe(half, CONFIG), REACH)
    other = plantation(24.0, 48.0, rng, spacing=(4.0, 4.0), jitter=0.02, survival=1.0)
    both = np.concatenate([half, SE2(52.0, 44.0, math.pi).apply(other)])
    seen = describe(both, CONFIG)
    query = landmark_grid(seen, REACH)
    right = SE2.shift(describe(half, CONFIG).origin).inverse() @ SE2.shift(seen.origin)
    best, rivals = hill_climb(query, here, verify(query, here, right, REACH), 200.0, CONFIG)
    assert best.transform.distance(right)[0] < 0.1
    elsewhere = [(rival, counted) for rival, counted in rivals if not comparable(rival, best)]
    assert elsewhere
    assert all(counted == rival.evidence for rival, counted in elsewhere)
    assert max(counted for _, counted in elsewhere) > 0.5 * best.evidence
