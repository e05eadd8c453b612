"""A loop of work like the service's, to measure a machine with: interpreter, JSON, SQLite, numpy, a triangulation.

A time relative to it says how much work something is, whichever machine did it and whatever else that machine did.
"""

import json
import sqlite3
import time
from typing import Final

import numpy as np
from scipy.spatial import Delaunay

_ROUNDS: Final = 4
_ROWS: Final = 200


class CalibrationLoop:
    """The loop, ready to be run."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self._points = rng.uniform(-50.0, 50.0, (100, 2))
        self._text = json.dumps({"xy": self._points.tolist()})
        self._database = sqlite3.connect(":memory:")
        self._database.execute("CREATE TABLE rows (key INTEGER PRIMARY KEY, content BLOB)")
        self._database.executemany("INSERT INTO rows VALUES (?, ?)", ((key, bytes(500)) for key in range(_ROWS)))

    def cpu_milliseconds(self) -> float:
        """Processor time of one pass, a few milliseconds."""
        began = time.thread_time()
        for number in range(_ROUNDS):
            self._pass(number)
        return 1e3 * (time.thread_time() - began)

    def _pass(self, number: int) -> float:
        sent = json.loads(self._text)
        names = {str(position): point for position, point in enumerate(sent["xy"])}
        total = sum(x * y for x, y in names.values())
        found = "SELECT key, content FROM rows WHERE key % 3 = ?"
        rows = self._database.execute(found, (number % 3,)).fetchall()
        triangles = Delaunay(self._points).simplices
        sides = np.hypot(*np.diff(self._points[triangles], axis=1).reshape(-1, 2).T)
        return float(total + len(json.dumps(names)) + len(rows) + np.sort(sides)[0])
