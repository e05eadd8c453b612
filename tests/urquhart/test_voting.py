import numpy as np
import pytest

from tests.urquhart import forests
from urquhart import SE2, Config, describe
from urquhart.index.collection_index import CollectionIndex
from urquhart.propose.polygon_votes import Votes, align_outlines, vote_polygons


@pytest.mark.parametrize("count", range(3, 12))
def test_an_outline_is_laid_onto_its_moved_copy_wherever_that_starts(count: int) -> None:
    rng = np.random.default_rng(count)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    shape = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(3.0, 9.0, (count, 1))
    motion = SE2(12.0, -5.0, 2.2)
    targets = np.stack([np.roll(motion.apply(shape), k, axis=0) for k in range(count)])
    noisy = targets + rng.normal(0.0, 0.1, targets.shape)
    transforms, misfit = align_outlines(shape[None], np.zeros(count, np.int64), targets.astype(np.float32))
    np.testing.assert_allclose(transforms, np.tile([12.0, -5.0, 2.2], (count, 1)), atol=1e-3)
    assert misfit.max() < 1e-2
    _, worse = align_outlines(shape[None], np.zeros(count, np.int64), noisy.astype(np.float32))
    assert ((worse > 0.01) & (worse < 0.35)).all()


def collection(seeds: range) -> CollectionIndex:
    return CollectionIndex(Config()).with_changes(
        (seed, describe(forests.uniform(np.random.default_rng(seed)), Config())) for seed in seeds
    )


def votes_in(index: CollectionIndex, xy: forests.Points) -> Votes:
    query = describe(xy, Config())
    found = index.search_polygons(query.tessellation.vertex_counts(), query.descriptors, neighbours=48)
    return vote_polygons(query, found, 0.5)


def test_the_submap_seen_again_gets_the_most_votes_and_the_right_transform() -> None:
    index = collection(range(30))
    for seed in (0, 11, 29):
        rng = np.random.default_rng(seed)
        xy = forests.uniform(rng)
        pose = SE2(40.0, -10.0, 1.0)
        votes = votes_in(index, pose.inverse().apply(xy + rng.normal(0.0, 0.05, xy.shape)))
        assert votes.keys[0] == seed
        assert (np.diff(votes.weights) <= 0.0).all()
        assert len(set(votes.keys.tolist())) == len(votes.keys)
        assert votes.counts.sum() == len(votes.transforms) == votes.offsets[-1]
        yaw = np.median(votes.hypotheses(0)[:, 2])
        assert yaw == pytest.approx(1.0, abs=0.05)


def test_submaps_that_are_not_looked_at_get_no_votes() -> None:
    index, xy = collection(range(10)), forests.uniform(np.random.default_rng(4))
    assert 4 in votes_in(index, xy).keys
    for narrow in (index.narrowed(None, [4, 5]), index.narrowed([1, 2, 3], []), index.with_changes(removed=[4, 5])):
        assert not {4, 5} & set(votes_in(narrow, xy).keys.tolist())


def test_votes_of_segments_add_up_as_those_of_one() -> None:
    parts = [collection(range(0, 9)), collection(range(9, 11)), collection(range(11, 30))]
    whole = collection(range(30))
    several = CollectionIndex(Config(), tuple(part for index in parts for part in index.live_segments))
    for seed in (2, 10, 20):
        xy = forests.uniform(np.random.default_rng(seed))
        one, other = (votes_in(index, xy) for index in (whole, several))
        np.testing.assert_array_equal(one.keys, other.keys)
        np.testing.assert_array_equal(one.counts, other.counts)
        np.testing.assert_allclose(one.weights, other.weights, rtol=1e-6)


def test_no_hits_no_votes() -> None:
    for index, xy in (
        (collection(range(1)), forests.uniform(np.random.default_rng(50)) * 40.0),
        (collection(range(0)), forests.uniform(np.random.default_rng(50))),
    ):
        votes = votes_in(index, xy)
        assert len(votes.keys) == 0
        assert votes.offsets.tolist() == [0]
