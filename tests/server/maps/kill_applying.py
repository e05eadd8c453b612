"""A process that is killed while it writes the poses of a map, at each statement and about each commit.

`Forked("tests.server.maps.kill_applying", [FOLDER])` prints a line of JSON for each point: before what it was killed,
the revision, and the number of submaps that have their new pose.
"""

import itertools
import shutil
import sys
from functools import partial
from pathlib import Path

import numpy as np
import orjson
from sqlalchemy.engine.default import DefaultDialect

from server.collections.crud import ensure, get_collection
from server.config.settings import Limits
from server.maps.applying import NewPose, write_poses
from server.schemas.collections import CollectionPut
from server.schemas.poses import MapPose
from server.schemas.submaps import SubmapInput
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.store.submap_records import SubmapMetadata
from server.submaps import writes
from tests.server.killed_process import KillPoints, in_a_process

NAMES = [f"s{number}" for number in range(20)]


def main(folder: Path) -> None:
    """Kill at every point, each on another copy of the database."""
    folder.mkdir()
    base = folder / "base"
    base.mkdir()
    in_a_process(partial(_prepare, base / "killed.db"))
    for point in itertools.count(1):
        copy = shutil.copytree(base, folder / f"point-{point}")
        killed = in_a_process(partial(_apply, copy / "killed.db", point, copy / "point"))
        in_a_process(partial(_tell, copy / "killed.db", (copy / "point").read_text() if killed else "done"))
        if not killed:
            return


def _prepare(path: Path) -> None:
    database = Database(path)
    migrations_runner.upgrade(database)
    ensure(database, "drives", CollectionPut())
    xy = np.random.default_rng(0).uniform(0.0, 20.0, (12, 2)).tolist()
    for name in NAMES:
        writes.put(database, "drives", name, SubmapInput.model_validate({"xy": xy}), Limits())
    database.dispose()


def _apply(path: Path, point: int, note: Path) -> None:
    points, database = KillPoints(point, note.write_text), Database(path)
    with database.read() as tx:
        collection = get_collection(tx, "drives")
        keys = list(tx.submaps(collection.key).keys(NAMES).values())
        rows = tx.submaps(collection.key).some(keys, SubmapMetadata)
    for name in ("do_execute", "do_executemany", "do_commit"):
        setattr(DefaultDialect, name, points.around(getattr(DefaultDialect, name)))
    moves = {
        row.id: NewPose(MapPose(frame_id="site", x=float(number), y=0.0, yaw=0.0), row.content_revision)
        for number, row in enumerate(rows)
    }
    with database.write() as tx:
        write_poses(tx, get_collection(tx, "drives"), moves)


def _tell(path: Path, kind: str) -> None:
    database = Database(path)
    with database.read() as tx:
        collection = get_collection(tx, "drives")
        rows = tx.submaps(collection.key).some(list(tx.submaps(collection.key).keys(NAMES).values()), SubmapMetadata)
        placed = sum(row.place is not None and row.place.map_frame_id == "site" for row in rows)
    print(orjson.dumps([kind, collection.revision, placed]).decode())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
