"""A season over REST: the same answers as `urquhart coregister` gives, whatever is sent and whatever is killed."""

import io
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import httpx
import numpy as np
import orjson
import pytest
from fastapi import FastAPI

from server.app import create_app
from server.cli import run
from server.config.settings import Limits, Settings
from server.coregistration.journal import JOURNAL
from server.errors import NotFound
from server.jobs import job_files
from server.jobs.folder import JobFolder
from server.schemas.files.coregistrations import PlotRow
from server.security.principal import UNRESTRICTED
from server.service_parts import Service
from tests.server.commands.cli_helpers import LONGLEAF
from tests.server.commands.test_cli_coregister import CENTRES, season_csv, seen_from
from tests.server.factories import TestClient
from tests.server.jobs.test_jobs import finished
from tests.server.processes import Server

URL = "/v1/collections/stand/coregistrations"
pytestmark = pytest.mark.usefixtures("forked_workers")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with longleaf, 40 m discs, in `stand.db`."""
    made = tmp_path_factory.mktemp("season")
    options = ["--collection", "stand", "--radius", "40", "--spacing", "40", "--database", str(made / "stand.db")]
    assert run(["index", str(LONGLEAF), *options]) == 0
    return made


@pytest.fixture(scope="module")
def served(folder: Path) -> Iterator[TestClient]:
    """A service over it."""
    limits = Limits(query_seconds=600, import_bytes=2_000_000)
    with TestClient(create_app(Settings(database=str(folder / "stand.db"), limits=limits))) as client:
        yield client


def packed(files: dict[str, bytes]) -> bytes:
    """A zip archive of files by their names."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as out:
        for name, content in files.items():
            out.writestr(name, content)
    return archive.getvalue()


def local_plots() -> dict[str, bytes]:
    """Files of plots about a point 0, 0 of their own, and a table of where those are."""
    files, positions = {}, "plot,x,y\n"
    for name, centre in CENTRES.items():
        ids, xy = seen_from(centre)
        rows = "".join(f"{tag},{x:.3f},{y:.3f}\n" for tag, (x, y) in zip(ids, (xy - centre).tolist(), strict=True))
        files[f"2026/{name}.csv"] = f"tag,x,y\n{rows}".encode()
        positions += f"{name},{centre[0]},{centre[1]}\n"
    return files | {"2026/gnss.csv": positions.encode()}


def rows_of(client: httpx.Client, job: dict[str, Any]) -> list[PlotRow]:
    content = client.get(job["links"]["results"]).content
    return [PlotRow.model_validate_json(line) for line in content.splitlines()]


def files_of(client: httpx.Client, job: dict[str, Any]) -> dict[str, bytes]:
    """All files of a job, as they are downloaded."""
    listed = client.get(job["links"]["files"]).json()["files"]
    found = {}
    for one in listed:
        answer = client.get(one["href"])
        assert (answer.status_code, len(answer.content)) == (200, one["bytes"])
        assert answer.headers["Content-Type"] == one["media_type"]
        assert answer.headers["Content-Disposition"].startswith("attachment")
        found[one["name"]] = answer.content
    return found


