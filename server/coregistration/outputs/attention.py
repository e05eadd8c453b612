"""Which plots somebody should look at first, and why."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from server.coregistration.outputs.diameters import diameter_unit
from server.coregistration.results import PlotResult
from urquhart.verify.distortion import WARNINGS

_ORDER: Final = ("not_read", "failed", "ambiguous", "no_match", "matched")
_SAME_SHAPE: Final = 0.02
"""Metres: distances from the middle of two plots that differ by less are those of the same trees."""
_SAME_PLACE: Final = 1.0
"""Metres: centres of different plots that are closer than this cannot both be right."""
_FEW: Final = 8
"""Matched plots from which the shift of one can be unusual."""
_UNUSUAL: Final = 6.0
"""Median deviations from the median beyond which a shift is unusual,"""
_LEAST_UNUSUAL: Final = 2.0
"""but at least this many metres."""
_LOW_SHARE: Final = 0.5
"""Share of a plot's trees with a partner below which somebody should look at the plot."""

_ELSEWHERE: Final = 100.0
"""Metres from its own coordinates, beyond which a plot that was found there is not where they say: GNSS under trees is
off by 1 to 20.
"""
_AROUND: Final = 2.0
"""Radii of a plot within which the point 0, 0 is the plot's own, so its coordinates do not say where it is."""


@dataclass(frozen=True, slots=True)
class Attention:
    """A plot that needs eyes: its result, and why."""

    result: PlotResult
    why: tuple[str, ...]


def needs_attention(results: Sequence[PlotResult]) -> list[Attention]:
    """The plots that need eyes, the most urgent first."""
    reasons = _reasons(results)
    found = [Attention(result, tuple(why)) for result, why in zip(results, reasons, strict=True) if why]
    return sorted(found, key=lambda one: _ORDER.index(one.result.outcome))


def _reasons(results: Sequence[PlotResult]) -> list[list[str]]:
    """For each result, why it needs eyes; empty if it does not."""
    twins, overlaid = same_trees(results), _same_place(results)
    unusual = _unusual_shifts(results)
    reasons: list[list[str]] = []
    for at, result in enumerate(results):
        why: list[str] = []
        if twins[at]:
            names = _named([results[other].name for other in twins[at]])
            why.append(f"has the same trees as {names} of this season, tree by tree: keep the one that is right")
        if result.outcome != "matched":
            why.append(result.sentence)
        if overlaid[at]:
            names = _named([results[other].name for other in overlaid[at]])
            why.append(f"is placed where {names} is, too: only one of them can be there")
        why += [WARNINGS[word] for word in result.warnings]
        why += [*result.notes, *_elsewhere(result), *diameter_unit(result)]
        if unusual[at]:
            why.append(unusual[at])
        if result.outcome == "matched" and result.share is not None and result.share < _LOW_SHARE:
            why.append(f"only {result.inliers} of {len(result.trees)} trees are in the map")
        reasons.append(why)
    return reasons


def _elsewhere(result: PlotResult) -> list[str]:
    """Why a matched plot needs eyes because it was found far from where it ought to be, or says that it is."""
    pose = result.pose
    if pose is None or pose.shift_e is None or pose.shift_n is None:
        return []
    if result.searched == "everywhere" and pose.nominal_e is not None:
        return ["is not near where it ought to be, and was found elsewhere in the map: check its position"]
    away, around = math.hypot(pose.shift_e, pose.shift_n), math.hypot(*(result.centre or (0.0, 0.0)))
    if pose.nominal_e is not None or result.is_local or away <= _ELSEWHERE or around <= _AROUND * result.radius:
        return []
    far = f"{away / 1000.0:,.1f} km" if away >= 1000.0 else f"{away:.0f} m"
    return [f"was found {far} from its own coordinates: check them, and the system that they are in"]


def same_trees(results: Sequence[PlotResult]) -> list[list[int]]:
    """For each result, positions of the others whose trees form the same pattern, turned or moved or not."""
    by_count: dict[int, list[int]] = {}
    shapes: list[np.ndarray] = []
    for at, result in enumerate(results):
        xy = np.array([(tree.x, tree.y) for tree in result.trees]).reshape(-1, 2)
        shapes.append(np.sort(np.hypot(*(xy - xy.mean(axis=0)).T)) if len(xy) else np.empty(0))
        by_count.setdefault(len(xy), []).append(at)
    found: list[list[int]] = [[] for _ in results]
    for count, alike in by_count.items():
        if count < 3:
            continue
        stacked = np.stack([shapes[at] for at in alike])
        for row, at in enumerate(alike):
            same = np.abs(stacked - stacked[row]).max(axis=1) <= _SAME_SHAPE
            found[at] = [alike[other] for other in np.flatnonzero(same).tolist() if other != row]
    return found


def _same_place(results: Sequence[PlotResult]) -> list[list[int]]:
    """For each matched result, positions of the others that are placed there, too."""
    found: list[list[int]] = [[] for _ in results]
    placed = [(at, one.pose) for at, one in enumerate(results) if one.pose is not None]
    for index, (at, pose) in enumerate(placed):
        for other, there in placed[index + 1 :]:
            if pose.frame_id == there.frame_id and math.hypot(pose.e - there.e, pose.n - there.n) < _SAME_PLACE:
                found[at].append(other)
                found[other].append(at)
    return found


def _unusual_shifts(results: Sequence[PlotResult]) -> list[str]:
    """For each result a sentence if its shift differs from that of the others; else empty."""
    told = [""] * len(results)
    placed = [
        (at, one.pose.shift_e, one.pose.shift_n)
        for at, one in enumerate(results)
        if one.pose is not None and not one.is_local
    ]
    known = [(at, e, n) for at, e, n in placed if e is not None and n is not None]
    if len(known) < _FEW:
        return told
    shifts = np.array([(e, n) for _, e, n in known])
    away = np.hypot(*(shifts - np.median(shifts, axis=0)).T)
    usual = float(np.median(away))
    for (at, e, n), distance in zip(known, away.tolist(), strict=True):
        if distance > max(_UNUSUAL * usual, _LEAST_UNUSUAL):
            told[at] = (
                f"its shift, {e:+.1f} m east and {n:+.1f} m north, is {distance:.1f} m off that of the other plots, "
                f"which lie within {usual:.1f} m of theirs half of the time"
            )
    return told


def _named(names: Sequence[str]) -> str:
    shown = ", ".join(names[:3])
    return f"{shown} and {len(names) - 3} more" if len(names) > 3 else shown
