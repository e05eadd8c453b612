"""In which order a look-up tries what, how far it goes, and what it is told to look at."""

from collections import Counter
from dataclasses import fields
from typing import get_args

import numpy as np
import pytest

from tests.urquhart.contents import CONFIG, FOREST, outline, over, place
from urquhart import (
    SE2,
    Abandoned,
    Budget,
    Config,
    Effort,
    Method,
    Options,
    Recognition,
    Recognizer,
    SearchEnd,
    describe,
)
from urquhart.evaluation.simulation import Sensor, bridson, observe, paper_forest, plantation
from urquhart.index.collection_index import CollectionIndex
from urquhart.options import FAST_PROMISE, SearchOptions
from urquhart.propose.by_quads import QUADS as LENGTHS
from urquhart.propose.by_quads import QuadChoice, propose_by_quads
from urquhart.propose.quad_consensus import QuadConsensus
from urquhart.propose.query import Proposal, Query
from urquhart.report.explanation import SKIPS, STOPS, search_sentence
from urquhart.trace import Skipped, StoppedBy

PLACES = {key: place(key) for key in range(36)}
MANY = {key: place(key % 36, key // 36) for key in range(72)}
QUADS = ["search quads", "verify quads", "find rivals"]
POLYGONS = ["search polygons", "vote polygons", "verify polygons", "find rivals"]
EXHAUSTIVE = ["survey", "exhaustive", "verify exhaustive", "find rivals"]


def recognizer(config: Config = CONFIG, count: int = 36) -> Recognizer:
    features = {key: MANY[key] for key in range(count)}
    return over(CollectionIndex(config).with_changes(features.items()), features)


def names(found: Recognition) -> list[str]:
    return [stage.name for stage in found.stages]


def here(seed: int = 0, **noise: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    rng = np.random.default_rng(seed)
    return observe(FOREST, SE2(150.0, 150.0, 1.0), Sensor(36.0, **noise), rng).xy


def nowhere(seed: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    rng = np.random.default_rng(1_000 + seed)
    return observe(paper_forest(rng, 200.0), SE2(100.0, 100.0, 1.0), Sensor(36.0, sigma=0.1), rng).xy


def test_the_rarest_quads_come_first_and_mostly_settle_it() -> None:
    found = recognizer().locate(here(sigma=0.1, detection=0.9), limit=3)
    assert names(found) == ["describe", *QUADS]
    assert found.verdict == "matched"
    assert found.candidates[0].level == "quads"
    searched, verified = found.stages[1].counts, found.stages[2].counts
    assert searched["hits"] > 0
    # As many as are asked for, and four at the least.
    assert verified["candidates"] == 4
    assert len(found.candidates) == 3


def dense() -> tuple[Recognizer, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    """Sixty submaps of a stand in which quads resemble each other, and what is seen there."""
    rng = np.random.default_rng(0)
    trees = bridson(200.0, 200.0, 4.0, rng)
    trees += rng.normal(0.0, 0.4, trees.shape)
    recognizer = Recognizer(CONFIG)
    recognizer.add(
        (key, describe(observe(trees, SE2(x, y, 0.1 * key), Sensor(25.0, sigma=0.05), rng).xy, CONFIG))
        for key, (x, y) in enumerate(rng.uniform(25.0, 175.0, (60, 2)).tolist())
    )
    return recognizer, observe(trees, SE2(100.0, 90.0, 2.0), Sensor(25.0, sigma=0.1, detection=0.9), rng).xy


DENSE, SEEN = dense()


@pytest.mark.parametrize("limit", [1, 5, 20, 50])
def test_as_many_candidates_as_are_asked_for_although_it_stops_early(limit: int) -> None:
    found = DENSE.locate(SEEN, limit=limit)
    assert found.verdict == "matched"
    assert names(found) == ["describe", *QUADS]
    assert found.stages[2].counts["candidates"] == max(limit, 4)
    assert len(found.candidates) == limit
    assert len({candidate.key for candidate in found.candidates}) == limit
    evidence = [candidate.evidence for candidate in found.candidates]
    assert evidence == sorted(evidence, reverse=True)
    assert found.candidates[0].key == DENSE.locate(SEEN).candidates[0].key


def test_in_a_dense_stand_a_tenth_of_the_quads_settle_it_unless_the_forest_repeats_itself() -> None:
    """Rivals in other submaps may be missed then; if there are any, there is one in the same submap, too."""
    rng = np.random.default_rng(1)
    stands = [bridson(100.0, 100.0, 3.0, rng), plantation(100.0, 100.0, rng, jitter=0.0)]
    for trees, calls in zip(stands, ((1, 1), (2, 9)), strict=True):
        found = Recognizer(CONFIG)
        places = [SE2(30.0 + 10.0 * key, 50.0, 0.5 * key) for key in range(4)]
        found.add((key, describe(observe(trees, at, Sensor(28.0), rng).xy, CONFIG)) for key, at in enumerate(places))
        answer = found.locate(observe(trees, SE2(45.0, 52.0, 2.0), Sensor(28.0, sigma=0.05, detection=0.95), rng).xy)
        assert calls[0] <= names(answer).count("search quads") <= calls[1]
        assert answer.verdict != "no_match"


def test_there_are_no_more_candidates_than_submaps_in_which_anything_was_found() -> None:
    found = recognizer(count=72).locate(here(sigma=0.1, detection=0.9), limit=72)
    assert found.verdict == "matched"
    assert 4 < len(found.candidates) == found.stages[2].counts["candidates"] < 72
    assert len({candidate.key for candidate in found.candidates}) == len(found.candidates)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [20, 72])
def test_for_a_place_that_is_not_there_every_level_is_tried_once_and_none_without_bounds(seed: int, count: int) -> None:
    config = Config(survey=200, exhaustive_submaps=16, candidates=10)
    found = recognizer(config, count).locate(nowhere(seed))
    assert found.verdict == "no_match"
    assert names(found) == ["describe", *QUADS, *QUADS, *POLYGONS, *EXHAUSTIVE]
    total = Counter[str]()
    for stage in found.stages:
        for what, number in stage.counts.items():
            total[f"{stage.name}: {what}"] += number
    # Two searches, each for as many hits as are enough and those of the last few quads.
    assert total["search quads: hits"] <= 2 * 1.5 * (config.quad_hits + 4 * count)
    assert total["verify quads: candidates"] <= 5 + 10
    assert total["verify polygons: candidates"] <= 10
    assert total["survey: places"] <= config.survey
    assert total["exhaustive: peaks"] <= 8 * total["survey: places"]
    assert total["verify exhaustive: candidates"] <= 16


@pytest.mark.parametrize("seed", range(3))
def test_a_large_collection_is_searched_once_more_with_looser_lengths(seed: int) -> None:
    large = recognizer(Config(survey=1), 72)
    found = large.locate(nowhere(seed))
    assert names(found) == ["describe", *QUADS, *QUADS, *POLYGONS, *QUADS]
    assert (found.verdict, found.search.skipped) == ("no_match", ("exhaustive",))
    assert names(large.locate(nowhere(seed), effort="fast")) == ["describe", *QUADS, *QUADS]


def test_looser_lengths_find_a_place_that_is_seen_badly(monkeypatch: pytest.MonkeyPatch) -> None:
    def search_only(query: Query, index: CollectionIndex, search: QuadConsensus, choice: QuadChoice) -> list[Proposal]:
        looser = search._wanted.tolerance == pytest.approx(LENGTHS.looser * CONFIG.sigma)
        return propose_by_quads(query, index, search, choice) if looser else []

    monkeypatch.setattr("urquhart.propose.levels.propose_by_quads", search_only)
    monkeypatch.setattr("urquhart.propose.levels.propose_by_polygons", lambda *_: [])
    found = recognizer(Config(survey=1), 72).locate(here(sigma=0.3, detection=0.85))
    assert (found.verdict, found.candidates[0].level) == ("matched", "quads")


def test_where_every_submap_can_be_tried_quads_are_not_measured_loosely() -> None:
    found = recognizer(count=20).locate(nowhere(0))
    assert names(found) == ["describe", *QUADS, *POLYGONS, *EXHAUSTIVE]
    assert [stage.counts for stage in found.stages if stage.name == "survey"] == [{"places": 20}]


@pytest.mark.parametrize("level", ["polygons", "exhaustive"])
def test_a_level_answers_where_those_before_it_have_nothing_to_say(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def search_only(_query: object, _index: object, search: QuadConsensus, *_: object) -> list[object]:
        search.advance()
        return []

    def nothing(*_: object) -> list[object]:
        return []

    monkeypatch.setattr("urquhart.propose.levels.propose_by_quads", search_only)
    if level == "exhaustive":
        monkeypatch.setattr("urquhart.propose.levels.propose_by_polygons", nothing)
    for count in (20, 36):
        found = recognizer(count=count).locate(here(sigma=0.1, detection=0.9))
        assert found.verdict == "matched"
        assert found.candidates[0].level == level
        best = found.candidates[0]
        true = SE2(60.0 + 36.0 * (best.key % 6), 60.0 + 36.0 * (best.key // 6), 0.4 * best.key)
        assert (true @ best.transform).distance(SE2(150.0, 150.0, 1.0))[0] < 0.5


@pytest.mark.parametrize("count", [20, 72])
@pytest.mark.parametrize("seed", range(5))
def test_a_fast_search_ends_with_quads_and_says_what_it_promises(seed: int, count: int) -> None:
    found = recognizer(count=count).locate(nowhere(seed), effort="fast")
    assert names(found) == ["describe", *QUADS, *QUADS]
    assert found.verdict == "no_match"
    assert found.search == SearchEnd("effort")


def test_a_fast_search_promises_nothing_about_few_trees() -> None:
    rng = np.random.default_rng(9)
    trees = observe(paper_forest(rng, 200.0), SE2(100.0, 100.0, 1.0), Sensor(55.0), rng).xy
    fewest = FAST_PROMISE.landmarks
    assert len(trees) > fewest
    found = [recognizer().locate(trees[:count], effort="fast") for count in (fewest - 1, fewest)]
    assert [one.verdict for one in found] == ["no_match", "no_match"]
    assert [one.search for one in found] == [SearchEnd("effort"), SearchEnd("evidence_bound", (), FAST_PROMISE)]


def test_a_fast_search_finds_what_a_full_one_finds_by_quads() -> None:
    for seed in range(10):
        seen = here(seed, sigma=0.3, detection=0.8)
        fast, full = (recognizer(count=72).locate(seen, effort=effort) for effort in get_args(Effort))
        assert fast.verdict == full.verdict == "matched"
        assert fast.candidates[0].key == full.candidates[0].key


def test_the_least_confidence_of_a_query_is_its_gate() -> None:
    seen = observe(FOREST, SE2(150.0, 150.0, 1.0), Sensor(14.0, sigma=0.1), np.random.default_rng(0)).xy
    unsure = recognizer().locate(seen)
    assert unsure.reason == "below_gate"
    confidence = unsure.candidates[0].confidence
    assert 0.55 < confidence < 0.999
    assert recognizer().locate(seen, min_confidence=confidence - 0.01).verdict == "matched"
    assert recognizer().locate(seen, min_confidence=(1.0 + confidence) / 2.0).verdict != "matched"
    for wrong in (0.5, 1.0, 0.0, float("nan")):
        with pytest.raises(ValueError, match=r"above 0\.5 and below 1"):
            recognizer().locate(seen, min_confidence=wrong)


def test_each_keyword_of_a_search_is_an_option() -> None:
    assert SearchOptions.__annotations__.keys() == {field.name for field in fields(Options)}


@pytest.mark.parametrize("effort", ["fast", "full"])
def test_a_single_submap_is_tried_at_once(effort: Effort) -> None:
    found = recognizer(count=36).locate(here(sigma=0.1), only=[14], effort=effort)
    assert names(found) == ["describe", *EXHAUSTIVE]
    assert [candidate.key for candidate in found.candidates] == [14]


def test_only_what_is_asked_for_is_looked_at() -> None:
    everything = recognizer(count=72)
    seen = here(sigma=0.1, detection=0.9)
    right = [c.key for c in everything.locate(seen, limit=72).candidates if c.refused is None]
    assert len(right) > 3
    wrong = sorted({*range(72)} - {*right})
    for key in right:
        found = everything.locate(seen, only=[key, *wrong[:10], 99], limit=72)
        assert found.verdict == "matched"
        assert found.candidates[0].key == key
        assert {c.key for c in found.candidates} <= {key, *wrong[:10]}
        assert {f.key for f in found.findings} <= {key, *wrong[:10]}
    best = right[0]
    found = everything.locate(seen, exclude=[best, 99], limit=72)
    assert found.candidates[0].key == right[1]
    assert best not in {f.key for f in found.findings}
    both = everything.locate(seen, only=right, exclude=right[:2], limit=72)
    assert {c.key for c in both.candidates} == {*right[2:]}
    assert len(everything) == 72


@pytest.mark.parametrize(
    ("only", "exclude"), [([], []), ([99], []), ([3], [3]), (None, range(36)), (range(9), range(9))]
)
def test_where_nothing_is_left_to_look_at_that_is_the_reason(
    only: list[int] | range | None, exclude: list[int] | range
) -> None:
    found = recognizer().locate(here(), only=only, exclude=exclude)
    assert (found.verdict, found.reason) == ("no_match", "all_filtered_out")
    assert names(found) == ["describe"]


@pytest.mark.parametrize("only", [[14, 15], range(36)])
def test_the_paper_looks_at_nothing_else_either(only: list[int] | range) -> None:
    found = recognizer().locate(here(), only=only, exclude=[15], method="paper", limit=72)
    assert names(found) == ["describe", "search polygons", "match and verify", "find rivals"]
    assert found.verdict == "matched"
    assert {c.key for c in found.candidates} <= {*only} - {15}


class Countdown(Budget):
    """A budget that is spent when it has been asked so many times: a deadline at a chosen point of the work."""

    def __init__(self, asks: int, steps: float = 20_000.0) -> None:
        super().__init__(steps=steps)
        self.asks, self.asked = asks, 0

    def is_spent(self) -> bool:
        self.asked += 1
        return super().is_spent() or self.asked > self.asks


def told(found: Recognition) -> tuple[object, ...]:
    return (*outline(found), found.rivals, found.findings, found.search)


def searches() -> list[tuple[Recognizer, np.ndarray[tuple[int, ...], np.dtype[np.float64]], Method]]:
    """Searches that end at different levels, in natural forests and in rows, and the paper's."""
    rng = np.random.default_rng(5)
    trees = plantation(80.0, 80.0, rng, jitter=0.1)
    rows = Recognizer(CONFIG)
    rows.add(
        (key, describe(observe(trees, SE2(x, 40.0, 0.2), Sensor(18.0, sigma=0.03), rng).xy, CONFIG))
        for key, x in enumerate([25.0, 35.0, 45.0, 55.0])
    )
    seen = here(sigma=0.1, detection=0.9)
    return [
        (recognizer(), seen, "robust"),
        (recognizer(), nowhere(3), "robust"),
        (recognizer(count=20), nowhere(1), "robust"),
        (rows, observe(trees, SE2(41.0, 39.0, 1.0), Sensor(18.0, sigma=0.05), rng).xy, "robust"),
        (recognizer(), seen, "paper"),
    ]


@pytest.mark.parametrize("which", range(5))
def test_a_budget_that_is_not_reached_changes_nothing(which: int) -> None:
    """However small the portions that the work is done in."""
    asked, seen, method = searches()[which]
    whole = told(asked.locate(seen, method=method))
    for steps in (1.0, 3_000.0, 1e5):
        budget = Countdown(10**9, steps)
        assert told(asked.locate(seen, method=method, budget=budget)) == whole
        assert budget.asked > 10


@pytest.mark.parametrize("which", range(5))
def test_wherever_the_deadline_falls_it_answers_what_it_has_and_never_an_unsure_match(which: int) -> None:
    asked, seen, method = searches()[which]
    counter = Countdown(10**9)
    whole = asked.locate(seen, method=method, budget=counter)
    for asks in sorted({*range(30), *np.linspace(30, counter.asked, 40).astype(int).tolist()}):
        budget = Countdown(asks)
        found = asked.locate(seen, method=method, budget=budget)
        if found.reason != "deadline":
            assert (found.verdict, found.reason) == (whole.verdict, whole.reason)
            continue
        assert (found.verdict, found.search.stopped_by) == ("no_match", "deadline")
        assert all(candidate.refused is not None for candidate in found.candidates)
        # Whoever is told that the time is over ends soon, and nobody begins anything new.
        assert budget.asked - asks < 30
    assert asked.locate(seen, method=method, budget=Countdown(0)).reason == "deadline"


def test_what_was_found_by_the_deadline_is_told() -> None:
    asked, seen, _ = searches()[1]
    counter = Countdown(10**9)
    asked.locate(seen, budget=counter)
    late = asked.locate(seen, budget=Countdown(counter.asked - 5))
    assert late.reason == "deadline"
    assert late.candidates
    assert late.findings


@pytest.mark.parametrize("asks", [0, 5, 40])
def test_wherever_it_is_abandoned_it_ends(asks: int) -> None:
    class Leaving(Countdown):
        def is_spent(self) -> bool:
            if self.asked == self.asks:
                self.abandon()
            return super().is_spent()

    for asked, seen, method in searches():
        with pytest.raises(Abandoned):
            asked.locate(seen, method=method, budget=Leaving(asks, 1_000.0))


def test_a_search_that_nobody_waits_for_ends() -> None:
    budget = Budget()
    budget.abandon()
    with pytest.raises(Abandoned):
        recognizer().locate(nowhere(3), budget=budget)


def test_how_a_search_ended_is_told() -> None:
    seen = here(sigma=0.1, detection=0.9)
    assert recognizer().locate(seen).search == SearchEnd("decided")
    assert recognizer().locate(nowhere(0)).search.stopped_by == "exhausted"
    assert recognizer().locate(nowhere(3), budget=Budget(0.0)).search == SearchEnd("deadline")
    assert recognizer().locate(seen, only=[]).search == SearchEnd("not_started")
    assert Recognizer(CONFIG).locate(seen).search == SearchEnd("not_started")
    assert recognizer().locate(seen[:2]).search == SearchEnd("not_started")
    assert recognizer().locate(seen, method="paper").search == SearchEnd("decided")
    assert recognizer().locate(nowhere(0), method="paper").search == SearchEnd("exhausted")
    found = recognizer(Config(gate=60.0)).locate(seen)
    assert found.verdict != "matched"
    assert found.search == SearchEnd("beats_chance")


def test_limits_that_left_something_out_are_told() -> None:
    config, rng = Config(quad_hits=1_000), np.random.default_rng(0)
    thickets = [rng.uniform(-40.0, 40.0, (700, 2)) for _ in range(3)]
    crowd = Recognizer(config)
    crowd.add((key, describe(xy, config)) for key, xy in enumerate(thickets[:2]))
    assert crowd.locate(thickets[2]).search.skipped == ("quad_hits", "common_quads")
    assert recognizer().locate(nowhere(0)).search.skipped == ("exhaustive_rest",)
    assert recognizer(Config(survey=1), 72).locate(nowhere(0)).search.skipped == ("exhaustive",)
    assert recognizer(count=20).locate(nowhere(0)).search.skipped == ()


def test_every_end_and_every_limit_has_a_sentence() -> None:
    assert {*STOPS} == {*get_args(StoppedBy)}
    assert {*SKIPS} == {*get_args(Skipped)}
    told = search_sentence(SearchEnd("exhausted", ("quad_hits", "exhaustive")))
    assert told == "; ".join([STOPS["exhausted"], SKIPS["quad_hits"], SKIPS["exhaustive"]])
