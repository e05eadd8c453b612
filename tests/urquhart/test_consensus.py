"""The search through tables of quads: what it finds, what it passes over, and on which poses it agrees."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart import forests
from tests.urquhart.tables import decode, described, search, seen_again, shard_of, sparse, stand, truth
from urquhart import SE2, Config, Features, describe
from urquhart.index.quad_hits import HIT, SECTOR
from urquhart.index.quad_search import QuadShard
from urquhart.index.quad_table import LAST, STEPS, TURNS, build_table, measure_quads
from urquhart.propose.hit_buffer import BufferPool, HitBuffer
from urquhart.propose.quad_consensus import QuadConsensus, QuadLeaders
from urquhart.propose.quad_vote_kernels import AGREEMENT, agree, order_by_slots


def hits(found: QuadConsensus) -> NDArray[np.float64]:
    """Rows (H, 6), sorted: slot, query quad, turn, x, y, logarithm of the likelihood of the misfit."""
    kept = found._buffer.hits[: found._placed]
    return ordered([kept[name] for name in ("slot", "quad", "turn", "x", "y", "fit")])


def ordered(columns: list[NDArray[np.generic]]) -> NDArray[np.float64]:
    rows = np.column_stack(columns).astype(np.float64)
    return rows[np.lexsort(rows.T[::-1])]


def brute_force(shards: Sequence[QuadShard], query: Features, tolerance: float) -> NDArray[np.float64]:
    """The same by comparing every quad with every one of the tables, from either end."""
    lengths, directions, _ = measure_quads(query.landmarks, query.tessellation.quads)
    query_turns = np.round(directions * TURNS).astype(np.int64)
    found, first = [], 0
    for shard in shards:
        stored = decode(shard.table)
        scales = shard.scales.astype(np.float64)[stored.slots]
        for q in range(len(lengths)):
            # The first side of what is stored is no shorter than its third.
            for reading in (0, 1) if lengths[q, 0] - lengths[q, 2] <= 2.0 * tolerance else (0,):
                wanted = np.append(np.roll(lengths[q, :4], -2 * reading), lengths[q, 4])
                # Steps are whole: the tolerance ends at whole ones. In the last cell any length will do.
                low, high = np.ceil((wanted - tolerance) / STEPS), np.floor((wanted + tolerance) / STEPS)
                long = stored.cells == LAST
                agree = np.where(long, high >= 8 * np.array(LAST), (stored.steps >= low) & (stored.steps <= high))
                near = agree.all(axis=1) & (shard.alive[stored.slots] > 0)
                misfit = np.where(long, 0.0, (stored.steps * STEPS - wanted) ** 2)[near].sum(axis=1)
                turns = (stored.turns[near] - query_turns[q] + TURNS // 2 * reading) % TURNS
                centres = stored.centres[near] * scales[near, None]
                which = np.full(len(turns), q)
                fits = -misfit / (2.0 * (0.8 * tolerance) ** 2)
                found.append(
                    np.column_stack([stored.slots[near] + first, which, turns, centres.astype(np.float32), fits])
                )
        first += len(shard.alive)
    return ordered(list(np.concatenate(found).T))


def centred(pose: SE2, submap: Features, query: Features) -> SE2:
    """A pose between frames as posted as one between centred frames."""
    return SE2.shift(submap.origin).inverse() @ pose @ SE2.shift(query.origin)


@pytest.mark.parametrize("tolerance", [0.1, 0.33, 0.5, 0.75])
def test_finds_exactly_what_brute_force_finds(tolerance: float) -> None:
    shards = [
        shard_of([described(seed) for seed in range(12)], dead=[0, 5]),
        shard_of([]),
        shard_of([described(seed) for seed in range(20, 27)], dead=[6]),
        shard_of([described(30)], dead=[0]),
        shard_of([describe(forests.lattice(np.random.default_rng(2)), Config()), sparse(5), sparse(6)]),
    ]
    for query in (
        seen_again(np.random.default_rng(0), described(3), 2.0, 0.05, 0.1),
        # Equilateral planting: every quad is read from both ends.
        describe(forests.lattice(np.random.default_rng(3)), Config()),
        # Sides about as long as the longest that are told apart, and longer ones.
        seen_again(np.random.default_rng(1), sparse(6), -2.5, 0.05, 0.0),
    ):
        found = search(shards, query, tolerance)
        found.advance()
        got, expected = hits(found), brute_force(shards, query, tolerance)
        assert len(got) == len(expected) == found.hits > 0
        np.testing.assert_array_equal(got[:, :5], expected[:, :5])
        np.testing.assert_allclose(got[:, 5], expected[:, 5], rtol=1e-5, atol=1e-6)
        assert not {0, 5, 18, 19} & set(got[:, 0].tolist())


def test_hits_find_room_however_many_there_are() -> None:
    shards = [shard_of([stand(seed) for seed in range(30)]), shard_of([stand(seed) for seed in range(30, 40)])]
    query = stand(7)
    found = search(shards, query, 0.75)
    space = len(found._buffer.hits)
    found.advance()
    assert found.hits > 4 * space
    expected = brute_force(shards, query, 0.75)
    np.testing.assert_array_equal(hits(found)[:, :5], expected[:, :5])


def test_a_quad_that_is_everywhere_is_passed_over() -> None:
    """Of a place that is stored thirty times and one that is stored once, the second is looked for."""
    rng = np.random.default_rng(0)
    common, rare = forests.uniform(rng, 50, 50.0), forests.uniform(rng, 50, 50.0)
    shards = [shard_of([describe(common, Config())] * 30 + [describe(rare, Config())])]
    both = describe(np.concatenate([common, rare + 300.0]), Config())
    for query, most, slots in (
        (describe(common, Config()), 64 * 29, set()),
        (describe(common, Config()), 64 * 200, set(range(30))),
        (both, 64 * 29, {30}),
    ):
        found = search(shards, query, 0.1, most)
        found.advance()
        assert found.finished
        best = found.leaders(31, 1)
        assert set(best.slots[best.support > 8].tolist()) == slots


def test_a_search_ends_where_all_that_is_left_is_too_common(monkeypatch: pytest.MonkeyPatch) -> None:
    query, tried = stand(500), list[int]()
    found = search([shard_of([stand(seed) for seed in range(80)])], query, 2.0, 64)
    gathered = found._gather

    def count(shard: QuadShard, first: int, chunk: NDArray[np.int64]) -> None:
        tried.append(len(chunk))
        gathered(shard, first, chunk)

    monkeypatch.setattr(found, "_gather", count)
    found.advance()
    assert found.finished
    assert sum(tried) < len(query.tessellation.quads)
    assert found.passed_over > len(query.tessellation.quads) - 32


@pytest.mark.parametrize("seed", range(4))
def test_each_hit_counts_all_earlier_ones_of_its_submap_that_agree_with_it(seed: int) -> None:
    """Also those on the other side of a border between sectors of rotation."""
    submaps = [stand(key) for key in range(6)]
    query = seen_again(np.random.default_rng(seed), submaps[seed], 2.0 * np.pi * seed / 8.0, 0.1, 0.1)
    found = search([shard_of(submaps)], query, 0.5)
    found.advance()
    kept, totals = found._buffer.hits[: found._placed], found._buffer.totals[: found._placed]
    weights = np.maximum(found._weights[kept["quad"]] + kept["fit"], 0.0)
    for slot in range(6):
        mine = np.flatnonzero(kept["slot"] == slot)
        if slot == seed:
            # There are more than are compared with each other.
            continue
        assert np.bincount(kept["turn"][mine] // SECTOR).max() < AGREEMENT.walk
        for place, hit in enumerate(mine.tolist()):
            agreeing = [other for other in mine[:place].tolist() if agree(hit, other, kept, found._centres)]
            assert totals[hit] == pytest.approx(weights[hit] + weights[agreeing].sum(), rel=1e-5)


@pytest.mark.parametrize("most", [1_000, 3_000, 5_000])
@pytest.mark.parametrize("parts", [1, 4])
def test_so_many_hits_are_enough(most: int, parts: int) -> None:
    submaps = [stand(seed) for seed in range(80)]
    shards = [shard_of(submaps[part::parts]) for part in range(parts)]
    query = stand(500)
    unbounded = search(shards, query)
    unbounded.advance()
    bounded = search(shards, query, most=most)
    bounded.advance()
    assert bounded.finished
    # What has been begun is finished: 32 quads, each with a 64th of the hits in each shard at the most.
    assert 0 < bounded.hits <= (1.0 + 0.5 * parts) * most
    assert bounded.hits < unbounded.hits
    if most >= 3_000:
        assert bounded.hits >= most
    before = bounded.hits
    bounded.advance()
    assert bounded.hits == before


def test_the_rarer_half_has_far_fewer_hits_and_mostly_says_enough() -> None:
    submaps = [stand(seed) for seed in range(60)]
    shards = [shard_of(submaps)]
    first = 0
    for seed in range(0, 60, 6):
        query = seen_again(np.random.default_rng(seed), submaps[seed], 1.0, 0.2, 0.2)
        found = search(shards, query)
        found.advance(0.5)
        half = found.hits
        first += found.leaders(1, 1).slots[0] == seed
        found.advance(0.5)
        assert found.hits == half
        found.advance(1.0)
        assert 0 < half < 0.7 * (found.hits - half)
        assert found.leaders(1, 1).slots[0] == seed
    assert first >= 9


@pytest.mark.parametrize("seed", range(0, 30, 3))
def test_the_submap_seen_again_leads_with_the_right_pose(seed: int) -> None:
    submaps = [stand(key) for key in range(30)]
    shards = [shard_of(submaps[:20]), shard_of(submaps[20:])]
    for turn in (-3.1, -1.2, 0.0, 2.0):
        query = seen_again(np.random.default_rng(seed), submaps[seed], turn, 0.2, 0.1)
        found = search(shards, query)
        found.advance()
        best = found.leaders(5, 4)
        assert best.slots[0] == seed
        assert best.scores[0] > 1.5 * best.scores[1]
        assert (np.diff(best.scores) <= 0.0).all()
        assert best.support[0] > 3
        shift, off = SE2(*best.poses[0, 0].tolist()).distance(truth(turn, query))
        assert shift < 2.0
        assert off < 0.1


def test_hits_of_one_quad_do_not_vote_for_each_other() -> None:
    """However often a quad is found at one place, it has been seen once."""
    features = described(0)
    [quad] = features.tessellation.quads[:1]
    table = build_table([(features.landmarks, np.repeat(quad[None], 5, axis=0), 0.5)])
    shard = QuadShard(table, np.full(1, 0.5, np.float32), np.ones(1, np.uint8))
    found = QuadConsensus([shard], measure_quads(features.landmarks, quad[None]), 0.1, 10**9)
    found.advance()
    assert found.hits == 5
    best = found.leaders(1, 1)
    assert best.support.tolist() == [1]
    assert np.abs(best.poses[0, 0]).max() < 0.5


def test_a_place_that_is_in_a_submap_twice_has_both_poses() -> None:
    """Two blocks planted alike: hits of either agree among themselves, and both poses are told."""
    rng = np.random.default_rng(4)
    block = forests.uniform(rng, 50, 50.0)
    motions = [SE2(-60.0, 0.0, 0.3), SE2(55.0, 20.0, -2.0)]
    submap = describe(np.concatenate([motion.apply(block) for motion in motions]), Config())
    query = describe(block + rng.normal(0.0, 0.1, block.shape), Config())
    found = search([shard_of([described(0), submap])], query)
    found.advance()
    best = found.leaders(1, 6)
    assert best.slots.tolist() == [1]
    poses = [SE2(*row) for row in best.poses[0, :2].tolist()]
    for motion in motions:
        apart = [pose.distance(centred(motion, submap, query)) for pose in poses]
        assert min(apart)[0] < 2.0
        assert min(apart)[1] < 0.1


def test_poses_of_a_slot_are_distinct_and_what_is_missing_comes_last() -> None:
    found = search([shard_of([stand(key) for key in range(25)])], stand(3))
    found.advance()
    best = found.leaders(25, 8)
    assert best.poses.shape == (25, 8, 3)
    there = np.isfinite(best.poses[:, :, 0])
    for k in (1, 2):
        np.testing.assert_array_equal(np.isfinite(best.poses[:, :, k]), there)
    assert there[:, 0].all()
    assert (np.diff(there.astype(int), axis=1) <= 0).all()
    for poses in best.poses:
        rows = [SE2(*row) for row in poses[~np.isnan(poses[:, 0])].tolist()]
        for i, pose in enumerate(rows):
            for other in rows[:i]:
                shift, turn = pose.distance(other)
                assert shift > 0.05 or turn > 0.005
    few = found.leaders(4, 2)
    np.testing.assert_array_equal(few.slots, best.slots[:4])
    np.testing.assert_array_equal(few.scores, best.scores[:4])
    np.testing.assert_array_equal(few.poses, best.poses[:4, :2])


@pytest.mark.parametrize("least", [2, 3, 5])
def test_where_too_few_hits_agree_they_are_not_compared(least: int) -> None:
    submaps = [described(key) for key in range(120)]
    shards = [shard_of(submaps[:70]), shard_of([]), shard_of(submaps[70:], dead=[3])]
    for seed in (0, 30, 71, 73):
        query = seen_again(np.random.default_rng(seed), submaps[seed], 2.5, 0.3, 0.2)
        whole, part = (search(shards, query, 0.75) for _ in range(2))
        whole.advance()
        part.advance(1.0, least)
        assert part.hits == whole.hits
        assert part._placed < whole._placed == whole.hits
        every, enough = whole.leaders(200, 3), part.leaders(200, 3, least)
        assert (enough.support >= least).all()
        assert (seed == 73) == (seed not in enough.slots)
        # Wherever enough agree on the best pose, nothing of it is lost.
        expected = np.flatnonzero(every.support >= least)
        assert len(expected) < len(every.slots)
        places = [enough.slots.tolist().index(slot) for slot in every.slots[expected].tolist()]
        np.testing.assert_array_equal(enough.support[places], every.support[expected])
        np.testing.assert_array_equal(enough.scores[places], every.scores[expected])
        np.testing.assert_array_equal(enough.poses[places, 0], every.poses[expected, 0])


def test_a_search_begun_again_is_a_new_one() -> None:
    shards = [shard_of([stand(seed) for seed in range(20)])]
    first, fresh = search(shards, stand(3), 0.5), search(shards, stand(3), 0.75)
    first.advance(0.5)
    assert first.hits > 0
    again = first.begun_again(0.75)
    assert again.hits == again.passed_over == 0
    for found in (again, fresh):
        found.advance()
    np.testing.assert_array_equal(hits(again), hits(fresh))
    one, other = again.leaders(9, 3), fresh.leaders(9, 3)
    np.testing.assert_array_equal(one.slots, other.slots)
    np.testing.assert_array_equal(one.scores, other.scores)
    np.testing.assert_array_equal(one.poses, other.poses)
    np.testing.assert_array_equal(again.turns(30), fresh.turns(30))


def test_so_many_hits_in_one_sector_that_a_byte_cannot_count_them_are_still_enough() -> None:
    features = described(0)
    quads = np.repeat(features.tessellation.quads[:3], 150, axis=0)
    shard = QuadShard(
        build_table([(features.landmarks, quads, 0.5)]), np.full(1, 0.5, np.float32), np.ones(1, np.uint8)
    )
    found = QuadConsensus([shard], measure_quads(features.landmarks, features.tessellation.quads[:3]), 0.1, 10**9)
    found.advance(1.0, 3)
    assert found.hits == found._placed == 450


def test_more_submaps_than_a_search_can_number_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urquhart.propose.quad_consensus.MOST_SEARCHED", 5)
    submaps = [described(key) for key in range(6)]
    search([shard_of(submaps[:5])], submaps[0])
    with pytest.raises(ValueError, match="6 submaps"):
        search([shard_of(submaps[:3]), shard_of(submaps[3:])], submaps[0])


def by_key(best: QuadLeaders, keys: NDArray[np.int64]) -> dict[int, tuple[float, int, bytes]]:
    return {
        int(keys[slot]): (score, support, poses.tobytes())
        for slot, score, support, poses in zip(
            best.slots.tolist(), best.scores.tolist(), best.support.tolist(), best.poses, strict=True
        )
    }


@pytest.mark.parametrize("seed", [0, 8, 15])
def test_how_submaps_are_divided_into_lots_is_no_matter(seed: int) -> None:
    submaps = [stand(key) for key in range(24)]
    rng = np.random.default_rng(seed)
    query = seen_again(rng, submaps[seed], -1.0, 0.2, 0.1)
    mixed = rng.permutation(24)
    answers: list[dict[int, tuple[float, int, bytes]]] = []
    for division in ([range(24)], [[k] for k in range(24)], [range(0, 24, 2), [], range(1, 24, 2)], [mixed.tolist()]):
        shards = [shard_of([submaps[k] for k in keys]) for keys in division]
        keys = np.array([k for part in division for k in part], np.int64)
        found = search(shards, query)
        found.advance()
        answers.extend(by_key(found.leaders(count, 3), keys) for count in (24, 5))
        again = search(shards, query)
        again.advance(0.3)
        again.advance()
        assert by_key(again.leaders(24, 3), keys) == answers[-2]
    assert len(answers[0]) > 20
    for whole, few in zip(answers[::2], answers[1::2], strict=True):
        assert whole == answers[0]
        assert few == dict(list(answers[0].items())[:5])


def test_where_nothing_is_found_there_are_neither_leaders_nor_turns() -> None:
    query = described(1)
    bare = describe(np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]]), Config())
    stretched = describe(query.landmarks * 40.0, Config())
    shard = shard_of([described(key) for key in range(3)])
    for found in (
        search([], query),
        search([shard_of([])], query),
        search([shard_of([bare])], query),
        search([shard_of([query, query], dead=[0, 1])], query),
        search([shard], bare),
        search([shard], stretched, 0.01),
    ):
        found.advance()
        assert found.finished
        assert found.hits == 0
        best = found.leaders(5, 4)
        assert (len(best.slots), len(best.scores), len(best.support)) == (0, 0, 0)
        assert best.poses.shape == (0, 4, 3)
        assert [len(column) for column in found.turns(9)] == [0, 0]
    found = search([shard], query)
    assert len(found.leaders(5, 4).slots) == 0
    found.advance()
    assert [len(column) for column in found.turns(0)] == [0, 0]
    assert len(found.leaders(0, 4).slots) == 0


def test_what_another_search_left_in_the_buffer_is_not_found() -> None:
    shards, pool = [shard_of([stand(seed) for seed in range(20)])], BufferPool(1)
    queries = [stand(3), described(4), stand(17)]

    def sought(query: Features, buffer: HitBuffer | None) -> QuadLeaders:
        found = QuadConsensus(
            shards, measure_quads(query.landmarks, query.tessellation.quads), 0.75, 10**9, buffer=buffer
        )
        found.advance()
        return found.leaders(4, 2)

    with pool.borrow() as buffer:
        ours = [sought(query, buffer) for query in queries]
    with pool.borrow() as again:
        assert again is buffer
        ours += [sought(query, again) for query in reversed(queries)]
    for one, query in zip(ours, queries + queries[::-1], strict=True):
        alone = sought(query, None)
        np.testing.assert_array_equal(one.slots, alone.slots)
        np.testing.assert_array_equal(one.poses, alone.poses)
    with pool.borrow() as buffer, pool.borrow() as other:
        assert buffer is not other


@pytest.mark.parametrize("slots", [7, 300_000])
def test_hits_of_neighbouring_slots_follow_each_other_in_their_order(slots: int) -> None:
    rng = np.random.default_rng(4)
    count = 5 * AGREEMENT.together
    hits = np.zeros(count, HIT)
    hits["slot"] = rng.integers(0, slots, count)
    order = order_by_slots(1000, count, hits, slots)
    assert sorted(order) == list(range(1000, count))
    size = max(slots * AGREEMENT.together // count, 1)
    blocks = hits["slot"][order] // size
    assert np.all(np.diff(blocks) >= 0)
    assert np.unique(blocks).size >= 5
    for block in np.unique(blocks):
        assert np.all(np.diff(order[blocks == block]) > 0)
