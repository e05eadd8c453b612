"""Plantations: trees in rows look alike everywhere, and a pose that is one row off explains nearly as much."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart import forests
from urquhart import SE2, Budget, Config, Recognition, Recognizer, describe
from urquhart.evaluation.simulation import Sensor, observe, plantation

SIDE = 90.0
CENTRES = [SE2(x, y, 0.4 * k) for k, (x, y) in enumerate((x, y) for x in range(20, 90, 12) for y in range(20, 90, 12))]


def stored(trees: NDArray[np.float64], poses: Sequence[SE2], radius: float, rng: np.random.Generator) -> Recognizer:
    recognizer = Recognizer(Config())
    recognizer.add(
        (key, describe(observe(trees, pose, Sensor(radius, sigma=0.03, detection=0.98), rng).xy, Config()))
        for key, pose in enumerate(poses)
    )
    return recognizer


def is_right(found: Recognition, poses: Sequence[SE2], truth: SE2) -> bool:
    best = found.candidates[0]
    shift, turn = (poses[best.key] @ best.transform).distance(truth)
    return shift < 1.0 and turn < 0.05


@pytest.mark.parametrize(("jitter", "least", "most"), [(0.0, 0, 1), (0.15, 6, 8)])
def test_in_rows_what_is_matched_is_right(jitter: float, least: int, most: int) -> None:
    """Planted by machine, nothing tells one row from the next, and the answer says so."""
    rng = np.random.default_rng(5)
    trees = plantation(SIDE, SIDE, rng, jitter=jitter, survival=0.97)
    recognizer = stored(trees, CENTRES, 20.0, rng)
    right = 0
    for _ in range(8):
        pose = forests.pose(rng, 20.0, 70.0)
        found = recognizer.locate(observe(trees, pose, Sensor(20.0, sigma=0.05, detection=0.95), rng).xy)
        if found.verdict == "matched":
            assert is_right(found, CENTRES, pose)
            assert found.rivals == ()
            right += 1
        else:
            assert found.reason in ("rival_too_close", "below_gate")
    assert least <= right <= most


def test_what_is_ambiguous_names_rivals_that_are_elsewhere() -> None:
    rng = np.random.default_rng(6)
    trees = plantation(SIDE, SIDE, rng, jitter=0.03, survival=0.97)
    recognizer, ambiguous = stored(trees, CENTRES, 20.0, rng), 0
    for _ in range(10):
        found = recognizer.locate(observe(trees, forests.pose(rng, 25.0, 65.0), Sensor(20.0, sigma=0.05), rng).xy)
        if found.verdict != "ambiguous":
            continue
        ambiguous += 1
        best, evidence = found.candidates[0], [rival.evidence for rival in found.rivals]
        assert evidence
        assert evidence == sorted(evidence, reverse=True)
        assert found.lead == pytest.approx(best.evidence - evidence[0])
        for rival in found.rivals:
            shift, turn = (CENTRES[rival.key] @ rival.transform).distance(CENTRES[best.key] @ best.transform)
            assert shift > 1.0 or turn > 0.05
    assert ambiguous >= 5


def test_a_rival_among_the_candidates_has_no_confidence_of_its_own() -> None:
    rng = np.random.default_rng(9)
    trees = plantation(SIDE, SIDE, rng, jitter=0.02, survival=0.98)
    recognizer, checked = stored(trees, CENTRES, 20.0, rng), 0
    for _ in range(6):
        found = recognizer.locate(observe(trees, forests.pose(rng, 25.0, 65.0), Sensor(20.0, sigma=0.05), rng).xy)
        if found.verdict == "ambiguous":
            checked += 1
            # They cannot all be right: what is said of each adds up to hardly more than one.
            places = [CENTRES[candidate.key] @ candidate.transform for candidate in found.candidates]
            apart = [place.distance(places[0])[0] > 1.0 for place in places]
            others = [c.confidence for c, is_apart in zip(found.candidates, apart, strict=True) if is_apart]
            assert all(confidence < 0.5 for confidence in others)
    assert checked >= 4


def test_a_lower_gate_reports_more_but_finds_the_same() -> None:
    """Rivals and further levels are looked for as with the default gate: the confidence does not depend on the gate."""
    rng, config = np.random.default_rng(5), Config()
    rows = plantation(90.0, 90.0, rng, spacing=(3.0, 3.0), jitter=0.15, survival=0.95)
    recognizer = Recognizer(config)
    places = [SE2(x, y, rng.uniform(-3.0, 3.0)) for x in (20.0, 45.0, 70.0) for y in (20.0, 45.0, 70.0)]
    sensor = Sensor(15.0, sigma=0.05, detection=0.95)
    recognizer.add((k, describe(observe(rows, place, sensor, rng).xy, config)) for k, place in enumerate(places))
    verdicts = set()
    for _ in range(12):
        xy = observe(rows, SE2(*rng.uniform((15.0, 15.0, -3.0), (75.0, 75.0, 3.0)).tolist()), sensor, rng).xy
        few = xy[np.argsort((xy**2).sum(axis=1))[: rng.integers(6, 10)]]
        usual = recognizer.locate(few)
        for least in (0.51, 0.75, 0.9):
            found = recognizer.locate(few, min_confidence=least)
            assert [(one.key, one.confidence, one.lead) for one in found.candidates] == [
                (one.key, one.confidence, one.lead) for one in usual.candidates
            ]
            matched = bool(found.candidates) and found.candidates[0].confidence >= least
            assert (found.verdict == "matched") == matched
            verdicts.add((least, found.verdict))
    assert {(0.51, "matched"), (0.9, "ambiguous")} <= verdicts


def test_other_candidates_are_compared_with_the_rivals_in_their_own_submaps() -> None:
    """Where the best candidate has no rival, others in rows of trees are at wrong places, and look certain."""
    rng = np.random.default_rng(7)
    trees = plantation(SIDE, SIDE, rng, jitter=0.3, survival=0.9)
    poses = CENTRES[::2]
    recognizer = stored(trees, poses, 20.0, rng)
    before, after, accepted = 0, 0, 0
    for key in range(0, len(poses), 3):
        features = recognizer.features(key)
        found = recognizer.recognize(features, exclude=[key], limit=8)
        compared = recognizer.compare_each(features, found)
        assert [one.key for one in compared.candidates] == [one.key for one in found.candidates]
        assert compared.candidates[:1] == found.candidates[:1]
        before += wrong_places(found, poses, poses[key])
        after += wrong_places(compared, poses, poses[key])
        accepted += sum(one.refused is None for one in compared.candidates[1:])
    assert before >= 10
    assert after == 0 < accepted


def test_what_does_not_match_is_not_compared() -> None:
    rng = np.random.default_rng(5)
    recognizer = stored(plantation(SIDE, SIDE, rng, jitter=0.0, survival=1.0), CENTRES[:4], 20.0, rng)
    found = recognizer.recognize(recognizer.features(0), exclude=[0])
    assert found.verdict != "matched"
    assert recognizer.compare_each(recognizer.features(0), found) is found


def test_after_the_deadline_candidates_are_compared_or_refused() -> None:
    rng = np.random.default_rng(7)
    recognizer = stored(plantation(SIDE, SIDE, rng), CENTRES, 20.0, rng)
    features = recognizer.features(0)
    found = recognizer.recognize(features, exclude=[0])
    assert found.verdict == "matched" and found.candidates[1].refused is None
    whole = recognizer.compare_each(features, found)
    late = recognizer.compare_each(features, found, budget=Budget(0.0))
    assert late.candidates[0].refused is None
    for one, timely in zip(late.candidates[1:], whole.candidates[1:], strict=True):
        assert one.refused in (timely.refused, "deadline")


def wrong_places(found: Recognition, poses: Sequence[SE2], truth: SE2) -> int:
    """How many of the accepted candidates are at wrong places, other than the first."""
    accepted = [one for one in found.candidates[1:] if one.refused is None]
    return sum((poses[one.key] @ one.transform).distance(truth)[0] > 1.0 for one in accepted)
