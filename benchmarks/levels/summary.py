"""From the rows of many questions to figures: what each level adds and costs."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.levels.asking import NAMES, SPARED


def summarize(rows: NDArray[Any]) -> dict[str, Any]:
    """Figures of one world from rows (Q,) of `asking.ROW`: of all, and of each level that ran."""
    stored = rows["stored"]
    return {
        "stored": int(stored.sum()),
        "elsewhere": int((~stored).sum()),
        "right": int(rows["right"][:, -1].sum()),
        "wrong": int((rows["mistaken"][:, -1] & stored).sum()),
        "false": int((rows["mistaken"][:, -1] & ~stored).sum()),
        "milliseconds": _mean(rows["milliseconds"].sum(axis=1)[stored]),
        "milliseconds_elsewhere": _mean(rows["milliseconds"].sum(axis=1)[~stored]),
        "levels": {name: level(rows, number) for number, name in enumerate(NAMES) if rows["ran"][:, number].any()},
    }


def level(rows: NDArray[Any], number: int) -> dict[str, Any]:
    """Figures of one level.

    `ran`, `ran_elsewhere`: questions whose search reached it, about places that are stored and about others.
    `answered`: right answers whose search ended with it. `added`, `removed`: answers that were not right before it and
    are after it, and the reverse. `mistaken`: `matched` after it, not right, and not so before it.
    `milliseconds`, `milliseconds_elsewhere`: medians where it ran. `each`, `each_elsewhere`: means over all questions.
    `missed_without`, `gained_without`, `mistaken_without`: what changes in the last answers when it alone is left out;
    None where later levels build on it.
    """
    stored, ran, right, mistaken = rows["stored"], rows["ran"][:, number], rows["right"], rows["mistaken"]
    last = ran & ~rows["ran"][:, number + 1 :].any(axis=1)
    before = right[:, number - 1] if number else np.zeros(len(rows), np.bool_)
    mistaken_before = mistaken[:, number - 1] if number else np.zeros(len(rows), np.bool_)
    spent, final, without = rows["milliseconds"][:, number], right[:, -1], rows["right_without"][:, number]
    figures: dict[str, Any] = {
        "ran": int((ran & stored).sum()),
        "ran_elsewhere": int((ran & ~stored).sum()),
        "answered": int((last & final).sum()),
        "added": int((right[:, number] & ~before).sum()),
        "removed": int((before & ~right[:, number]).sum()),
        "mistaken": int((mistaken[:, number] & ~mistaken_before).sum()),
        "milliseconds": _median(spent[ran & stored]),
        "milliseconds_elsewhere": _median(spent[ran & ~stored]),
        "each": _mean(spent[stored]),
        "each_elsewhere": _mean(spent[~stored]),
    }
    spared = NAMES[number] in SPARED
    new = rows["mistaken_without"][:, number] & ~mistaken[:, -1]
    return figures | {
        "missed_without": int((final & ~without).sum()) if spared else None,
        "gained_without": int((without & ~final).sum()) if spared else None,
        "mistaken_without": int(new.sum()) if spared else None,
    }


def _median(values: NDArray[np.float32]) -> float | None:
    return float(np.median(values)) if len(values) else None


def _mean(values: NDArray[np.float32]) -> float | None:
    return float(values.mean()) if len(values) else None
