"""Candidates' submaps are read past the object layer, and as it reads them."""

from typing import Any

from server.collections import crud
from server.config.settings import Limits
from server.schemas.collections import CollectionPut
from server.schemas.submaps import SubmapInput
from server.store.sqlite.database import Database
from server.store.submap_records import FoundSubmap, SubmapContent
from server.submaps import writes
from tests.server.factories import forest, points


def test_what_is_found_is_what_is_stored(database: Database) -> None:
    for name in ("plots", "other"):
        crud.ensure(database, name, CollectionPut())
    pose = {"frame_id": "m", "x": 1.5, "y": -2.25, "yaw": 0.1}
    fields: list[dict[str, Any]] = [
        {},
        {"map_pose": pose, "stamp": "1969-05-04T11:30:00.25+02:00", "session": "s", "frame_id": "f"},
        {"map_pose": pose | {"covariance": [0.1, 0, 0, 0, 0.1, 0, 0, 0, 1e-3]}, "ids": [f"n{i}" for i in range(60)]},
    ]
    for seed, more in enumerate(fields):
        body = SubmapInput.model_validate({"xy": points(forest(seed)), **more})
        for name in ("plots", "other"):
            writes.put(database, name, f"p{seed}", body, Limits())
    with database.read() as tx:
        key = crud.get_collection(tx, "plots").key
        submaps = tx.submaps(key)
        rows = [row for row in (submaps.get(f"p{seed}", SubmapContent) for seed in range(3)) if row is not None]
        assert len(rows) == 3
        keys = [*range(10_000)]
        for landmarks in (True, False):
            found = tx.candidates(key).read(keys, landmarks=landmarks)
            assert found == {
                row.key: FoundSubmap(
                    row.key,
                    row.id,
                    row.session,
                    row.stamp,
                    row.frame_id,
                    row.landmark_count,
                    row.content_revision,
                    row.landmark_ids,
                    row.place,
                    row.landmarks if landmarks else b"",
                )
                for row in rows
            }
        assert tx.candidates(key).read([], landmarks=True) == {}
