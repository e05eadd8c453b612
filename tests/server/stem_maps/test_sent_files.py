"""Files of trees that callers send: read, and stored as stands."""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl  # type: ignore[import-untyped]
import pytest

from server.checks.database import discrepancies
from server.errors import InvalidFile
from server.schemas.landmarks import StemMapOptions
from server.stem_maps.reader import read_stem_map
from server.stem_maps.reading.options import KEYS, ReadOptions
from server.stem_maps.uploads import UploadedFile, UploadReader
from tests.server.factories import Client
from tests.server.stem_maps.test_stands import stand_trees

READ = "/v1/stem-maps"
STAND = "/v1/collections/c/stands/north"
CUT: dict[str, Any] = {"file": "any.csv", "radius": 20, "spacing": 14}


def csv_of(trees: Any, header: str = "tag,x,y") -> bytes:
    rows = "".join(f"t{number},{x:.3f},{y:.3f}\n" for number, (x, y) in enumerate(trees.tolist()))
    return f"{header}\n{rows}".encode()


@pytest.fixture
def collection(client: Client) -> Client:
    client.put("/v1/collections/c", json={}).raise_for_status()
    return client


def test_the_options_are_those_of_the_command_but_for_a_file_of_centres() -> None:
    assert set(StemMapOptions.model_fields) == set(KEYS) - {"centres"}


def test_a_file_is_read_as_the_command_reads_it(client: Client, tmp_path: Path) -> None:
    rows = ["Plot;Baum;E;N;BHD (mm)"]
    rows += [f"{'AB'[n // 12]};{n % 12};{n * 3},5;{n % 5 * 4},25;{200 + n}" for n in range(24)]
    data = "\n".join(rows).encode("cp1252")
    (tmp_path / "season.csv").write_bytes(data)
    known = {"x": "E", "y": "N", "plot": "Plot", "unit": "m"}
    answer = client.post(READ, content=data, params={"file": "season.csv", **known})
    assert answer.status_code == 200, answer.text
    alone = read_stem_map(tmp_path / "season.csv", ReadOptions(**known))  # type: ignore[arg-type]
    assert answer.json()["understood"] == alone.understood
    assert [plot["name"] for plot in answer.json()["plots"]] == ["A", "B"]
    found = [(tree["x"], tree["y"], tree["dbh_cm"]) for plot in answer.json()["plots"] for tree in plot["landmarks"]]
    np.testing.assert_allclose(found, np.column_stack([alone.xy, alone.dbh_cm if alone.dbh_cm is not None else 0]))


def test_a_repeated_put_of_a_stand_undoes_nobodys_write(collection: Client) -> None:
    key = {"Idempotency-Key": "k"}
    trees = stand_trees()
    first = collection.put(STAND, content=csv_of(trees), params=CUT, headers=key)
    assert first.status_code == 201, first.text
    assert collection.put(STAND, content=csv_of(trees[:200]), params=CUT).status_code == 200
    stored = collection.get(STAND).json()
    again = collection.put(STAND, content=csv_of(trees), params=CUT, headers=key)
    assert (again.status_code, again.content, again.headers["ETag"]) == (201, first.content, first.headers["ETag"])
    assert again.headers["Idempotency-Replayed"] == "true"
    assert collection.get(STAND).json() == stored
    assert collection.put(STAND, content=csv_of(trees[:100]), params=CUT, headers=key).status_code == 422


def test_rows_at_fault_are_named(client: Client) -> None:
    answer = client.post(READ, content=b"tag,x,y\n1,2,3\n2,b,4\n3,5\n", params={"file": "plot.csv"})
    assert answer.status_code == 422
    assert answer.headers["Content-Type"] == "application/problem+json"
    body = answer.json()
    assert (body["type"], [row["line"] for row in body["errors"]]) == ("/problems/invalid-file", [3, 4])
    assert body["detail"].startswith("plot.csv:3: x: ")
    wrong: list[dict[str, Any]] = [{}, {"file": "a/b.csv"}, {"file": "../b.csv"}, {"file": "p.csv", "unit": "yd"}]
    wrong.append({"file": "p.csv", "why": 1})
    for params in wrong:
        assert client.post(READ, content=b"x,y\n1,2\n", params=params).status_code == 422, params
    assert client.post(READ, content=b"sidecars", params={"file": "p.shp"}).json()["detail"].endswith("GeoPackage.")


