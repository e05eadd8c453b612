"""Stands through the client."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

from server.config.settings import Limits
from server.stem_maps.reader import StemMap
from server.stem_maps.stands import cut_stand, store_stand
from server.store.sqlite.database import Database
from urquhart_client import AsyncClient, Client, ProblemError


def store(path: Path, name: str, count: int) -> None:
    """Store random trees as `urquhart index` does beside a running service."""
    xy = np.random.default_rng(count).uniform(0.0, 50.0, (count, 2))
    stem_map = StemMap(name, tuple(map(str, range(count))), xy)
    database = Database(path)
    store_stand(database, "plots", stem_map, cut_stand(stem_map, 20.0, 15.0, Limits()))
    database.dispose()


def test_they_are_listed_read_and_deleted(client: Client, tmp_path: Path) -> None:
    client.put_collection("plots")
    for name, count in (("north", 90), ("south", 60)):
        store(tmp_path / "client.db", name, count)
    assert [(one.name, one.trees) for one in client.stands("plots", page_size=1)] == [("north", 90), ("south", 60)]
    north = client.get_stand("plots", "north")
    assert north.source_crs is north.crs is None
    assert (north.frame_id, north.radius, north.spacing) == ("north", 20.0, 15.0)
    assert north.submaps + client.get_stand("plots", "south").submaps == len(list(client.submaps("plots")))
    store(tmp_path / "client.db", "north", 91)
    with pytest.raises(ProblemError) as refused:
        client.delete_stand("plots", "north", if_match=north.etag)
    assert refused.value.status == 412
    client.delete_stand("plots", "north", if_match=client.get_stand("plots", "north").etag)
    assert [one.name for one in client.stands("plots")] == ["south"]
    with pytest.raises(ProblemError) as missing:
        client.get_stand("plots", "north")
    assert missing.value.status == 404
    if client.base_url.startswith("http://127.0.0.1"):
        asyncio.run(_awaited(client.base_url))


def test_a_file_is_read_and_stored_by_the_service(client: Client, tmp_path: Path) -> None:
    client.put_collection("plots")
    xy = np.random.default_rng(9).uniform(0.0, 50.0, (90, 2)).round(2)
    file = tmp_path / "north.csv"
    file.write_text("baum;e;n\n" + "".join(f"{n};{x};{y}\n" for n, (x, y) in enumerate(xy.tolist())))
    read = client.read_stem_map(file, x="e", y="n")
    assert [(tree["x"], tree["y"]) for tree in read.plots[0].landmarks] == [tuple(row) for row in xy.tolist()]
    stored = client.put_stand("plots", "north", file, cut={"radius": 20, "spacing": 15}, x="e", y="n")
    assert stored.understood.startswith(read.understood)
    assert (stored.rows.read, stored.rows.skipped, read.rows.merged) == (90, 0, 0)
    assert (stored.trees, stored.submaps) == (90, len(list(client.submaps("plots"))))
    near = [tree for tree in read.plots[0].landmarks if abs(tree["x"] - 25.0) < 12.0 and abs(tree["y"] - 25.0) < 12.0]
    assert client.query("plots", landmarks=near).verdict == "matched"
    file.write_text("x;y\n1;2\n3;b\n")
    with pytest.raises(ProblemError) as refused:
        client.put_stand("plots", "north", file, cut={"one_submap": True}, if_match=stored.etag)
    assert (refused.value.status, "north.csv:3" in str(refused.value)) == (422, True)


def test_a_stand_is_moved_through_the_client(client: Client, tmp_path: Path) -> None:
    client.put_collection("plots")
    store(tmp_path / "client.db", "north", 90)
    before = client.get_stand("plots", "north")
    moved = client.move_stand("plots", "north", shift=(10.0, -5.0), yaw=0.5, about=(1.0, 2.0), if_match=before.etag)
    assert moved.etag != before.etag and moved.submaps == before.submaps
    assert {one.map_pose.yaw for one in client.submaps("plots") if one.map_pose is not None} == {0.5}
    with pytest.raises(ProblemError) as refused:
        client.move_stand("plots", "north", shift=(1.0, 0.0), if_match=before.etag)
    assert refused.value.status == 412
    with pytest.raises(ProblemError) as missing:
        client.move_stand("plots", "south", shift=(1.0, 0.0))
    assert missing.value.status == 404
    name = next(iter(client.submaps("plots"))).id
    client.patch_submap("plots", name, map_pose={"frame_id": "other", "x": 0.0, "y": 0.0, "yaw": 0.0})
    with pytest.raises(ProblemError) as apart:
        client.move_stand("plots", "north", shift=(1.0, 0.0))
    assert (apart.value.status, "2 map frames" in str(apart.value)) == (409, True)


async def _awaited(url: str) -> None:
    async with AsyncClient(url) as client:
        assert [one.name async for one in client.stands("plots")] == ["south"]
        assert (await client.get_stand("plots", "south")).trees == 60
        await client.delete_stand("plots", "south")
        assert [one async for one in client.stands("plots")] == []
