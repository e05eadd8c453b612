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

    noise: float = 1.1
    """Metres: largest trial value for the noise of one coordinate of a tree against its stem, if it is not known. Each
    further value is half of the one before, so that one exponential is enough for all of them."""
    noises: int = 3
    """Number of trial values, if the noise is not known."""
    above: float = 1.5
    """Largest trial value as a multiple of the noise, if it is roughly known."""
    noises_known: int = 2
    """Number of trial values, if it is."""
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
AT_ONCE: Final = 16
"""Trees whose likelihood ratios are multiplied before a logarithm is taken: one is below 3 million and above 0.04."""


class Stems(NamedTuple):
    """An observation, prepared for superposition.

    Attributes:
        xy: (N, 2) float64, metres, centred frame.
        hull: (H, 2) float64, metres, centred frame, corners of the convex hull, counter-clockwise.
        margin: metres by which the footprint extends beyond the hull; see `rim`.
        area: square metres of the footprint.
        visible: (V, N) float64, trial values of the probability that the map has each stem.
        noise: (K,) float64, metres, trial values for the noise of one coordinate of a tree against its stem: the
            largest first, each half of the one before.
    """

    xy: NDArray[np.float64]
    hull: NDArray[np.float64]
    margin: float
    area: float
    visible: NDArray[np.float64]
    noise: NDArray[np.float64]

    def mirrored(self) -> "Stems":
        """The mirror image: the y axis is reversed."""
        flip = np.array([1.0, -1.0])
        return self._replace(xy=self.xy * flip, hull=np.ascontiguousarray((self.hull * flip)[::-1]))


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


def trial_noise(known: float | None) -> NDArray[np.float64]:
    """Trial values (K,) for the noise, metres; `known`: roughly what it is, None if that is not known."""
    if known is None:
        return np.asarray(SUPERPOSITION.noise * 0.5 ** np.arange(SUPERPOSITION.noises))
    return np.asarray(SUPERPOSITION.above * known * 0.5 ** np.arange(SUPERPOSITION.noises_known))


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
        logs: (K, V, W, U), logarithms of the product over all trees, by noise, visibility, whether diameters count, and
            clutter.
        expected: trees of the map in the footprint if the stems have nothing to do with them.
        visible: (V, N), as in `Stems`.
    """
    for u in range(logs.shape[3]):
        for v in range(logs.shape[1]):
            logs[:, v, :, u] += (1.0 - SUPERPOSITION.clutter[u]) * expected - visible[v].sum()
    best = logs.max()
    return float(best + math.log(np.exp(logs - best).mean()))


@kernel
def superpose(
    stems: Stems,
    trees: NDArray[np.float64],
    density: NDArray[np.float64],
    usual: float,
    ratios: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The evidence (P,) for each pose: the logarithm of the likelihood ratio, averaged over the trial values.

    Args:
        stems: the observation.
        trees: (T, 2), metres, the trees of the map.
        density: (T,), trees per square metre around each tree.
        usual: trees per square metre where none is near.
        ratios: (N, T), as `diameter_ratios` returns them, or (0, 0).
        poses: (P, 3), x, y, yaw of `map_T_query`, metres and radians, frame of `trees`, centred frame of the stems.
    """
    noise, n, kinds, marks = stems.noise, len(stems.xy), len(stems.visible), 1 + (ratios.shape[0] > 0)
    far, edges = SUPERPOSITION.far * noise[0], edges_of(stems.hull)
    around = math.sqrt((stems.hull**2).sum(axis=1).max()) + stems.margin + far
    shares, evidence = np.empty((len(noise), kinds, marks)), np.empty(len(poses))
    total = np.empty((len(noise), kinds, marks, len(SUPERPOSITION.clutter)))
    product, close, away = np.empty_like(total), np.empty(n, np.int64), np.empty(n)
    for h in range(len(poses)):
        c, s = math.cos(poses[h, 2]), math.sin(poses[h, 2])
        total[:], product[:] = 0.0, 1.0
        typical, near, met = 0.0, 0, 0
        for j in range(len(trees)):
            dx, dy = trees[j, 0] - poses[h, 0], trees[j, 1] - poses[h, 1]
            if dx * dx + dy * dy > around * around:
                continue
            x, y = c * dx + s * dy, -s * dx + c * dy
            depth = depth_inside(edges, x, y) + stems.margin
            if depth < -far:
                continue
            if depth > 0.0:
                typical, near = typical + density[j], near + 1
            met += 1
            if met % AT_ONCE == 0:
                rescale(product, total)
            count = stems_near(stems.xy, x, y, far, close, away)
            shares[:] = 0.0
            for m in range(count):
                i, share = close[m], math.exp(-away[m] / (2.0 * noise[0] * noise[0]))
                for k in range(len(noise)):
                    peak = share / (2.0 * math.pi * noise[k] * noise[k] * density[j])
                    for v in range(kinds):
                        shares[k, v, 0] += stems.visible[v, i] * peak
                        if marks > 1:
                            shares[k, v, 1] += stems.visible[v, i] * peak * ratios[i, j]
                    share = (share * share) * (share * share)  # that of half the noise
            for k in range(len(noise)):
                multiply_in(product, shares, k, share_inside(depth / noise[k]))
        expected = stems.area * (typical / near if near else usual)
        rescale(product, total)
        evidence[h] = log_mean_ratio(total, expected, stems.visible)
    return evidence


