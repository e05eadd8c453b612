"""What a table of quads says, read by means that share no code with it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.urquhart import forests
from urquhart import SE2, Config, Features, describe
from urquhart.evaluation.simulation import bridson
from urquhart.index.quad_search import QuadShard
from urquhart.index.quad_table import QuadTable, build_table, centre_scale, measure_quads
from urquhart.propose.quad_consensus import QuadConsensus


@dataclass(frozen=True, eq=False)
class Decoded:
    """Words of a table in the order they lie in.

    Attributes:
        cells: (Q, 5) int64, sides in steps of 1.6 m, 63 for whatever is longer, and the diagonal in steps of 0.8 m, 255
            for whatever is longer.
        steps: (Q, 5) int64, sides in steps of 0.2 m and the diagonal in steps of 0.1 m, where they are no longer.
        turns: (Q,) int64, directions in 256ths of a turn.
        centres: (Q, 2) int64, centres in steps, which may be negative.
        slots: (Q,) int64.
    """

    cells: NDArray[np.int64]
    steps: NDArray[np.int64]
    turns: NDArray[np.int64]
    centres: NDArray[np.int64]
    slots: NDArray[np.int64]

    def rows(self) -> list[tuple[int, ...]]:
        """Everything that is told of each quad, sorted."""
        columns = np.column_stack([self.cells, self.steps, self.turns, self.centres, self.slots])
        return sorted(map(tuple, columns.tolist()))


def decode(table: QuadTable) -> Decoded:
    """Read every word bit by bit, as the head of the module that writes them describes it."""
    words = [int(word) for word in table.words]
    codes = [
        code
        for code, begin, end in zip(table.codes.tolist(), table.starts[:-1], table.starts[1:], strict=True)
        for _ in range(int(begin), int(end))
    ]
    parts = [[*((code >> shift) & 63 for shift in (26, 20, 14, 8)), code & 255] for code in codes]
    cells = np.array(parts, np.int64).reshape(-1, 5)
    places = np.array([[(word >> 3 * k) & 7 for k in range(5)] for word in words], np.int64).reshape(-1, 5)
    return Decoded(
        cells,
        8 * cells + places,
        np.array([(word >> 15) & 0xFF for word in words], np.int64),
        np.array([[((word >> 23) & 0xFF) - 128, ((word >> 31) & 0xFF) - 128] for word in words], np.int64).reshape(
            -1, 2
        ),
        np.array([word >> 39 for word in words], np.int64),
    )


def described(seed: int, count: int = 60, side: float = 60.0) -> Features:
    """A patch of natural forest."""
    return describe(forests.uniform(np.random.default_rng(seed), count, side), Config())


def stand(seed: int) -> Features:
    """A dense stand, trees 4 m apart at the least: its quads resemble each other."""
    return describe(bridson(50.0, 50.0, 4.0, np.random.default_rng(seed)), Config())


def sparse(seed: int) -> Features:
    """A thin forest, with sides longer than those that are told apart."""
    return describe(forests.uniform(np.random.default_rng(seed), 60, 330.0), Config())


def seen_again(rng: np.random.Generator, submap: Features, turn: float, sigma: float, missing: float) -> Features:
    """What is described of a submap seen from elsewhere."""
    noisy = submap.landmarks + rng.normal(0.0, sigma, submap.landmarks.shape)
    seen = noisy[rng.random(len(noisy)) >= missing]
    return describe(SE2(40.0, -10.0, turn).inverse().apply(seen), Config())


def truth(turn: float, query: Features) -> SE2:
    """`submap_T_query` of that, between centred frames."""
    return SE2(40.0, -10.0, turn) @ SE2.shift(query.origin)


def table_of(submaps: Sequence[Features]) -> QuadTable:
    """The table of submaps, slots in their order."""
    return build_table([(f.landmarks, f.tessellation.quads, centre_scale(f.landmarks)) for f in submaps])


def shard_of(submaps: Sequence[Features], dead: Sequence[int] = ()) -> QuadShard:
    """The same ready to be searched, but for the slots `dead`."""
    alive = np.ones(len(submaps), np.uint8)
    alive[list(dead)] = 0
    return QuadShard(table_of(submaps), np.array([centre_scale(f.landmarks) for f in submaps], np.float32), alive)


def search(shards: Sequence[QuadShard], query: Features, tolerance: float = 0.5, most: int = 10**9) -> QuadConsensus:
    """A search for the query's quads, by default for all that there are."""
    return QuadConsensus(shards, measure_quads(query.landmarks, query.tessellation.quads), tolerance, most)
