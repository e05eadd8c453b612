import numpy as np
import pytest

from tests.urquhart import forests
from urquhart import SE2, Config, describe
from urquhart.collection_index import CollectionIndex
from urquhart.quads import measure
from urquhart.voting import TURN, Votes, align_outlines, rank_turns, vote_polygons, vote_quads


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
    index = CollectionIndex(Config())
    index.add((seed, describe(forests.uniform(np.random.default_rng(seed)), Config())) for seed in seeds)
    return index


def by_polygons(index: CollectionIndex, xy: forests.Points, exclude: frozenset[int] = frozenset()) -> Votes:
    query = describe(xy, Config())
    found = index.polygons.search(query.tessellation.vertex_counts(), query.descriptors, neighbours=48)
    return vote_polygons(query, found, 0.5, exclude)


def by_quads(index: CollectionIndex, xy: forests.Points, exclude: frozenset[int] = frozenset()) -> Votes:
    query = describe(xy, Config())
    hits = index.quads.search(*measure(query.landmarks, query.tessellation.quads), 0.5, 10**6)
    return vote_quads(query, hits, index.features, 0.5, 10, exclude)


@pytest.mark.parametrize("vote", [by_polygons, by_quads])
def test_the_submap_seen_again_gets_the_most_votes_and_the_right_transform(vote) -> None:  # type: ignore[no-untyped-def]
    index = collection(range(30))
    for seed in (0, 11, 29):
        rng = np.random.default_rng(seed)
        xy = forests.uniform(rng)
        pose = SE2(40.0, -10.0, 1.0)
        votes = vote(index, pose.inverse().apply(xy + rng.normal(0.0, 0.05, xy.shape)))
        assert votes.keys[0] == seed
        assert (np.diff(votes.weights) <= 0.0).all()
        assert votes.counts.sum() == len(votes.transforms) == votes.offsets[-1]
        yaw = np.median(votes.hypotheses(0)[:, 2])
        assert yaw == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("vote", [by_polygons, by_quads])
def test_excluded_submaps_get_no_votes(vote) -> None:  # type: ignore[no-untyped-def]
    index = collection(range(10))
    votes = vote(index, forests.uniform(np.random.default_rng(4)), frozenset({4, 5}))
    assert not {4, 5} & set(votes.keys.tolist())


@pytest.mark.parametrize("vote", [by_polygons, by_quads])
def test_no_hits_no_votes(vote) -> None:  # type: ignore[no-untyped-def]
    votes = vote(collection(range(1)), forests.uniform(np.random.default_rng(50)) * 40.0)
    assert len(votes.keys) == 0
    assert votes.offsets.tolist() == [0]


def test_turns_rank_the_submap_seen_again_and_its_rotation_first() -> None:
    """Measured so loosely that no hit proves anything, quads still agree on submap and rotation."""
    index = collection(range(30))
    for seed in (0, 11, 29):
        for turn in (-3.1, -0.4, 1.0, 3.0):
            rng = np.random.default_rng(seed)
            xy = forests.uniform(rng)
            seen = SE2(40.0, -10.0, turn).inverse().apply(xy + rng.normal(0.0, 0.2, xy.shape))
            query = describe(seen[rng.random(len(seen)) < 0.9], Config())
            hits = index.quads.search(*measure(query.landmarks, query.tessellation.quads), 0.75, 10**6)
            keys, rotations = rank_turns(hits, 0.75, 60, frozenset())
            assert 5 < len(keys) == len(rotations) <= 60
            assert keys[0] == seed
            assert abs((rotations[0] - turn + np.pi) % (2.0 * np.pi) - np.pi) <= TURN
            # A submap comes once for each of its peaks, and never twice for one.
            assert len(set(zip(keys.tolist(), rotations.tolist(), strict=True))) == len(keys)
            for key in set(keys.tolist()):
                own = np.sort(rotations[keys == key])
                assert (np.diff(np.append(own, own[0] + 2.0 * np.pi)) > 0.9 * TURN).all()

            fewer = rank_turns(hits, 0.75, 5, frozenset())
            np.testing.assert_array_equal(fewer[0], keys[:5])
            np.testing.assert_array_equal(fewer[1], rotations[:5])
            others, _ = rank_turns(hits, 0.75, 60, frozenset({seed}))
            assert seed not in others


def test_without_hits_or_with_none_asked_for_there_are_no_turns() -> None:
    index = collection(range(3))
    query = describe(forests.uniform(np.random.default_rng(1)), Config())
    lengths, directions = measure(query.landmarks, query.tessellation.quads)
    hits = index.quads.search(lengths, directions, 0.5, 10**6)
    assert [len(found) for found in rank_turns(hits, 0.5, 0, frozenset())] == [0, 0]
    assert [len(found) for found in rank_turns(hits, 0.5, 9, frozenset({0, 1, 2}))] == [0, 0]
    none = index.quads.search(lengths * 100.0, directions, 0.01, 10**6)
    assert [len(found) for found in rank_turns(none, 0.5, 9, frozenset())] == [0, 0]
