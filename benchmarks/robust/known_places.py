"""Submaps whose place is known, and what an answer about them is worth."""

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart import SE2, Candidate, Config, Gates, LandmarkError, Recognition, Recognizer, describe

Points = NDArray[np.float64]

LEVELS: Final = ("none", "polygons", "quads", "exhaustive")
VERDICTS: Final = ("no_match", "ambiguous", "matched")
MATCHED: Final = 2
_ASKED: Final = 3
"""Submaps nearest to the true pose that the oracle is asked about."""

ANSWER: Final = np.dtype(
    [
        ("inside", np.bool_),  # whether the place is in the database
        ("oracle", np.bool_),  # whether the true pose, handed in, would be reported
        ("alone", np.bool_),  # the same if there were no other submaps for rivals to lie in
        ("verdict", np.int8),  # position in VERDICTS
        ("right", np.bool_),  # whether the first candidate is within the bounds
        ("level", np.int8),  # position in LEVELS
        ("confidence", np.float32),
        ("evidence", np.float32),
        ("log_odds", np.float32),
        ("lead", np.float32),  # NaN where nothing was compared
        ("overlap", np.int16),  # landmarks in the overlap, of the side with more
        ("inliers", np.int16),
        ("inliers_right", np.float32),  # share of the inliers that are true pairs, NaN where that is not known
        ("milliseconds", np.float32),
    ]
)
"""One look-up, as a row."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """How far a pose may be from the true one: metres, radians."""

    shift: float
    turn: float


PAPER: Final = Bounds(10.0**0.5, float(np.radians(20.0)))
"""The paper's (section V-B), for its own forests."""
STRICT: Final = Bounds(1.0, float(np.radians(3.0)))
"""Where trees stand in rows, 3 m is the next tree."""


@dataclass(frozen=True, slots=True, eq=False)
class TruePlace:
    """A submap to be stored: landmarks (N, 2), metres, its own frame, and where that is.

    `ground`: which map it belongs to; poses in different maps have nothing to do with each other.
    """

    xy: Points
    ground: int
    pose: SE2
    diameters: Points | None = None


class RobustWorld:
    """A collection of places, and the truth about what is asked."""

    def __init__(self, places: Sequence[TruePlace], config: Config, bounds: Bounds) -> None:
        self.places, self.bounds = list(places), bounds
        self.recognizer = Recognizer(config)
        self.recognizer.add((key, describe(place.xy, config, place.diameters)) for key, place in enumerate(places))
        self._grounds = np.array([place.ground for place in places])
        self._positions = np.array([(place.pose.x, place.pose.y) for place in places]).reshape(-1, 2)

    def ask(
        self,
        xy: Points,
        ground: int | None,
        pose: SE2,
        diameters: Points | None = None,
        *,
        oracle: bool = True,
    ) -> NDArray[Any]:
        """Look an observation up; a row of `ANSWER`.

        Args:
            ground, pose: where it was made (`map_T_query`); no ground where that is not in the collection.
            oracle: whether to ask the oracle too.
        """
        row = np.zeros((), ANSWER)
        start = time.perf_counter()
        found = self.recognizer.locate(xy, diameters=diameters, limit=1)
        row["milliseconds"] = 1e3 * (time.perf_counter() - start)
        row["inside"] = ground is not None
        row["verdict"] = VERDICTS.index(found.verdict)
        row["lead"] = row["inliers_right"] = np.nan
        if found.candidates:
            best = found.candidates[0]
            row["right"] = ground is not None and self.is_right(found, ground, pose)
            row["level"] = LEVELS.index(best.level)
            row["confidence"], row["evidence"], row["log_odds"] = best.confidence, best.evidence, best.log_odds
            row["overlap"] = best.overlap_count
            row["inliers"] = len(best.query_indices)
            if best.lead is not None:
                row["lead"] = best.lead
        if oracle and ground is not None:
            known = self._check(xy, ground, pose, diameters)
            row["alone"] = known is not None
            row["oracle"] = known is not None and not self._rivalled(known, found, ground, pose)
        return row

    def is_right(self, found: Recognition, ground: int, pose: SE2) -> bool:
        """Whether the first candidate puts the query where it was made."""
        best = found.candidates[0]
        return self._is_there(best.key, best.transform, ground, pose)

    def _is_there(self, key: int, transform: SE2, ground: int, pose: SE2) -> bool:
        place = self.places[key]
        shift, turn = (place.pose @ transform).distance(pose)
        return place.ground == ground and shift < self.bounds.shift and turn < self.bounds.turn

    def _check(self, xy: Points, ground: int, pose: SE2, diameters: Points | None) -> Candidate | None:
        """The strongest of the true poses in the submaps nearest to them that would be reported, if any would be."""
        away = np.hypot(*(self._positions - (pose.x, pose.y)).T)
        away[self._grounds != ground] = np.inf
        try:
            observation = describe(xy, self.recognizer.config, diameters)
        except LandmarkError:
            return None
        passed = []
        for key in np.argsort(away, kind="stable")[:_ASKED].tolist():
            if np.isinf(away[key]):
                break
            truth = self.places[key].pose.inverse() @ pose
            found = self.recognizer.verify_pose(observation, key, truth)
            if found.verdict == "matched" and self.is_right(found, ground, pose):
                passed.append(found.candidates[0])
        return max(passed, key=lambda candidate: candidate.evidence, default=None)

    def _rivalled(self, known: Candidate, found: Recognition, ground: int, pose: SE2) -> bool:
        """Whether a pose in another submap that the look-up came upon, and that is not the place, rivals `known`."""
        others = [(rival.key, rival.transform, rival.evidence) for rival in found.rivals]
        others += [(best.key, best.transform, best.evidence) for best in found.candidates]
        gates = Gates.of(self.recognizer.config)
        needed = gates.lead + gates.lead_per_landmark * known.overlap_count
        return any(
            known.evidence - evidence < needed + gates.lead_ratio * max(evidence, 0.0)
            and not self._is_there(key, transform, ground, pose)
            for key, transform, evidence in others
        )


