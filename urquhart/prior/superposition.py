"""The evidence for a pose without pairing: how well the trees of a map fit a density made of the observed stems.

Where the noise is small against the distance between trees, each has one partner, and `evidence` scores the pairs. A
tree top seen from the air may be off by a third of that distance, and a third of the stems of a plot have no top. Then
no stem has a certain partner, but the sum over all possible partners still tells where the plot is.

If the plot lies under a pose, the trees of the map there are drawn with the density

    d (1 - inside (1 - clutter)) + sum over stems of visible_i N(x; stem_i, s^2)

and otherwise with the density d of the map's trees. `inside` is the probability that a point displaced by the noise s
comes from the footprint of the stems. The evidence is the log-likelihood ratio of the two Poisson processes. Noise,
clutter and visibility are unknown, so their likelihoods are averaged over a few trial values. Some of these let the
thicker stems be seen and the thinner ones not: where diameters are known, they tell which trees a sensor in the air
sees.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.verify.diameters import DIAMETERS, standardize_diameters


class SuperpositionNumbers(NamedTuple):
    """Trial values of the model. Chosen by hand, not fitted."""

    noise: tuple[float, ...] = (0.3, 0.6, 1.0)
    """Metres: trial values for the noise of one coordinate of a tree against its stem."""
    clutter: tuple[float, ...] = (0.05, 0.2)
    """Trial values for the share of the map's trees in the footprint that are not among the stems."""
    visible: tuple[float, ...] = (0.6, 0.9)
    """Trial values for the share of stems that the map has, if all are seen equally well."""
    canopy: tuple[float, ...] = (0.5, 0.7)
    """Trial values for the share of stems that are seen if the thicker ones are, and the thinner ones not."""
    most_rim: float = 0.5
    """Largest share of the footprint that may lie outside the hull."""
    soft: float = 0.1
    """How gradually visibility falls with the rank of a diameter, as a share of all stems."""
    most_visible: float = 0.95
    """Visibility of the thickest stems."""
    least_visible: float = 0.02
    """Visibility of the thinnest stems."""
    far: float = 4.0
    """Standard deviations beyond which a stem does not account for a tree."""


SUPERPOSITION: Final = SuperpositionNumbers()


class Stems(NamedTuple):
    """An observation, prepared for superposition.

    Attributes:
        xy: (N, 2) float64, metres, centred frame.
        hull: (H, 2) float64, metres, centred frame, corners of the convex hull, counter-clockwise.
        margin: metres by which the footprint extends beyond the hull; see `rim`.
        area: square metres of the footprint.
        visible: (V, N) float64, trial values of the probability that the map has each stem.
    """

    xy: NDArray[np.float64]
    hull: NDArray[np.float64]
    margin: float
    area: float
    visible: NDArray[np.float64]

    def mirrored(self) -> "Stems":
        """The mirror image: the y axis is reversed."""
        flip = np.array([1.0, -1.0])
        return Stems(
            self.xy * flip, np.ascontiguousarray((self.hull * flip)[::-1]), self.margin, self.area, self.visible
        )


def rim(count: int, hull: NDArray[np.float64], area: float) -> tuple[float, float]:
    """By how many metres the area that was seen extends beyond the convex hull of its trees, and its square metres.

    The hull of few trees is much smaller than the plot: of 20 trees in a circle, it covers 60 %. By Efron's theorem the
    share that it leaves out is, on average, that of the trees that are corners of a hull.

    Args:
        count: number of trees.
        hull: (H, 2), metres, the corners.
        area: square metres inside the hull.
    """
    left = min(len(hull) / count, SUPERPOSITION.most_rim)
    whole = area / (1.0 - left)
    around = float(np.hypot(*(np.roll(hull, -1, axis=0) - hull).T).sum())
    # Dilated by m, a convex polygon has the area A + P m + pi m^2.
    margin = (math.sqrt(around**2 + 4.0 * math.pi * (whole - area)) - around) / (2.0 * math.pi)
    return margin, whole


def visibility(count: int, diameters: NDArray[np.float32]) -> NDArray[np.float64]:
    """Trial values (V, N) of the probability that the map has each of `count` stems.

    `diameters`: (N,), any unit, NaN where not known; empty if none is known.
    """
    flat = np.repeat(np.array(SUPERPOSITION.visible)[:, None], count, axis=1)
    if len(diameters) != count or np.isnan(diameters).any() or not len(standardize_diameters(diameters)[0]):
        return flat
    rank = np.argsort(np.argsort(-diameters, kind="stable"), kind="stable") / count
    low, high = SUPERPOSITION.least_visible, SUPERPOSITION.most_visible
    tall = [low + (high - low) / (1.0 + np.exp((rank - share) / SUPERPOSITION.soft)) for share in SUPERPOSITION.canopy]
    return np.concatenate([flat, np.array(tall)])


