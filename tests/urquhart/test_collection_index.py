"""An index through its changes: it holds what a dictionary would, and the ones before it stay what they were."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.urquhart.contents import CONFIG, answers, conclusions, contents, observations, of_segments, over, place
from urquhart import Config, Features, describe
from urquhart.index.collection_index import CollectionIndex, LiveSegment
from urquhart.index.segment import Segment

PLACES = {key: place(key) for key in range(36)}
SEEN = observations(6)


def fresh(features: dict[int, Features]) -> CollectionIndex:
    return CollectionIndex(CONFIG).with_changes(features.items())


def stored(path: Path, *keys: int) -> Segment:
    Segment.build(((key, PLACES[key]) for key in keys), CONFIG).write(path)
    return Segment.open(path)


def holds(index: CollectionIndex, features: dict[int, Features]) -> None:
    """That is all there is, wherever it lies."""
    assert contents(index) == contents(fresh(features))
    assert len(index) == len(features) == len(list(index))
    assert [key for key in range(-2, 45) if key in index] == sorted(features)


@pytest.mark.parametrize("seed", range(4))
def test_it_holds_what_a_dictionary_would_and_what_was_before_stays(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    model: dict[int, Features] = {}
    index = CollectionIndex(CONFIG)
    if seed % 2:
        # Some lie in files already.
        index = of_segments([stored(tmp_path / "a", *range(0, 12)), stored(tmp_path / "b", *range(20, 25))])
        model = {key: PLACES[key] for key in (*range(0, 12), *range(20, 25))}
    history = [(index, dict(model))]
    for step in range(30):
        added = {int(key): place(int(key), step) for key in rng.integers(0, 36, rng.integers(0, 4))}
        removed = rng.integers(-2, 40, rng.integers(0, 4)).tolist()
        index = index.with_changes(added.items(), removed)
        model = {key: features for key, features in model.items() if key not in removed} | added
        history.append((index, dict(model)))
    for then, known in history[::5]:
        holds(then, known)
    holds(index, model)
    for then, known in (history[10], history[-1]):
        assert conclusions(over(then, known), SEEN) == conclusions(over(fresh(known), known), SEEN)


def test_changing_an_index_leaves_it_alone() -> None:
    index = fresh({key: PLACES[key] for key in range(10)})
    before = answers(over(index, PLACES), SEEN)
    index.with_changes(((key, place(key, 9)) for key in range(5, 15)), range(5))
    index.narrowed([1, 2], [2])
    holds(index, {key: PLACES[key] for key in range(10)})
    assert answers(over(index, PLACES), SEEN) == before


def test_a_submap_that_is_both_removed_and_added_is_there() -> None:
    index = fresh({1: PLACES[1], 2: PLACES[2]}).with_changes([(1, PLACES[30]), (3, PLACES[3])], [1, 3])
    holds(index, {1: PLACES[30], 2: PLACES[2], 3: PLACES[3]})


def test_of_one_key_given_twice_the_last_counts() -> None:
    holds(CollectionIndex(CONFIG).with_changes([(1, PLACES[1]), (1, PLACES[2])]), {1: PLACES[2]})


def test_small_segments_are_merged_and_empty_ones_dropped() -> None:
    index = CollectionIndex(CONFIG)
    for key in range(36):
        index = index.with_changes([(key, PLACES[key])])
        sizes = [part.living for part in index.live_segments]
        assert sum(sizes) == key + 1
        assert all(large >= 4 * small for large, small in pairwise(sizes))
    holds(index, PLACES)
    for key in range(36):
        index = index.with_changes(removed=[key])
        assert all(part.living for part in index.live_segments)
        assert key not in index
    assert index.live_segments == ()


def test_what_is_dead_goes_with_a_merge() -> None:
    index = fresh({key: PLACES[key] for key in range(8)}).with_changes(removed=range(6))
    assert [len(part.segment) for part in index.live_segments] == [8]
    index = index.with_changes([(20, PLACES[20])])
    assert [len(part.segment) for part in index.live_segments] == [3]
    holds(index, {6: PLACES[6], 7: PLACES[7], 20: PLACES[20]})


def test_what_lies_in_files_is_left_there(tmp_path: Path) -> None:
    """However small or dead: whoever wrote them merges them."""
    files = [stored(tmp_path / "a", *range(0, 6)), stored(tmp_path / "b", 10), stored(tmp_path / "c", 11)]
    index = of_segments(files).with_changes(removed=[10])
    for key in range(20, 36):
        index = index.with_changes([(key, PLACES[key])])
        index = index.with_changes([(3, place(3, key))])
        assert [part.segment for part in index.live_segments[:3]] == files
        assert all(part.segment.file is None for part in index.live_segments[3:])
    assert [part.living for part in index.live_segments[:3]] == [5, 0, 1]
    assert len(index.live_segments) <= 6
    known = {key: PLACES[key] for key in (*range(0, 6), 11, *range(20, 36))} | {3: place(3, 35)}
    holds(index, known)
    assert conclusions(over(index, known), SEEN) == conclusions(over(fresh(known), known), SEEN)
    for part in files:
        assert part.file is not None
        part.file.check()


def test_features_of_another_configuration_change_nothing() -> None:
    index = fresh({1: PLACES[1]})
    other = describe(PLACES[2].landmarks, Config(samples=32))
    with pytest.raises(ValueError, match="submap 2 were made with another configuration"):
        index.with_changes([(3, PLACES[3]), (2, other)], [1])
    holds(index, {1: PLACES[1]})


@pytest.mark.parametrize(
    ("only", "excluded"),
    [(None, [3, 99]), ([1, 2, 8, 30, 77], []), (range(20), range(10, 40)), ([], []), ([5], [5]), (None, range(36))],
)
def test_narrowed_it_is_as_if_it_held_nothing_else(
    tmp_path: Path, only: list[int] | range | None, excluded: list[int] | range
) -> None:
    index = of_segments([stored(tmp_path / "a", *range(0, 12)), stored(tmp_path / "b", 12, 13)])
    index = index.with_changes(((key, PLACES[key]) for key in range(14, 36)), [7])
    wanted = ({*PLACES} if only is None else {*PLACES} & {*only}) - {7, *excluded}
    known = {key: PLACES[key] for key in wanted}
    narrow = index.narrowed(only, excluded)
    holds(narrow, known)
    assert conclusions(over(narrow, known), SEEN) == conclusions(over(fresh(known), known), SEEN)
    holds(index, {key: PLACES[key] for key in PLACES if key != 7})


def test_with_nothing_to_narrow_it_is_the_same_index() -> None:
    index = fresh({1: PLACES[1]})
    assert index.narrowed(None, ()) is index


def test_slots_of_all_lots_are_keys_again(tmp_path: Path) -> None:
    files = [stored(tmp_path / "a", 5, 1), stored(tmp_path / "b", 10), stored(tmp_path / "c", 12, 30, 11)]
    index = of_segments(files).with_changes([(20, PLACES[20])], [10, 30])
    # The second has nothing that lives, and is not searched.
    assert [shard.alive.tolist() for shard in index.quad_shards()] == [[1, 1], [1, 1, 0], [1]]
    assert index.keys_of(np.arange(6)) == [1, 5, 11, 12, 30, 20]
    assert index.keys_of(np.array([5, 0, 0, 3])) == [20, 1, 1, 12]
    assert index.keys_of(np.empty(0, np.int64)) == []
    assert all(type(key) is int for key in index.keys_of(np.arange(2)))


def test_a_part_knows_what_lives_of_it() -> None:
    whole = LiveSegment.of(Segment.build(((key, PLACES[key]) for key in (2, 4, 6)), CONFIG))
    assert (whole.living, whole.alive.tolist()) == (3, [1, 1, 1])
    less = whole.without(np.array([4, 5]))
    assert (less.living, less.alive.tolist()) == (2, [1, 0, 1])
    assert less.without(np.array([4, 99])) is less
    assert less.only(np.array([4, 6, 7])).alive.tolist() == [0, 0, 1]
    assert less.only(np.empty(0, np.int64)).living == 0
    assert whole.alive.tolist() == [1, 1, 1]


def test_an_empty_index_has_nothing() -> None:
    index = CollectionIndex(CONFIG)
    assert (len(index), list(index), 0 in index, index.quad_shards(), index.live_segments) == (0, [], False, [], ())
    assert index.with_changes(removed=[1, 2]).live_segments == ()
    assert list(index.search_polygons(np.array([5], np.int32), np.zeros((1, 11), np.float32), 3)) == []
