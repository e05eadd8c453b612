"""Rotations that quads agree on where they agree on nothing else."""

import numpy as np

from tests.urquhart.tables import search, seen_again, shard_of, stand
from urquhart.propose.quad_consensus import TURN


def test_turns_rank_the_submap_seen_again_and_its_rotation_first() -> None:
    """Measured so loosely that no hit proves anything, quads still agree on submap and rotation."""
    submaps = [stand(key) for key in range(30)]
    for seed in (0, 11, 29):
        for turn in (-3.1, -0.4, 1.0, 3.0):
            query = seen_again(np.random.default_rng(seed), submaps[seed], turn, 0.2, 0.1)
            found = search([shard_of(submaps[:10]), shard_of(submaps[10:])], query, 0.75)
            found.advance()
            slots, rotations = found.turns(60)
            assert 5 < len(slots) == len(rotations) <= 60
            assert slots[0] == seed
            assert abs((rotations[0] - turn + np.pi) % (2.0 * np.pi) - np.pi) <= TURN
            # A submap comes once for each of its peaks, and never twice for one.
            assert len(set(zip(slots.tolist(), rotations.tolist(), strict=True))) == len(slots)
            for slot in set(slots.tolist()):
                own = np.sort(rotations[slots == slot])
                assert (np.diff(np.append(own, own[0] + 2.0 * np.pi)) > 0.9 * TURN).all()

            fewer = found.turns(5)
            np.testing.assert_array_equal(fewer[0], slots[:5])
            np.testing.assert_array_equal(fewer[1], rotations[:5])
            others = search([shard_of(submaps, dead=[seed])], query, 0.75)
            others.advance()
            assert seed not in others.turns(60)[0]
