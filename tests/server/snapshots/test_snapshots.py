"""Snapshots over HTTP: consistent, proven, one at a time, for those who may see everything."""

import errno
import hashlib
import json
import re
import shutil
import sqlite3
import threading
from collections import namedtuple
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from server.app import create_app
from server.collections import crud
from server.config.settings import Limits, Settings
from server.config.settings_groups import SnapshotSettings
from server.errors import StorageFull
from server.schemas.collections import CollectionPut
from server.schemas.submaps import SubmapInput
from server.security import api_keys
from server.security.authenticator import Authenticator
from server.security.principal import Scope
from server.service_parts import Service
from server.snapshots import restoring, snapshot_folder, snapshots
from server.snapshots.snapshot_folder import SnapshotFolder
from server.store.sqlite import database as store_database
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps import writes
from tests.server.factories import TestClient, forest, points, put_submap
from tests.server.processes import Server
from tests.server.steps import killed_at_every_step

FILE = {"Accept": "application/vnd.sqlite3"}
AT = "/v1/snapshots"


def taken(client: httpx.Client, **body: Any) -> dict[str, Any]:
    """A snapshot, made."""
    response = client.post(AT, json=body)
    assert response.status_code == 201, response.text
    document: dict[str, Any] = response.json()
    return document


def left(service: Service) -> list[str]:
    """Names of the files beside the lock."""
    folder = service.snapshots.path
    return sorted(path.name for path in folder.iterdir() if path.name != "snapshot.lock") if folder.is_dir() else []


# ------------------------------------------------------------------ journeys


def test_made_read_downloaded_deleted(client: httpx.Client, service: Service, tmp_path: Path) -> None:
    put_submap(client, "plots", "p7", 1).raise_for_status()
    response = client.post(AT, json={"name": "first"})
    assert (response.status_code, response.headers["Location"]) == (201, f"{AT}/first")
    made = response.json()
    assert set(made) == {"name", "created", "bytes", "sha256", "schema", "version", "collections"}
    assert made["collections"] == [{"id": "plots", "revision": 1, "submaps": 1}]
    assert made["schema"] == client.get("/v1/limits").json()["versions"]["schema"]
    read = client.get(f"{AT}/first")
    assert read.json() == made == client.get(AT).json()["snapshots"][0]
    assert client.get(f"{AT}/first", headers={"If-None-Match": read.headers["ETag"]}).status_code == 304
    file = client.get(f"{AT}/first", headers=FILE)
    assert file.headers["Content-Type"] == "application/vnd.sqlite3"
    assert file.headers["ETag"] == f'"{made["sha256"]}"' != read.headers["ETag"]
    assert hashlib.sha256(file.content).hexdigest() == made["sha256"]
    assert len(file.content) == made["bytes"] == int(file.headers["Content-Length"])
    (tmp_path / "copy.db").write_bytes(file.content)
    with closing(sqlite3.connect(tmp_path / "copy.db")) as copy:
        assert copy.execute("SELECT id FROM submaps").fetchall() == [("p7",)]
        assert copy.execute("PRAGMA journal_mode").fetchone() == ("delete",)
    assert left(service) == ["first.db", "first.json"]
    assert client.delete(f"{AT}/first").status_code == 204
    assert left(service) == []
    assert client.get(AT).json() == {"snapshots": []}
    for again in (client.get(f"{AT}/first"), client.delete(f"{AT}/first")):
        assert (again.status_code, again.json()["type"]) == (404, "/problems/not-found")


def test_a_download_goes_on_where_it_broke_off(client: httpx.Client) -> None:
    made = taken(client, name="long")
    whole = client.get(f"{AT}/long", headers=FILE).content
    half = len(whole) // 2
    rest = client.get(f"{AT}/long", headers=FILE | {"Range": f"bytes={half}-", "If-Range": f'"{made["sha256"]}"'})
    assert (rest.status_code, rest.content) == (206, whole[half:])
    other = client.get(f"{AT}/long", headers=FILE | {"Range": f"bytes={half}-", "If-Range": '"another"'})
    assert (other.status_code, other.content) == (200, whole)
    beyond = client.get(f"{AT}/long", headers=FILE | {"Range": f"bytes={len(whole)}-"})
    assert (beyond.status_code, beyond.headers["Content-Type"]) == (416, "application/problem+json")
    assert client.get(f"{AT}/long", headers=FILE | {"Range": "bytes=x"}).headers["Content-Type"].endswith("json")
    assert client.get(f"{AT}/long", headers=FILE | {"If-None-Match": f'"{made["sha256"]}"'}).status_code == 304
    assert client.get(f"{AT}/long", headers={"Accept": "image/png"}).status_code == 406


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../up", "a/b", "/etc/passwd", "a\\b", "a\0b", "a b", "x" * 129, "\u6797" * 128, 7]
)
def test_names_that_cannot_be(client: httpx.Client, service: Service, name: Any) -> None:
    response = client.post(AT, json={"name": name})
    assert response.status_code == 422, response.text
    assert left(service) == []


