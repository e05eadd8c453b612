"""The evidence for a transform, from every landmark. Only evidence makes a match.

Under a transform, two sets of landmarks are either the same trees seen twice, or two unrelated patches of forest. Each
landmark inside the overlap of the two footprints is evidence. One with a partner at a distance that noise explains
counts for the transform, more so where the forest is sparse. One without a partner counts against it. The sum of the
logarithms is the log-likelihood ratio that is reported as `evidence`.

Let m be the probability that a tree in the overlap that one side saw is seen by the other side, s the noise of one
coordinate of a residual, and d the density of landmarks around it. A landmark with a partner at distance r contributes

    log( (1 - m) + m exp(-r^2 / 2 s^2) / (2 pi s^2 d) )

and one without a partner contributes log(1 - m). Stem diameters contribute too if both sides have them. m and s are
unknown, so the evidence is the best over a few trial values (`EVIDENCE.noise`, `EVIDENCE.detection`).
"""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.se2 import SE2
from urquhart.verify.diameters import score_diameter_pairs
from urquhart.verify.landmark_grid import LandmarkGrid, is_inside
from urquhart.verify.pairing import pair_up


class EvidenceNumbers(NamedTuple):
    """Trial values of the noise model, within what sensors do. Chosen by hand, not fitted."""

    noise: tuple[float, ...] = (0.05, 0.1, 0.2, 0.35, 0.6, 0.9)
    """Metres: trial values for the noise of one coordinate of a residual."""
    detection: tuple[float, ...] = (0.5, 0.65, 0.8, 0.9)
    """Trial values for the probability that a tree seen once is seen again. The least is well above zero, so that a few
    chance partners among many landmarks without one never add up to a match."""


EVIDENCE: Final = EvidenceNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class PoseEvidence:
    """A transform, and the evidence for it.

    Attributes:
        transform: `submap_T_query` between the centred frames.
        evidence: log-likelihood ratio, natural logarithm, of the same place against chance.
        diameter_evidence: the part of the evidence that stem diameters contribute.
        query, submap: (K,) int64, landmark indices of the one-to-one inliers.
        residuals: (K,) float64, metres.
        query_overlap, submap_overlap: number of landmarks of each side inside the overlap of the footprints.
        noise: metres, the trial value for the noise of one coordinate that explains the residuals best.
        overlap: the larger one of `query_overlap` and `submap_overlap`.
    """

    transform: SE2
    evidence: float
    diameter_evidence: float
    query: NDArray[np.int64]
    submap: NDArray[np.int64]
    residuals: NDArray[np.float64]
    query_overlap: int
    submap_overlap: int
    noise: float

    @property
    def overlap(self) -> int:
        return max(self.query_overlap, self.submap_overlap)


def evidence_of_pose(query: LandmarkGrid, submap: LandmarkGrid, pose: SE2, reach: float) -> PoseEvidence:
    """The evidence for `pose` (`submap_T_query`, centred frames), without refining it.

    `reach`: metres, largest distance of partners.
    """
    evidence, diameter_evidence, first, second, residuals, query_overlap, submap_overlap, noise = score_pose(
        query, submap, pose.x, pose.y, pose.yaw, reach
    )
    return PoseEvidence(
        pose, evidence, diameter_evidence, first, second, residuals, query_overlap, submap_overlap, noise
    )


def evidence_of_row(query: LandmarkGrid, submap: LandmarkGrid, row: NDArray[np.float64]) -> PoseEvidence:
    """The evidence for a pose that `refine_and_score` returned as a row (6,)."""
    x, y, yaw, _, reach, _ = row.tolist()
    return evidence_of_pose(query, submap, SE2(x, y, yaw), reach)


@kernel
def score_pose(
    query: LandmarkGrid, submap: LandmarkGrid, x: float, y: float, yaw: float, reach: float
) -> tuple[float, float, NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], int, int, float]:
    """The fields of a `PoseEvidence` after the transform; the module's docstring has the formula.

    `x`, `y`, `yaw`: of `submap_T_query`, centred frames, metres and radians; `reach`: metres, largest distance of
    partners.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    first, second, squared = pair_up(query.landmarks, submap, x, y, yaw, reach)
    seen, stored = query.landmarks, submap.landmarks
    paired_query, paired_submap = np.zeros(len(seen), np.bool_), np.zeros(len(stored), np.bool_)
    for k in range(len(first)):
        paired_query[first[k]] = True
        paired_submap[second[k]] = True
    query_overlap = submap_overlap = len(first)
    for i in range(len(seen)):
        if not paired_query[i] and is_inside(
            submap, c * seen[i, 0] - s * seen[i, 1] + x, s * seen[i, 0] + c * seen[i, 1] + y
        ):
            query_overlap += 1
    for j in range(len(stored)):
        dx, dy = stored[j, 0] - x, stored[j, 1] - y
        if not paired_submap[j] and is_inside(query, c * dx + s * dy, -s * dx + c * dy):
            submap_overlap += 1
    alone = query_overlap + submap_overlap - 2 * len(first)

    peaks = np.empty(len(first))
    best, best_noise = -np.inf, 0.0
    for noise in EVIDENCE.noise:
        for k in range(len(first)):
            # The denser side counts: chance partners are frequent if either side is dense.
            density = max(query.density[first[k]], submap.density[second[k]])
            peaks[k] = math.exp(-squared[k] / (2.0 * noise * noise)) / (2.0 * math.pi * noise * noise * density)
        for detection in EVIDENCE.detection:
            total, product = alone * math.log(1.0 - detection), 1.0
            for k in range(len(first)):
                product *= 1.0 - detection + detection * peaks[k]
                # One logarithm for many factors, before their product leaves the range of a float.
                if product > 1e100 or product < 1e-100:
                    total, product = total + math.log(product), 1.0
            total += math.log(product)
            if total > best:
                best, best_noise = total, noise
    diameter_evidence = score_diameter_pairs(
        query.diameters, query.diameter_spread, submap.diameters, submap.diameter_spread, first, second
    )
    return (
        best + diameter_evidence,
        diameter_evidence,
        first,
        second,
        np.sqrt(squared),
        query_overlap,
        submap_overlap,
        best_noise,
    )