@kernel
def multiply_in(product: NDArray[np.float64], shares: NDArray[np.float64], k: int, inside: float) -> None:
    """Multiply `product[k]` (V, W, U) by the likelihood ratio of one tree.

    Args:
        shares: (K, V, W), density of the stems' trees there over that of all trees.
        k: trial value of the noise.
        inside: probability that the tree is from the footprint.
    """
    for u in range(product.shape[3]):
        base = 1.0 - inside * (1.0 - SUPERPOSITION.clutter[u])
        for v in range(product.shape[1]):
            for w in range(product.shape[2]):
                product[k, v, w, u] *= base + shares[k, v, w]


@kernel
def rescale(product: NDArray[np.float64], total: NDArray[np.float64]) -> None:
    """Move what a product has gained or lost to its logarithm in `total`, before it overflows."""
    flat, sums = product.ravel(), total.ravel()
    for i in range(len(flat)):
        sums[i] += math.log(flat[i])
        flat[i] = 1.0


@kernel
def stems_near(
    xy: NDArray[np.float64], x: float, y: float, far: float, close: NDArray[np.int64], away: NDArray[np.float64]
) -> int:
    """Count the points of `xy` (N, 2) up to `far` metres from (x, y); their indices and squared distances are written
    to the beginnings of `close` (N,) and `away` (N,)."""
    count = 0
    for i in range(len(xy)):
        squared = (x - xy[i, 0]) ** 2 + (y - xy[i, 1]) ** 2
        if squared <= far * far:
            close[count], away[count] = i, squared
            count += 1
    return count


@kernel
def share_inside(depth: float) -> float:
    """Probability that a point displaced by noise comes from inside an edge `depth` standard deviations away.

    By the logistic function: within 0.01 of the normal distribution's, whose computation took a third of all time.
    """
    return 1.0 / (1.0 + math.exp(-1.702 * depth))


@kernel
def edges_of(hull: NDArray[np.float64]) -> NDArray[np.float64]:
    """The edges (H, 3) of a convex polygon (H, 2), counter-clockwise: the unit normal inwards, and the distance of the
    origin, metres."""
    edges = np.empty((len(hull), 3))
    for i in range(len(hull)):
        j = i + 1 if i + 1 < len(hull) else 0
        ex, ey = hull[j, 0] - hull[i, 0], hull[j, 1] - hull[i, 1]
        length = math.hypot(ex, ey)
        edges[i, 0], edges[i, 1] = -ey / length, ex / length
        edges[i, 2] = (ey * hull[i, 0] - ex * hull[i, 1]) / length
    return edges


@kernel
def depth_inside(edges: NDArray[np.float64], x: float, y: float) -> float:
    """Metres from (x, y) to the nearest of the edges (H, 3) of a convex polygon; negative outside."""
    depth = math.inf
    for i in range(len(edges)):
        depth = min(depth, edges[i, 0] * x + edges[i, 1] * y + edges[i, 2])
    return depth
