"""A command line run in this process, and what it is given."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from urquhart import SE2

STEM_MAPS = Path(__file__).parents[3] / "data" / "stem_maps"
LONGLEAF = STEM_MAPS / "longleaf.csv"
POSE = SE2(103.0, 88.0, 2.1)
"""`map_T_observer` of the fixture `observation`."""


@dataclass(frozen=True, slots=True)
class Said:
    """What a command left: exit code, standard output, standard error."""

    code: int
    out: str
    err: str


Urquhart = Callable[..., Said]


def write_observation(path: Path, xy: NDArray[np.float64], dbh_cm: NDArray[np.float64] | None = None) -> Path:
    """Write trees (N, 2), metres, as CSV with the ids q0, q1, ..., and their diameters where they are given."""
    columns = xy if dbh_cm is None else np.column_stack([xy, dbh_cm])
    rows = "".join(f"q{i},{','.join(map(repr, row))}\n" for i, row in enumerate(columns.tolist()))
    path.write_text(f"tree_id,x_m,y_m{'' if dbh_cm is None else ',dbh_cm'}\n{rows}")
    return path


def refused(said: Said, *words: str) -> None:
    """The caller was told what is wrong in one line, and nothing else happened."""
    assert said.code == 2
    assert said.out == ""
    # Long work says how far it is, in lines of its own.
    lines = [line for line in said.err.splitlines() if not line.endswith(" left")]
    assert len(lines) == 1, said.err
    assert lines[0].startswith("urquhart: ")
    for word in words:
        assert word in said.err