def test_both_doors_give_the_same(
    served: TestClient, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = season_csv(tmp_path / "season.csv")
    sent = served.post(URL, params={"file": "season.csv", "effort": "fast"}, content=path.read_bytes())
    job = finished(served, sent)
    assert (job["state"], job["total"], job["done"]) == ("successful", 5, 5), job
    assert job["counts"] == {"matched": 3, "no_match": 1, "not_read": 1}
    there = files_of(served, job)
    monkeypatch.chdir(tmp_path)
    where = ["--collection", "stand", "--database", str(folder / "stand.db"), "--out", "out", "--effort", "fast"]
    assert run(["coregister", "season.csv", *where]) == 2
    here = {one.relative_to("out").as_posix(): one.read_bytes() for one in Path("out").rglob("*") if one.is_file()}
    assert here.keys() == there.keys()
    same = {name for name in here if here[name] == there[name]}
    # GeoPackages have the time in them, the report too, and the journal how long each search took.
    assert here.keys() - same <= {"plots.gpkg", "trees.gpkg", "report.html", JOURNAL}
    assert not {name for name, content in there.items() if str(folder).encode() in content}
    rows = rows_of(served, job)
    assert [row.verdict for row in rows] == ["matched"] * 3 + ["no_match", "not_read"]
    assert rows[-1].sentence.startswith("season.csv:")
    stranger = replace(UNRESTRICTED, id="stranger", patterns=("theirs-*",))
    with pytest.raises(NotFound):
        job_files.opened(parts(served).database, parts(served).jobs.folder, stranger, job["id"], "plots.csv")
    repeated = served.get(job["links"]["files"] + "/../../../../stand.db")
    assert repeated.status_code == 404
    assert served.delete(job["links"]["self"]).status_code == 204
    assert not list(JobFolder(parts(served).database).path.glob(f"{job['id']}*"))


def parts(client: TestClient) -> Service:
    found: Service = cast(FastAPI, client.app).state.service
    return found


def test_several_files_come_in_an_archive(served: TestClient) -> None:
    params = {"file": "season.zip", "positions": "gnss.csv", "at_sigma": 3, "heading_sigma": 3}
    content, key = packed(local_plots() | {"2026/notes.md": b"wet"}), {"Idempotency-Key": "season-1"}
    sent = served.post(URL, params=params, content=content, headers=key)
    job = finished(served, sent)
    assert (job["state"], job["counts"]) == ("successful", {"matched": 3}), job
    assert {row.searched for row in rows_of(served, job)} == {"near"}
    report = files_of(served, job)["report.html"].decode()
    assert "1 files are of no format of trees and not read: notes.md" in report
    again = served.post(URL, params=params, content=content, headers=key)
    assert (again.json()["id"], again.headers["Idempotency-Replayed"]) == (job["id"], "true")
    files = sorted(one.name for one in JobFolder(parts(served).database).path.iterdir() if one.suffix != ".lock")
    assert f"{job['id']}.files" in files and f"{job['id']}.input" not in files


BOMB = packed({"a.csv": b"x,y\n" + b"1,1\n" * 600_000})


@pytest.mark.parametrize(
    ("params", "content", "words"),
    [
        ({"file": "a.zip"}, packed({"a/p.csv": b"x", "b/p.csv": b"y"}), "No plot can be read: a/p.csv"),
        (
            {"file": "a.zip", "positions": "g.csv", "at_sigma": "3"},
            packed({"a/g.csv": b"x,y\n", "b/g.csv": b"x,y\n"}),
            "2 files 'g.csv'",
        ),
        ({"file": "a.zip"}, packed({"p.csv": b"x,y\n", "columns.toml": b'centres = "../../x.csv"'}), "another folder"),
        ({"file": "a.zip"}, packed({"p.csv": b"x,y\n", "columns.toml": b"z = 1"}), "'z' is not known"),
        ({"file": "a.csv"}, b"\0\0", "No plot can be read"),
        ({"file": "a.gpkg"}, b"SQLite format 3\0 cut", "No plot can be read"),
        ({"file": "a.zip", "positions": "g.csv", "at_sigma": "3"}, packed({"p.csv": b"x,y\n"}), "g.csv: no such file"),
    ],
)
def test_what_cannot_be_used_fails_with_a_sentence(
    served: TestClient, params: dict[str, str], content: bytes, words: str
) -> None:
    job = finished(served, served.post(URL, params=params, content=content))
    assert job["state"] == "failed"
    assert job["problem"]["status"] == 422
    assert words in job["problem"]["detail"]
    assert "/tmp" not in job["problem"]["detail"]
    assert served.get(job["links"]["files"]).status_code == 410


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ({"file": "a.csv", "noise": "1"}, "need `at_sigma`"),
        ({"file": "a.csv", "at_sigma": "3", "positions": "g.csv"}, "zip archive"),
        ({"file": "a.csv", "positions_crs": "EPSG:4326"}, "needs `positions`"),
        ({"file": "a.shp"}, "Shapefile"),
        ({"file": "../a.csv"}, "without folders"),
        ({"file": "a.csv", "unit": "furlong"}, "unit"),
        ({"file": "a.csv", "sigma": "1"}, "is not a parameter"),
    ],
)
def test_what_is_asked_wrongly_is_refused_at_once(served: TestClient, params: dict[str, str], words: str) -> None:
    answer = served.post(URL, params=params, content=b"x,y\n")
    assert answer.status_code == 422
    assert words in answer.text