def diameter_ratios(
    stems: NDArray[np.float32], trees: NDArray[np.float32], counts: tuple[int, int]
) -> NDArray[np.float64]:
    """Likelihood ratios (N, T) of the diameters of a stem and a tree: one tree against two. Shape (0, 0) if unknown.

    Args:
        stems, trees: (N,) and (T,), diameters in any unit, NaN where not known; empty if none is known.
        counts: N and T.
    """
    if len(stems) != counts[0] or len(trees) != counts[1]:
        return np.empty((0, 0))
    (a, a_spread), (b, b_spread) = standardize_diameters(stems), standardize_diameters(trees)
    if not len(a) or not len(b):
        return np.empty((0, 0))
    rho = min(max(1.0 - (DIAMETERS.error / min(a_spread, b_spread)) ** 2, 0.0), DIAMETERS.most_correlation)
    left, x, y = 1.0 - rho * rho, a[:, None], b[None, :]
    log = -0.5 * math.log(left) - (rho * rho * (x * x + y * y) - 2.0 * rho * x * y) / (2.0 * left)
    return np.asarray(np.exp(np.where(np.isnan(log), 0.0, log)))


@kernel
def log_mean_ratio(logs: NDArray[np.float64], expected: float, visible: NDArray[np.float64]) -> float:
    """Logarithm of the mean likelihood ratio over the trial values.

    Args:
        logs: (K, V, U, W), logarithms of the product over all trees, by noise, visibility, clutter, and whether
            diameters count.
        expected: trees of the map in the footprint if the stems have nothing to do with them.
        visible: (V, N), as in `Stems`.
    """
    for u in range(logs.shape[2]):
        for v in range(logs.shape[1]):
            logs[:, v, u, :] += (1.0 - SUPERPOSITION.clutter[u]) * expected - visible[v].sum()
    best = logs.max()
    return float(best + math.log(np.exp(logs - best).mean()))


@kernel
def superpose(
    stems: Stems,
    trees: NDArray[np.float64],
    density: NDArray[np.float64],
    ratios: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The evidence (P,) for each pose: the logarithm of the likelihood ratio, averaged over the trial values.

    Args:
        stems: the observation.
        trees: (T, 2), metres, the trees of the map.
        density: (T,), trees per square metre around each tree.
        ratios: (N, T), as `diameter_ratios` returns them, or (0, 0).
        poses: (P, 3), x, y, yaw of `map_T_query`, metres and radians, frame of `trees`, centred frame of the stems.
    """
    noise, clutter, visible = SUPERPOSITION.noise, SUPERPOSITION.clutter, stems.visible
    n, kinds, marks = len(stems.xy), len(visible), 1 + (ratios.shape[0] > 0)
    far = SUPERPOSITION.far * noise[len(noise) - 1]
    around = math.sqrt((stems.hull**2).sum(axis=1).max()) + stems.margin + far
    total = np.empty((len(noise), kinds, len(clutter), marks))
    product, shares, evidence = np.empty_like(total), np.empty((kinds, marks)), np.empty(len(poses))
    for h in range(len(poses)):
        c, s = math.cos(poses[h, 2]), math.sin(poses[h, 2])
        total[:], product[:] = 0.0, 1.0
        typical, near = 0.0, 0
        for j in range(len(trees)):
            dx, dy = trees[j, 0] - poses[h, 0], trees[j, 1] - poses[h, 1]
            if dx * dx + dy * dy > around * around:
                continue
            x, y = c * dx + s * dy, -s * dx + c * dy
            depth = depth_inside(stems.hull, x, y) + stems.margin
            if depth < -far:
                continue
            if depth > 0.0:
                typical, near = typical + density[j], near + 1
            for k in range(len(noise)):
                variance = noise[k] * noise[k]
                shares[:] = 0.0
                for i in range(n):
                    squared = (x - stems.xy[i, 0]) ** 2 + (y - stems.xy[i, 1]) ** 2
                    if squared > SUPERPOSITION.far**2 * variance:
                        continue
                    peak = math.exp(-squared / (2.0 * variance)) / (2.0 * math.pi * variance * density[j])
                    for v in range(kinds):
                        shares[v, 0] += visible[v, i] * peak
                        if marks > 1:
                            shares[v, 1] += visible[v, i] * peak * ratios[i, j]
                inside = 0.5 * (1.0 + math.erf(depth / (noise[k] * math.sqrt(2.0))))
                for u in range(len(clutter)):
                    base = 1.0 - inside * (1.0 - clutter[u])
                    for v in range(kinds):
                        for w in range(marks):
                            held = product[k, v, u, w] * (base + shares[v, w])
                            if held > 1e100 or held < 1e-100:
                                total[k, v, u, w], held = total[k, v, u, w] + math.log(held), 1.0
                            product[k, v, u, w] = held
        expected = stems.area * (typical / near if near else density.mean())
        evidence[h] = log_mean_ratio(total + np.log(product), expected, visible)
    return evidence


@kernel
def depth_inside(hull: NDArray[np.float64], x: float, y: float) -> float:
    """Metres from (x, y) to the nearest edge of a convex polygon (H, 2), counter-clockwise; negative outside."""
    depth = math.inf
    for i in range(len(hull)):
        j = i + 1 if i + 1 < len(hull) else 0
        ex, ey = hull[j, 0] - hull[i, 0], hull[j, 1] - hull[i, 1]
        side = (ex * (y - hull[i, 1]) - ey * (x - hull[i, 0])) / math.hypot(ex, ey)
        depth = min(depth, side)
    return depth
