"""Seasons of plots, the files of jobs, and exports through the client."""

import asyncio
import zipfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart_client import AsyncClient, Client, Progress, SeasonOptions
from urquhart_client._protocol.archives import one_upload
from urquhart_client._protocol.file_requests import inside
from urquhart_client.cli import run
from urquhart_client.errors import UnexpectedAnswer

XY = np.random.default_rng(5).uniform(0.0, 90.0, (300, 2)).round(3)


def write(path: Path, xy: NDArray[np.float64], header: str = "tag,x,y") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([header, *(f"{n},{x:.3f},{y:.3f}" for n, (x, y) in enumerate(xy.tolist()))]) + "\n")
    return path


def seasons(folder: Path) -> Path:
    """Two plots of 20 m, each about a point of its own, and where those are."""
    rows = ["plot,x,y"]
    for name, centre in (("north", (30.0, 60.0)), ("south", (60.0, 30.0))):
        write(folder / f"{name}.csv", (XY - centre)[np.hypot(*(XY - centre).T) < 20.0])
        rows.append(f"{name},{centre[0] + 1.0},{centre[1]}")
    (folder / "gnss.csv").write_text("\n".join(rows) + "\n")
    return folder


def test_a_season_goes_out_and_comes_back(client: Client, tmp_path: Path) -> None:
    client.put_collection("als")
    client.put_stand("als", "als", write(tmp_path / "als.csv", XY), cut={"radius": 30, "spacing": 20})
    folder, phases = seasons(tmp_path / "2026"), list[str]()

    def told(progress: Progress) -> None:
        phases.append(progress.phase)

    search: SeasonOptions = {"at_sigma": 3.0, "heading_sigma": 3.0}
    job = client.coregister("als", folder, positions=folder / "gnss.csv", search=search, progress=told)
    assert (job.state, job.counts) == ("successful", {"matched": 2}), job
    assert phases[0] == "sending" and phases[-1] == "storing"
    rows = {row.plot: row for row in client.plot_rows(job.id)}
    assert (rows["north"].shift_east, rows["north"].shift_north) == pytest.approx((-1.0, 0.0), abs=0.01)
    written = client.download_job_files(job.id, tmp_path / "out")
    assert [one.name for one in client.job_files(job.id)] == [
        path.relative_to(tmp_path / "out").as_posix() for path in written
    ]
    assert (tmp_path / "out" / "pictures" / "north.svg").read_text().startswith("<svg")
    alone = client.coregister("als", folder / "south.csv", wait=False)
    assert client.wait_for_job(alone.id).counts == {"matched": 1}
    trees = client.export("als", "landmarks", tmp_path / "trees.csv")
    assert len(trees.read_text().splitlines()) == 301
    with pytest.raises(ValueError, match="none of"):
        client.export("als", "landmarks", tmp_path / "trees.shp")
    if client.base_url.startswith("http://127.0.0.1"):
        asyncio.run(_awaited(client.base_url, folder, tmp_path))


def test_the_command_places_a_season_and_exports(
    service_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("URQUHART_URL", service_url)
    folder, out = seasons(tmp_path / "2026"), tmp_path / "out"
    als = write(tmp_path / "als.csv", XY)
    assert run(["put-stand", "als", "als", str(als), "--radius", "30", "--spacing", "20"]) == 0
    near = ["--positions", str(folder / "gnss.csv"), "--at-sigma", "3", "--heading-sigma", "3"]
    assert run(["coregister", "als", str(folder), "--out", str(out), *near]) == 0
    assert "coregistration on als: successful (2 matched)" in capsys.readouterr().out
    assert (out / "report.html").exists() and (out / "transforms" / "north.txt").exists()
    assert run(["coregister", "als", str(folder), "--out", str(out), "--noise", "0.5"]) == 2
    assert "need `at_sigma`" in capsys.readouterr().err
    assert run(["export", "landmarks", "als", str(tmp_path / "trees.csv")]) == 0
    assert run(["export", "landmarks", "als", str(tmp_path / "trees.doc")]) == 2


async def _awaited(url: str, folder: Path, out: Path) -> None:
    async with AsyncClient(url) as client:
        job = await client.coregister("als", folder / "north.csv", search={"effort": "fast"})
        assert job.counts == {"matched": 1}
        assert [row.plot async for row in client.plot_rows(job.id)] == ["north"]
        written = await client.download_job_files(job.id, out / "again")
        assert out / "again" / "report.html" in written
        path = await client.export("als", "submaps", out / "submaps.csv")
        assert path.read_text().startswith("id,")


def test_files_are_packed_together(tmp_path: Path) -> None:
    folder = seasons(tmp_path / "2026")
    for part in (".shp", ".dbf", ".prj"):
        (tmp_path / f"p{part}").write_bytes(b"part")
    with one_upload([folder / "north.csv"], None) as alone:
        assert alone == folder / "north.csv"
    with one_upload([folder, tmp_path / "p.shp"], folder / "gnss.csv") as packed:
        first = packed.read_bytes()
    with one_upload([folder, tmp_path / "p.shp"], folder / "gnss.csv") as packed:
        assert packed.read_bytes() == first  # so that an attempt with the same key is the same request
    assert {name for name in (b"north.csv", b"south.csv", b"gnss.csv", b"p.shp", b"p.dbf", b"p.prj") if name in first}
    with one_upload([folder, write(tmp_path / "2025" / "north.csv", XY)], None) as packed:
        assert {"2026/north.csv", "2026/south.csv", "2025/north.csv"} <= set(zipfile.ZipFile(packed).namelist())
    with (
        pytest.raises(ValueError, match=r"two files have the name 2026/north\.csv"),
        one_upload([folder, write(tmp_path / "old" / "2026" / "north.csv", XY)], None),
    ):
        pass
    with pytest.raises(ValueError, match="no file"), one_upload([], None):
        pass
    with pytest.raises(FileNotFoundError), one_upload([folder / "west.csv"], None):
        pass


@pytest.mark.parametrize("name", ["../a", "/etc/a", "a/../../b", "a\\..\\b", ""])
def test_no_name_leads_out_of_the_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(UnexpectedAnswer):
        inside(tmp_path, name)
