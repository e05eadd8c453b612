"""Two drives through one forest, each submap in a frame of its own, and one submap of another place."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from server.collections.crud import ensure
from server.config.settings import Limits
from server.schemas.collections import CollectionPut
from server.schemas.submaps import SubmapInput
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from server.submaps import writes
from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, observe, paper_forest

TREES = paper_forest(np.random.default_rng(0), 150.0)
DRIVES = {"mon": (np.linspace(40.0, 110.0, 6), 70.0), "tue": (np.linspace(110.0, 45.0, 5), 78.0)}


def store_drives(database: Database) -> dict[str, SE2]:
    """Store them in the collection `drives`; world_T_submap of each."""
    rng, truth = np.random.default_rng(1), {}
    ensure(database, "drives", CollectionPut())
    for session, (xs, y) in DRIVES.items():
        for number, x in enumerate(xs.tolist()):
            pose = SE2(x, y, float(rng.uniform(-3.0, 3.0)))
            seen = observe(TREES, pose, Sensor(30.0, sigma=0.05, detection=0.95), rng)
            name, diameters = f"{session}-{number}", 20.0 + seen.trees % 30
            landmarks = [
                {"id": str(i), "x": x, "y": y, "dbh_cm": dbh}
                for i, ((x, y), dbh) in enumerate(zip(seen.xy.tolist(), diameters.tolist(), strict=True))
            ]
            stamp = f"2026-05-0{4 if session == 'mon' else 5}T09:0{number}:00Z"
            body = SubmapInput.model_validate({"landmarks": landmarks, "session": session, "stamp": stamp})
            writes.put(database, "drives", name, body, Limits())
            truth[name] = pose
    elsewhere = np.random.default_rng(9).uniform(0.0, 50.0, (60, 2)).tolist()
    writes.put(database, "drives", "elsewhere", SubmapInput.model_validate({"xy": elsewhere}), Limits())
    return truth


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    store = Database(tmp_path / "urquhart.db")
    bring_up_to_date(store)
    yield store
    store.dispose()