@pytest.mark.parametrize("name", ["..%2Furquhart", "%2e%2e", "..%2F..%2Fetc%2Fpasswd", "making", "snapshot.lock"])
def test_no_path_leads_out_of_the_folder(client: httpx.Client, name: str) -> None:
    taken(client, name="there")
    for method in ("GET", "DELETE"):
        assert client.request(method, f"{AT}/{name}", headers=FILE).status_code in {404, 405, 422}
    assert client.get("/v1/collections/plots").status_code == 200
    assert len(client.get(AT).json()["snapshots"]) == 1


def test_a_name_is_taken_once_and_made_up_where_none_is_given(client: httpx.Client) -> None:
    taken(client, name="Fr\u00fchling")
    again = client.post(AT, json={"name": "Fr\u00fchling"})
    assert (again.status_code, again.json()["type"]) == (409, "/problems/conflict")
    assert re.fullmatch(r"\d{8}T\d{6}\.\d{6}Z", taken(client)["name"])
    assert client.post(AT, json={"colour": "green"}).status_code == 422


def test_pages(client: httpx.Client) -> None:
    names = [taken(client, name=name)["name"] for name in ("c", "a", "d", "b")]
    seen, cursor = [], None
    while True:
        response = client.get(AT, params={"limit": 3} | ({"cursor": cursor} if cursor else {}))
        seen += [snapshot["name"] for snapshot in response.json()["snapshots"]]
        cursor = response.json().get("next")
        if cursor is None:
            break
        assert f"cursor={cursor}" in response.headers["Link"]
    assert seen == names
    assert client.get(AT, params={"cursor": "x"}).status_code == 422


def test_the_last_ones_are_kept(tmp_path: Path) -> None:
    settings = Settings(database=str(tmp_path / "few.db"), snapshots=SnapshotSettings(keep=2))
    with TestClient(create_app(settings)) as client:
        for name in ("z", "y", "x"):
            taken(client, name=name)
        assert [snapshot["name"] for snapshot in client.get(AT).json()["snapshots"]] == ["y", "x"]
    assert not (tmp_path / "few.db.snapshots" / "z.db").exists()
    everything = Settings(database=str(tmp_path / "few.db"), snapshots=SnapshotSettings(keep=0))
    with TestClient(create_app(everything)) as client:
        for name in ("1", "2", "3"):
            taken(client, name=name)
        assert len(client.get(AT).json()["snapshots"]) == 5


def test_sent_again_it_is_not_made_again(client: httpx.Client) -> None:
    headers = {"Idempotency-Key": "once"}
    first, again = (client.post(AT, json={}, headers=headers) for _ in range(2))
    assert (first.status_code, again.status_code) == (201, 201)
    assert again.json() == first.json()
    assert again.headers["Idempotency-Replayed"] == "true"
    assert again.headers["Location"] == first.headers["Location"]
    assert len(client.get(AT).json()["snapshots"]) == 1
    assert client.post(AT, json={"name": "b"}, headers=headers).status_code == 422


def test_only_for_keys_that_see_everything(client: httpx.Client, app: FastAPI, service: Service) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    ring = service.database
    made = {
        name: api_keys.make(ring, name, scopes, patterns)[0]
        for name, scopes, patterns in (
            ("owner", list(Scope), ["*"]),
            ("bound", list(Scope), ["plots"]),
            ("wide", list(Scope), ["**"]),
            ("writer", [Scope.READ, Scope.WRITE], ["*"]),
        )
    }
    app.state.authenticator = Authenticator(service.settings, ring)

    def status(who: str, method: str, path: str, **body: Any) -> int:
        headers = {"Authorization": f"Bearer {made[who]}"} if who else {}
        return client.request(method, path, headers=headers, **body).status_code

    assert status("owner", "POST", AT, json={"name": "all"}) == 201
    for who, refused in (("", 401), ("bound", 403), ("wide", 403), ("writer", 403)):
        assert status(who, "POST", AT, json={"name": "mine"}) == refused
        assert status(who, "GET", AT) == refused
        assert status(who, "GET", f"{AT}/all") == refused
        assert status(who, "GET", f"{AT}/nothing") == refused
        assert status(who, "DELETE", f"{AT}/all") == refused
    assert [snapshot.name for snapshot in service.snapshots.all()] == ["all"]
    content = service.snapshots.file("all").read_bytes()
    assert not [secret for secret in made.values() if secret.rsplit("_", 1)[1].encode() in content]
    assert hashlib.sha256(made["owner"].rsplit("_", 1)[1].encode()).digest() in content


