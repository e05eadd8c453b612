"""Features kept elsewhere are read when a look-up needs them: each once, many at a time."""

from collections.abc import Collection, Mapping

import numpy as np
import pytest

from tests.urquhart.contents import CONFIG, answers, contents, observations, over, place
from urquhart import Features, Recognizer
from urquhart.index.collection_index import CollectionIndex
from urquhart.index.submap_collection import FeatureMemory
from urquhart.propose.submap_cache import SubmapCache

PLACES = {key: place(key) for key in range(36)}
INDEX = CollectionIndex(CONFIG).with_changes(PLACES.items())
SEEN = observations(8)


class Counted:
    """A source that notes what is asked of it."""

    def __init__(self) -> None:
        self.asked: list[list[int]] = []

    def read(self, keys: Collection[int]) -> Mapping[int, Features]:
        self.asked.append(list(keys))
        return {key: PLACES[key] for key in keys}


def test_each_is_read_once_and_many_at_a_time() -> None:
    source = Counted()
    submaps = SubmapCache(source, 0.75)
    submaps.read([3, 1, 4])
    submaps.read(key for key in (1, 5, 9, 3))
    submaps.read([])
    submaps.read([5, 4])
    assert source.asked == [[3, 1, 4], [5, 9]]
    assert submaps.features(4) is PLACES[4]
    assert source.asked == [[3, 1, 4], [5, 9]]
    assert submaps.features(7) is PLACES[7]
    assert submaps.grid(7) is submaps.grid(7)
    np.testing.assert_array_equal(submaps.grid(8).landmarks, PLACES[8].landmarks)
    assert source.asked == [[3, 1, 4], [5, 9], [7], [8]]


def test_what_is_not_there_is_a_key_error_and_what_was_read_stays() -> None:
    submaps = SubmapCache(Counted(), 0.75)
    submaps.read([1])
    for ask in (submaps.features, submaps.grid):
        with pytest.raises(KeyError):
            ask(99)
    with pytest.raises(KeyError):
        submaps.read([1, 2, 99])
    assert submaps.features(1) is PLACES[1]


def test_memory_keeps_replaces_and_forgets_and_what_was_begun_with_stays() -> None:
    first = FeatureMemory({1: PLACES[1], 2: PLACES[2]})
    second = first.with_changes({2: PLACES[3]}, [])
    assert second.read([2, 1]) == {2: PLACES[3], 1: PLACES[1]}
    third = second.with_changes({}, [1, 77])
    with pytest.raises(KeyError):
        third.read([1])
    assert third.read([2]) == {2: PLACES[3]}
    assert first.read([2, 1]) == {2: PLACES[2], 1: PLACES[1]}


def test_a_look_up_reads_each_submap_once_and_in_few_batches() -> None:
    levels = set()
    for xy in SEEN:
        source = Counted()
        found = Recognizer(CONFIG, INDEX, source).locate(xy)
        keys = [key for batch in source.asked for key in batch]
        assert len(keys) == len(set(keys)) > 0
        verified = [stage for stage in found.stages if stage.name.startswith(("verify", "survey"))]
        assert len([batch for batch in source.asked if batch]) <= len(verified)
        assert {candidate.key for candidate in found.candidates} <= set(keys)
        levels.add(len(verified))
    assert len(levels) > 1


def test_where_features_are_kept_is_no_matter_to_the_answer() -> None:
    recognizer = Recognizer(CONFIG)
    recognizer.add(PLACES.items())
    assert answers(recognizer, SEEN) == answers(over(INDEX, PLACES), SEEN) == answers(
        Recognizer(CONFIG, INDEX, Counted()), SEEN
    )  # fmt: skip
    assert Recognizer(CONFIG, INDEX, Counted()).features(3) is PLACES[3]


def test_a_recognizer_whose_features_are_kept_elsewhere_refuses_to_change_them() -> None:
    recognizer = Recognizer(CONFIG, INDEX, Counted())
    before = answers(recognizer, SEEN[:2])
    with pytest.raises(TypeError, match="not kept in memory"):
        recognizer.remove([3])
    with pytest.raises(TypeError, match="not kept in memory"):
        recognizer.add([(99, PLACES[3])])
    assert recognizer.index is INDEX
    assert (len(recognizer), 3 in recognizer, 99 in recognizer) == (36, True, False)
    assert answers(recognizer, SEEN[:2]) == before
    assert contents(INDEX)[0] == list(range(36))