@dataclass(frozen=True, slots=True, eq=False)
class AskedQuery:
    """An observation that a world is asked about, and where it was made.

    Attributes:
        xy: (N, 2), metres, the observation's own frame.
        ground, pose: which map it was made in, and where (`map_T_query`); no ground where that is not in the world.
        diameters: (N,), where they are known.
    """

    world: RobustWorld
    xy: Points
    ground: int | None
    pose: SE2
    diameters: Points | None = None

    def ask(self, *, oracle: bool = True) -> NDArray[Any]:
        """Look it up; a row of `ANSWER`. `oracle`: whether to ask the oracle too."""
        return self.world.ask(self.xy, self.ground, self.pose, self.diameters, oracle=oracle)

    def is_right(self, found: Recognition) -> bool:
        """Whether the first candidate of an answer puts the observation where it was made."""
        return bool(found.candidates) and self.ground is not None and self.world.is_right(found, self.ground, self.pose)


@dataclass(frozen=True, slots=True)
class AskedPart:
    """One part of an experiment (a cell of a grid, or a kind of stand), and how many queries it has.

    Attributes:
        part: index of the cell or kind.
        seed: of all randomness.
        inside, outside: queries of places that are in the database, and of others.
    """

    part: int
    seed: int
    inside: int
    outside: int


def figures_of(results: Sequence[NDArray[Any]]) -> dict[str, Any]:
    """The figures of an experiment: a summary of the answers of each part, and all answers."""
    return {"summaries": [summarize(answers) for answers in results], "answers": np.concatenate(results)}


def gather(rows: Iterable[NDArray[Any]]) -> NDArray[Any]:
    """Rows of `ANSWER` as one array (Q,)."""
    return np.array(list(rows), ANSWER)


def summarize(answers: NDArray[Any]) -> dict[str, Any]:
    """Counts and rates of answers (Q,): what was asked, accepted, right and wrong, and what an oracle would accept."""
    matched, inside, right = answers["verdict"] == MATCHED, answers["inside"], answers["right"]
    oracle = answers["oracle"]
    milliseconds = answers["milliseconds"]
    return {
        "inside": int(inside.sum()),
        "outside": int((~inside).sum()),
        "oracle": int(oracle.sum()),
        "alone": int(answers["alone"].sum()),
        "right": int((matched & right).sum()),
        "right_of_oracle": int((matched & right & oracle).sum()),
        "wrong": int((matched & inside & ~right).sum()),
        "false": int((matched & ~inside).sum()),
        "ambiguous": int((inside & (answers["verdict"] == VERDICTS.index("ambiguous"))).sum()),
        "milliseconds": float(np.median(milliseconds)) if len(answers) else None,
    }