TWICE = {"a/p.csv": b"x,y\n", "b/p.csv": b"x,y\n"}


@pytest.mark.parametrize(
    ("file", "content", "words"),
    [
        ("a.zip", b"PK no archive", "no zip archive"),
        ("a.zip", packed({}), "has no file"),
        ("a.zip", BOMB, "unpacks to 2400004 bytes"),
        ("a.zip", packed({"notes.md": b"wet"}), "no file of trees"),
        ("a.zip", packed({"../p.csv": b"x,y\n"}), "cannot be used: '..'"),
        ("a.zip", packed(TWICE | {"columns.toml": b"unit = 'ft'"}), "'a' has none"),
        ("a.zip", packed(TWICE | {"c.csv/p.csv": b"x", "c.csv": b"x"}), "a file and a folder 'c.csv'"),
        ("a.inventory", b"x,y\n", "ends in no suffix of a format of trees"),
    ],
)
def test_a_file_that_cannot_be_a_season_is_refused_at_once(
    served: TestClient, file: str, content: bytes, words: str
) -> None:
    before = served.get("/v1/jobs").json()
    answer = served.post(URL, params={"file": file}, content=content)
    assert (answer.status_code, words in answer.text) == (422, True), answer.text
    assert served.get("/v1/jobs").json() == before
    assert not [one for one in JobFolder(parts(served).database).path.iterdir() if one.suffix == ".input"]


def test_files_of_one_name_stay_in_their_folders(served: TestClient) -> None:
    """As `urquhart coregister north south` reads them. The second plot is mirrored, which its sentence says."""
    (first, second), files = [seen_from(centre) for centre in list(CENTRES.values())[:2]], {}
    for name, (ids, xy) in (("2026/north", first), ("2026/south", (second[0], second[1] * (1.0, -1.0)))):
        rows = "".join(f"{tag},{x:.3f},{y:.3f}\n" for tag, (x, y) in zip(ids, xy.tolist(), strict=True))
        files[f"{name}/plot.csv"] = f"tag,x,y\n{rows}".encode()
    job = finished(served, served.post(URL, params={"file": "s.zip"}, content=packed(files)))
    assert (job["state"], job["total"], job["done"]) == ("successful", 2, 2), job
    placed = {row.plot: row for row in rows_of(served, job)}
    assert {name: row.verdict for name, row in placed.items()} == {"north-plot": "matched", "south-plot": "no_match"}
    assert placed["north-plot"].file == "2026/north/plot.csv"
    assert "hint: the mirror image fits" in placed["south-plot"].sentence, placed["south-plot"].sentence


def test_a_job_that_is_killed_goes_on(serve: Callable[..., Server], folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "killed.db"
    path.write_bytes((folder / "stand.db").read_bytes())
    rows, rng = ["plot,tag,x,y"], np.random.default_rng(1)
    for plot in range(60):
        at = rng.uniform(0.0, 30.0, (40, 2)).tolist()
        rows += [f"R{plot},{tag},{x + 100 * plot:.3f},{y:.3f}" for tag, (x, y) in enumerate(at)]
    server = serve(path)
    sent = server.client.post(URL, params={"file": "random.csv"}, content="\n".join(rows).encode())
    assert sent.status_code == 202, sent.text
    journal = Path(f"{path}.jobs") / f"{sent.json()['id']}.files" / JOURNAL
    while not (journal.exists() and journal.stat().st_size):
        time.sleep(0.005)
    server.kill()
    before = journal.read_bytes().splitlines()
    assert 0 < len(before) < 60
    server = serve(path)
    job = finished(server.client, sent)
    assert (job["state"], job["done"], job["total"]) == ("successful", 60, 60), job
    after = journal.read_bytes().splitlines()
    assert after[: len(before) - 1] == before[:-1]  # the last one may be cut
    assert [orjson.loads(line)["name"] for line in after] == [f"R{plot}" for plot in range(60)]
    assert len(rows_of(server.client, job)) == 60
