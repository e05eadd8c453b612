"""The methods compared, behind one small interface: describe an observation, match two descriptions.

What a match is worth is not theirs to say: the same RANSAC, the same minima and the same verification follow for all of
them (`attempts`). Only the robust method answers with a verdict of its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from urquhart import SE2, Config, Features, Recognizer, describe
from urquhart.features.polygon_descriptor import describe_triangles
from urquhart.paper.delaunay_triangles import Triangles, describe_delaunay, link_triangles, nearest_triangles
from urquhart.paper.glarot import (
    GlarotConfig,
    Signatures,
    describe_glare,
    distance_table,
    global_distance,
    keep_mutual,
)
from urquhart.paper.matching import Polygons, claim_landmarks, keep_one_to_one, sample_polygons

Points = NDArray[np.float64]
Correspondences = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Landmark indices (K,) of the query and (K,) of the submap that would be the same trees."""
LETTER_TAU: Final = 5.0
"""The paper's best tau, and the best here too when pairs are scored as in the paper (`pr_curves`)."""
LI_THRESHOLDS: Final = (30.0, 100.0)
"""The paper found 100 best for this method; scored as in the paper, 30 is better here."""


class Method(Protocol):
    """A method that finds correspondences. A description is its own business; it only goes back into the method."""

    @property
    def variants(self) -> tuple[str, ...]:
        """Names of what `match` gives, in order: uses of one method that share their work."""

    def describe(self, xy: Points) -> Any:
        """Describe landmarks (N, 2), metres, any rigid frame."""

    def match(self, query: Any, submap: Any, rng: np.random.Generator) -> Mapping[str, Correspondences]:
        """Correspondences between two descriptions for each variant; indices as in `describe`'s landmarks."""

    def gate(self, query: Any, submap: Any) -> float:
        """Distance of the whole observations, for methods that ask that first; 0 for the others."""


@dataclass(frozen=True, slots=True)
class PaperDescription:
    """Features, and the descriptors (T, D) of their triangles: the paper stores both when it describes."""

    features: Features
    triangles: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Paper:
    """The paper's own matching: polygons, their triangles, edges, landmarks."""

    config: Config
    name: str = "paper"

    @property
    def variants(self) -> tuple[str, ...]:
        """One."""
        return (self.name,)

    def describe(self, xy: Points) -> PaperDescription:
        """Features and triangle descriptors."""
        features = describe(xy, self.config)
        rows = describe_triangles(
            features.landmarks, features.tessellation.triangles, self.config.samples, self.config.squared
        )
        return PaperDescription(features, rows)

    def match(
        self, query: PaperDescription, submap: PaperDescription, rng: np.random.Generator
    ) -> Mapping[str, Correspondences]:
        """As `urquhart.paper.matching.match_landmarks`, which describes the triangles again at each call."""
        first, second = (self._polygons(side, rng) for side in (query, submap))
        claims = claim_landmarks(first, second, self.config.tau, self.config.vertex_window, self.config.eta)
        return {self.name: keep_one_to_one(claims, len(first.landmarks), len(second.landmarks))}

    def _polygons(self, side: PaperDescription, rng: np.random.Generator) -> Polygons:
        t, features = side.features.tessellation, side.features
        counts = t.vertex_counts()
        return Polygons(
            features.landmarks,
            t.triangles,
            side.triangles,
            t.members,
            t.member_offsets,
            counts,
            features.descriptors,
            sample_polygons(counts, self.config.gamma, rng),
        )

    def gate(self, query: PaperDescription, submap: PaperDescription) -> float:
        """None: 0."""
        return 0.0


@dataclass(frozen=True, slots=True)
class Glarot:
    """GLARE signatures and the GLAROT distance.

    `glarot` is its use in the paper: a gate on the whole observation, then landmarks that are nearest to each other.
    `glarot-local` passes over the gate and hands every landmark with its nearest to RANSAC.
    """

    config: GlarotConfig = field(default_factory=GlarotConfig)

    @property
    def variants(self) -> tuple[str, ...]:
        """With the gate and without."""
        return ("glarot", "glarot-local")

    def describe(self, xy: Points) -> Signatures:
        """Signatures of each landmark and of the whole."""
        return describe_glare(xy, self.config)

    def match(self, query: Signatures, submap: Signatures, rng: np.random.Generator) -> Mapping[str, Correspondences]:
        """Both variants from one table of distances."""
        if not len(query.local) or not len(submap.local):
            return dict.fromkeys(self.variants, (np.empty(0, np.int64), np.empty(0, np.int64)))
        table = distance_table(query.local, submap.local, self.config.directions)
        return {"glarot": keep_mutual(table), "glarot-local": (np.arange(len(table)), table.argmin(axis=1))}

    def gate(self, query: Signatures, submap: Signatures) -> float:
        """GLAROT distance of the global signatures, 0 to 1."""
        return global_distance(query, submap, self.config)


@dataclass(frozen=True, slots=True)
class Li:
    """Delaunay triangles by area and perimeter, after Li et al., at several thresholds."""

    thresholds: tuple[float, ...] = LI_THRESHOLDS

    @property
    def variants(self) -> tuple[str, ...]:
        """One for each threshold; the paper's is just `li`."""
        return tuple("li" if threshold == 100.0 else f"li-{threshold:g}" for threshold in self.thresholds)

    def describe(self, xy: Points) -> Triangles:
        """Inner triangles and their descriptors."""
        return describe_delaunay(xy)

    def match(self, query: Triangles, submap: Triangles, rng: np.random.Generator) -> Mapping[str, Correspondences]:
        """Landmarks of near triangles."""
        nearest, distance = nearest_triangles(query, submap)
        return {
            name: link_triangles(query, submap, nearest, distance, threshold)
            for name, threshold in zip(self.variants, self.thresholds, strict=True)
        }

    def gate(self, query: Triangles, submap: Triangles) -> float:
        """None: 0."""
        return 0.0


@dataclass(frozen=True, slots=True)
class MatcherAnswer:
    """What the robust method says of one pair: whether it reports it, and submap_T_query, frames as given."""

    matched: bool
    transform: SE2 | None


@dataclass(frozen=True, slots=True)
class Robust:
    """The Recognizer's default method: each submap a collection of its own, each answer its own verdict."""

    config: Config

    def describe(self, xy: Points) -> Recognizer:
        """A collection that holds this one submap."""
        recognizer = Recognizer(self.config)
        recognizer.add([(0, describe(xy, self.config))])
        return recognizer

    def answer(self, xy: Points, submap: Recognizer) -> MatcherAnswer:
        """Look an observation (N, 2), metres, up in a collection of one submap."""
        found = submap.locate(xy, limit=1)
        return MatcherAnswer(found.verdict == "matched", found.candidates[0].transform if found.candidates else None)