def test_files_of_many_formats_are_read_apart(tmp_path: Path) -> None:
    """One process reads the good file, refuses the bad ones, and survives them."""
    book = openpyxl.Workbook()
    for row in [("tag", "x", "y"), *((n, 4.0 * n, float(n % 7)) for n in range(20))]:
        book.active.append(row)
    book.save(tmp_path / "plot.xlsx")
    good = (tmp_path / "plot.xlsx").read_bytes()
    bomb = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(good)) as inside, zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as out:
        for name in inside.namelist():
            out.writestr(name, b"0" * 60_000_000 if "sheet1" in name else inside.read(name))
    locked = bytes.fromhex("d0cf11e0a1b11ae1") + bytes(4096)  # how a workbook with a password begins
    reader = UploadReader()
    try:
        for data in (good[: len(good) // 2], bomb.getvalue(), locked):
            with pytest.raises(InvalidFile, match=r"^plot\.xlsx: "):
                reader.read(UploadedFile("plot.xlsx", data, ReadOptions()))
        with pytest.raises(InvalidFile, match="GeoPackage"):
            reader.read(UploadedFile("plot.gpkg", b"SQLite format 3\0" + bytes(5000), ReadOptions()))
        assert len(reader.read(UploadedFile("plot.xlsx", good, ReadOptions()))) == 20
    finally:
        reader.close()


def test_a_stand_is_stored_replaced_and_found(service: Any, collection: Client) -> None:
    stored = collection.put(STAND, content=csv_of(stand_trees()), params=CUT)
    assert (stored.status_code, stored.json()["trees"]) == (201, 140)
    assert stored.headers["Location"] == STAND
    trees = stand_trees()
    near = trees[np.hypot(*(trees - (35.0, 15.0)).T) < 12.0].tolist()
    answer = collection.post("/v1/collections/c/queries", json={"xy": near}).json()
    assert answer["candidates"][0]["map_pose"]["frame_id"] == "north"
    again = collection.put(
        STAND, content=csv_of(stand_trees(100)), params=CUT, headers={"If-Match": stored.headers["ETag"]}
    )
    assert (again.status_code, again.json()["trees"]) == (200, 100)
    late = collection.put(
        STAND, content=csv_of(stand_trees()), params=CUT, headers={"If-Match": stored.headers["ETag"]}
    )
    assert late.status_code == 412
    assert [one["trees"] for one in collection.get("/v1/collections/c/stands").json()["stands"]] == [100]
    assert list(discrepancies(service.database)) == []


def test_a_stand_that_exists_is_cut_as_it_was(collection: Client) -> None:
    bare: dict[str, Any] = {"file": "any.csv"}
    cuts: dict[str, dict[str, Any]] = {"circles": {"radius": 20, "spacing": 14}, "whole": {"one_submap": True}}
    for name, cut in cuts.items():
        url = f"/v1/collections/c/stands/{name}"
        assert collection.put(url, content=csv_of(stand_trees()), params=bare).status_code == 422
        first = collection.put(url, content=csv_of(stand_trees()), params=bare | cut).json()
        again = collection.put(url, content=csv_of(stand_trees(120)), params=bare)
        assert (again.status_code, again.json()["trees"]) == (200, 120)
        assert (again.json()["submaps"] == 1) is (name == "whole")
        assert name == "whole" or again.json()["radius"] == first["radius"]
        part = collection.put(url, content=csv_of(stand_trees()), params=bare | {"radius": 20})
        assert (part.status_code, "spacing" in part.text) == (422, True)


@pytest.mark.parametrize(("header", "assumed"), [("azimuth", ["angle"]), ("azimuth_gon", [])])
def test_units_that_nobody_named_are_listed(collection: Client, header: str, assumed: list[str]) -> None:
    """A caller who asks with these trees knows what to name: azimuths in gon would put them elsewhere."""
    rng = np.random.default_rng(1)
    rows = [f"{n},{rng.uniform(0, 360):.1f},{rng.uniform(1, 15):.2f},{rng.uniform(10, 40):.1f}" for n in range(30)]
    data = "\n".join([f"tag,{header},distance_m,dbh", *rows]).encode()
    answer = collection.post(READ, content=data, params={"file": "polar.csv"})
    assert answer.json()["assumed"] == [*assumed, "dbh_unit"], answer.text
    stored = collection.put(STAND, content=data, params={"file": "polar.csv", "one_submap": True, "dbh_unit": "cm"})
    assert stored.json()["assumed"] == assumed, stored.text


def test_what_cannot_be_stored_changes_nothing(collection: Client) -> None:
    refused: list[tuple[dict[str, Any], str]] = [
        ({"file": "a.csv", "radius": 20}, "spacing"),
        ({"file": "a.csv", "radius": 20, "spacing": 14, "one_submap": True}, "leave out radius"),
        ({"file": "a.csv", "radius": 20, "spacing": 0.1}, "more than the 5000"),
        ({"file": "a.csv", "radius": 0.5, "spacing": 14}, "10 trees"),
    ]
    for params, said in refused:
        answer = collection.put(STAND, content=csv_of(stand_trees()), params=params)
        assert answer.status_code == 422, params
        assert said in answer.json()["detail"], answer.json()["detail"]
    assert collection.put("/v1/collections/z/stands/n", content=csv_of(stand_trees()), params=CUT).status_code == 404
    assert collection.get("/v1/collections/c/stands").json()["stands"] == []


def test_a_file_without_trees_is_refused_as_on_the_command_line(collection: Client) -> None:
    book, saved = openpyxl.Workbook(), io.BytesIO()
    for row in [("tag", "x", "y"), (None, None, None)]:
        book.active.append(row)
    book.save(saved)
    sent: list[tuple[bytes, dict[str, Any]]] = [
        (b"tag,x,y\n", {"file": "h.csv"}),
        (b"tag,x,y\n1,2,b\n", {"file": "h.csv", "skip_bad": True}),
        (saved.getvalue(), {"file": "h.xlsx"}),
    ]
    for content, params in sent:
        cuts: list[dict[str, Any]] = [{"radius": 30, "spacing": 20}, {"one_submap": True}]
        answers = [collection.put(STAND, content=content, params={**params, **cut}) for cut in cuts]
        for answer in [*answers, collection.post(READ, content=content, params=params)]:
            assert (answer.status_code, answer.json()["type"]) == (422, "/problems/invalid-file"), params
            assert answer.json()["detail"] == f"{params['file']}: the file has a header but no trees"


def test_answers_tell_what_was_understood_and_left_out(collection: Client) -> None:
    trees = stand_trees()
    rows = csv_of(np.vstack([trees, trees[:3] + 0.001])) + b"bad,x,1\n"
    counts = {"read": 144, "skipped": 1, "further_stems": 0, "merged": 3}
    read = collection.post(READ, content=rows, params={"file": "a.csv", "skip_bad": True}).json()
    params = {**CUT, "skip_bad": True}
    key = {"Idempotency-Key": "understood"}
    stored, again = (collection.put(STAND, content=rows, params=params, headers=key) for _ in range(2))
    assert again.content == stored.content
    assert len(read["plots"][0]["landmarks"]) == 140
    for answer in (read, stored.json()):
        assert answer["rows"] == counts
        assert "left out 1 rows that cannot be used" in answer["understood"]
        assert "3 trees merged with a thicker neighbour within 1 cm" in answer["understood"]
    assert "grid points skipped" in stored.json()["understood"]
    assert "understood" not in collection.get(STAND).json()