def test_a_database_that_is_only_read(client: httpx.Client, settings: Settings) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    read_only = Settings(database=f"sqlite:///{settings.database_path}?mode=ro")
    with TestClient(create_app(read_only)) as reader:
        assert taken(reader, name="ro")["collections"] == [{"id": "plots", "revision": 1, "submaps": 1}]
        refused = reader.post(AT, json={}, headers={"Idempotency-Key": "k"})
        assert (refused.status_code, refused.json()["type"]) == (503, "/problems/storage-read-only")
        assert len(reader.get(AT).json()["snapshots"]) == 1


def test_the_copy_is_as_private_as_the_database(client: httpx.Client, service: Service) -> None:
    service.database.path.chmod(0o600)
    taken(client, name="private")
    assert service.snapshots.file("private").stat().st_mode & 0o777 == 0o600


# ------------------------------------------------------------ one at a time


def test_one_at_a_time(client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    with SnapshotFolder(service.database.path).turn():  # as another process would
        busy = client.post(AT, json={"name": "second"})
        assert (busy.status_code, busy.json()["type"]) == (409, "/problems/conflict")
        service.snapshots.clean_up()
        assert left(service) == ["making"]  # not removed: somebody is at it
    taken(client, name="second")


def test_what_killed_processes_left_is_removed(client: httpx.Client, service: Service, settings: Settings) -> None:
    taken(client, name="good")

    def litter() -> None:
        shutil.copytree(service.snapshots.path, service.snapshots.making)
        shutil.copy(service.snapshots.file("good"), service.snapshots.file("nameless"))

    litter()
    assert client.get(f"{AT}/nameless").status_code == 404
    assert len(client.get(AT).json()["snapshots"]) == 1
    taken(client, name="next")
    kept = ["good.db", "good.json", "next.db", "next.json"]
    assert left(service) == kept
    litter()
    with TestClient(create_app(settings)):
        assert left(service) == kept


def test_a_manifest_that_cannot_be_read_is_left_alone(client: httpx.Client, service: Service) -> None:
    for name in ("a", "b", "c", "d"):
        taken(client, name=name)
    service.snapshots.manifest("a").write_text("{")
    service.snapshots.manifest("b").rename(service.snapshots.manifest("e"))
    service.snapshots.file("c").unlink()
    assert [snapshot["name"] for snapshot in client.get(AT).json()["snapshots"]] == ["d"]
    assert [client.get(f"{AT}/{name}", headers=FILE).status_code for name in "abcde"] == [404, 404, 404, 200, 404]
    taken(client, name="f")
    assert service.snapshots.file("a").exists()


# ------------------------------------------------------------------ failure


def no_room(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def full_copy(monkeypatch: pytest.MonkeyPatch) -> None:
    begin = store_database._new_file

    def small(path: Path) -> sqlite3.Connection:
        connection = begin(path)
        connection.execute("PRAGMA max_page_count = 20")
        return connection

    monkeypatch.setattr(store_database, "_new_file", small)


def full_manifest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(snapshot_folder, "sync", no_room)


def full_sync(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(snapshots, "sync", no_room)


def little_room(monkeypatch: pytest.MonkeyPatch) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage(10**9, 10**9 - 10_000, 10_000))


@pytest.mark.parametrize("full", [full_copy, full_manifest, full_sync, little_room])
def test_a_full_disk_leaves_nothing_behind(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch, full: Callable[[pytest.MonkeyPatch], None]
) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    taken(client, name="before")
    with monkeypatch.context() as patch:
        full(patch)
        response = client.post(AT, json={"name": "full"})
    assert (response.status_code, response.json()["type"]) == (507, "/problems/storage-full")
    assert left(service) == ["before.db", "before.json"]
    put_submap(client, "plots", "p2", 2).raise_for_status()
    taken(client, name="full")


def test_a_folder_that_cannot_be_made(client: httpx.Client, service: Service) -> None:
    service.snapshots.path.write_text("a file in the place of the folder")
    assert client.post(AT, json={}).status_code == 503
    assert client.get(AT).json() == {"snapshots": []}


def test_a_damaged_database_makes_no_snapshot(client: httpx.Client, service: Service) -> None:
    for seed in range(3):
        put_submap(client, "plots", f"p{seed}", seed).raise_for_status()
    copy_to = Database.copy_to

    def damaged(self: Database, target: Path, *, between: Callable[[], None]) -> None:
        copy_to(self, target, between=between)
        content = bytearray(target.read_bytes())
        with closing(sqlite3.connect(target)) as connection:
            query = "SELECT rootpage FROM sqlite_master WHERE name = 'submaps'"
            page, size = connection.execute(query).fetchone()[0], connection.execute("PRAGMA page_size").fetchone()[0]
        content[(page - 1) * size : page * size] = b"\xff" * size
        target.write_bytes(content)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Database, "copy_to", damaged)
        response = client.post(AT, json={})
    assert (response.status_code, response.json()["type"]) == (500, "/problems/storage-damaged")
    assert left(service) == []


def test_killed_at_any_step(tmp_path: Path) -> None:
    database = Database(tmp_path / "killed.db")
    store_database_with(database, range(3))
    database.dispose()
    folder = SnapshotFolder(database.path)

    def make() -> None:
        store = Database(database.path)
        snapshots.make(store, SnapshotFolder(store.path), "new", 2)
        store.dispose()

    make()
    folder.remove("new")
    seen = set()
    for _ in killed_at_every_step(make):
        names = [snapshot.name for snapshot in folder.all()]
        for name in names:
            restoring.verify(restoring.find(database.path, name))
        folder.clean_up()
        there = {path.name for path in folder.path.iterdir()} - {"snapshot.lock"}
        assert there == {f"{name}.{ending}" for name in names for ending in ("db", "json")}
        seen.add(tuple(names))
        if names:
            folder.remove("new")
    assert seen == {(), ("new",)}


def store_database_with(database: Database, seeds: range) -> None:
    """Forests under their seeds in the collection `plots`."""
    migrations_runner.upgrade(database)
    crud.ensure(database, "plots", CollectionPut())
    for seed in seeds:
        body = SubmapInput.model_validate({"xy": points(forest(seed, count=30, radius=25.0))})
        writes.put(database, "plots", f"p{seed}", body, Limits())


def test_no_room_is_told_by_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = Database(tmp_path / "small.db")
    store_database_with(database, range(1))
    little_room(monkeypatch)
    with pytest.raises(StorageFull, match="10,000 are free"):
        snapshots.make(database, SnapshotFolder(database.path), None, 5)
    database.dispose()


# ------------------------------------------------------------- under writes


def test_every_acknowledged_write_is_in_it(serve: Callable[..., Server], tmp_path: Path) -> None:
    server = serve(tmp_path / "urquhart.db", URQUHART_SNAPSHOTS__KEEP="0")
    server.client.put("/v1/collections/plots", json={}).raise_for_status()
    acknowledged: list[str] = []
    stop = threading.Event()

    def write(first: int) -> None:
        with httpx.Client(base_url=server.client.base_url, timeout=60.0) as client:
            for seed in range(first, 100_000, 2):
                if stop.is_set():
                    return
                put_submap(client, "plots", f"p{seed}", seed).raise_for_status()
                acknowledged.append(f"p{seed}")

    writers = [threading.Thread(target=write, args=(first,)) for first in range(2)]
    for writer in writers:
        writer.start()
    try:
        for number in range(4):
            while len(acknowledged) < 10 * (number + 1):
                assert any(writer.is_alive() for writer in writers)
                threading.Event().wait(0.01)
            before = set(acknowledged)
            made = taken(server.client, name=f"s{number}")
            file = server.client.get(f"{AT}/s{number}", headers=FILE).content
            copy = tmp_path / f"copy{number}.db"
            copy.write_bytes(file)
            with closing(sqlite3.connect(copy)) as connection:
                held = {name for (name,) in connection.execute("SELECT id FROM submaps")}
                revision, submaps = connection.execute("SELECT revision, submap_count FROM collections").fetchone()
                assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            assert before <= held
            assert made["collections"] == [{"id": "plots", "revision": revision, "submaps": submaps}]
            assert submaps == len(held) == revision
    finally:
        stop.set()
        for writer in writers:
            writer.join()
    assert json.loads((tmp_path / "urquhart.db.snapshots" / "s3.json").read_text())["name"] == "s3"
