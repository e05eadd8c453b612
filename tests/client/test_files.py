"""Files that the client reads: like the `urquhart` command, or not at all."""

import json
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.stem_maps.reader import StemMapError, read_stem_map
from server.stem_maps.stands import landmarks_of
from tests.client.fake import RECEIPT, RESULT
from urquhart_client import Client, cli
from urquhart_client._protocol.landmark_files import FileError, read_body, read_csv

GRID = [(i % 5 * 4.5, i // 5 * 3.5) for i in range(25)]


def grid(header: str, row: str) -> str:
    """A table of 25 trees; `row` may name x, y and n."""
    return header + "\n" + "".join(row.format(x=x, y=y, n=n) + "\n" for n, (x, y) in enumerate(GRID, start=1))


READ = {
    "positions": grid("x,y", "{x},{y}"),
    "names in any order and case": grid("Y_M, X_m", "{y},{x}"),
    "tags and diameters": grid("tree_id,x,y,dbh_cm,height_m,species", "t{n},{x},{y},{n},12.5,oak"),
    "some not known": grid("tag,x,y,dbh_cm,height_m,species", "{n},{x},{y},,,"),
    "diameters in mm": grid("id,x,y,dbh_mm", "{n},{x},{y},{n}11"),
    "diameters in m": grid("id,x,y,dbh_m", "{n},{x},{y},0.3{n}"),
    "diameters in inches": grid("id,x,y,dbh_in", "{n},{x},{y},{n}"),
    "diameters without a unit": grid("tree,x,y,dbh", "{n},{x},{y},20.{n}"),
    "a mark in front": "\ufeff" + grid("x,y", "{x},{y}"),
    "comments above": "# plot 7\n\n" + grid("x,y", "{x},{y}"),
    "blank lines": grid("x,y", "{x},{y}\n"),
    "tags with a hash": grid("id,x,y", "#{n},{x},{y}"),
    "quoted": grid('"id","x","y"', '"{n}","{x}","{y}"'),
    "tabs": grid("x\ty", "{x}\t{y}"),
    "semicolons and decimal commas": "x;y\n" + "".join(f"{x};{y}\n".replace(".", ",") for x, y in GRID),
    "exponents": "x,y\n1e1,2\n3,4.5\n-5,.5\n",
    "one plot": grid("plot,x,y", "a,{x},{y}"),
    "columns that mean nothing": grid("note,x,y", "leaning,{x},{y}"),
    "no tree": "x,y\n",
}
REFUSED = {
    "two systems": "x_m,y_m,x,y\n1_000,2,3,4\n,5,448120.5,5411000.2\n7,8,9,10\n",
    "two x": "x,x_m,y\n1,2,3\n",
    "the same name twice": "x,y,y\n1,2,3\n",
    "x of one system, y of another": "x_m,y\n,2\n",
    "underscores": "x,y\n1_000,2\n3,4\n5,7\n",
    "not finite": "x,y\nnan,2\n",
    "infinite": "x,y\n1,inf\n",
    "no number": "x,y\n1,b\n",
    "no value": "x,y\n1,\n",
    "too large": "x,y\n1e9,2\n",
    "a field too few": "x,y\n1\n",
    "a field too many": "x,y\n1,2,3\n",
    "no columns": "a,b\n1,2\n",
    "empty": "",
    "an id twice": "id,x,y\na,1,2\na,30,4\n",
    "an id left out": "id,x,y\na,1,2\n,3,4\n",
    "a diameter of none": "x,y,dbh_cm\n1,2,0\n",
    "two diameters": "x,y,dbh,dbh_cm\n1,2,3,4\n",
    "millimetres without their unit": grid("x,y,dbh", "{x},{y},2{n:02}"),
    "metres without their unit": grid("x,y,dbh", "{x},{y},0.3{n}"),
    "decimal commas between commas": "x,y\n1,5,2,5\n",
    "one digit": "x,y\n" + "".join(f"{10 + n},{n % 10}\n" for n in range(25)),
    "two marks": "x;y\n1,5;2\n1.5;2\n",
    "plots on each other": grid("plot,x,y", "a,{x},{y}") + "".join(f"b,{x},{y}\n" for x, y in GRID),
    "centres of plots": "x,y\n" + "1,2\n" * 9 + "5,6\n" * 9,
    "an open quote": 'x,y\n1,"2\n',
    "a comment below": "x,y\n1,2\n# end\n",
    "feet without their unit": "x,y,dbh_cm\n" + "".join(f"{8 * x},{8 * y},12\n" for x, y in GRID),
    "millimetres": "x,y\n" + "".join(f"{x * 1000},{y * 1000}\n" for x, y in GRID),
    "kilometres": "x,y\n" + "".join(f"{x / 1000 + 448},{y / 1000 + 5411}\n" for x, y in GRID),
    "degrees": "x,y\n" + "".join(f"{8 + x / 1e5},{48 + y / 1e5}\n" for x, y in GRID),
    "a line": "x,y\n" + "".join(f"{x},7.5\n" for x, _ in GRID),
    "a line of many": "x,y\n" + "".join(f"{1.5 * n},7.5\n" for n in range(25)),
    "too coarse": "x,y\n" + "".join(f"{round(x / 9) * 9},{round(y)}\n" for x, y in GRID),
    "positions twice": "x,y,easting,northing\n1,2,448001,5411002\n",
    "longitude": "lon,lat\n7.1,50.1\n",
}


@pytest.mark.parametrize("name", READ)
def test_the_client_reads_what_the_command_reads(tmp_path: Path, name: str) -> None:
    file = tmp_path / "seen.csv"
    file.write_bytes(READ[name].encode())
    stem_map = read_stem_map(file, allow_empty=True)
    wanted = [tree.model_dump(exclude_none=True) for tree in landmarks_of(stem_map)]
    assert read_csv(file) == {"landmarks": wanted}


@pytest.mark.parametrize("name", REFUSED)
def test_the_client_refuses_what_the_command_refuses(tmp_path: Path, name: str) -> None:
    file = tmp_path / "seen.csv"
    file.write_bytes(REFUSED[name].encode())
    with pytest.raises(StemMapError):
        read_stem_map(file)
    with pytest.raises(FileError) as refused:
        read_csv(file)
    assert str(refused.value).startswith(str(file))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("content", [b"\xff\xfex\x00", "x,y\n1,2\n\u00e9,4\n".encode("latin-1")])
def test_other_encodings_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "seen.csv").write_bytes(content)
    with pytest.raises(FileError, match="UTF-8"):
        read_csv(tmp_path / "seen.csv")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"xy": [], "xy": [[1, 2]]}', "twice"),
        ('{"landmarks": [{"x": 1, "x": 2}]}', "twice"),
        ('{"xy": [[NaN, 1]]}', "NaN"),
        ('{"xy": [[1, 2]], "sesion": "a"}', "'sesion'"),
        ("[]", "JSON object"),
    ],
)
def test_no_member_of_a_body_is_passed_over(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "seen.json").write_text(text)
    with pytest.raises(FileError, match=told):
        read_body(tmp_path / "seen.json", {"xy", "landmarks", "session"})


class Sent:
    """A service that keeps what it is sent."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.bodies: list[Any] = []
        monkeypatch.setattr(cli, "Client", lambda url, **_: Client(url, transport=httpx.MockTransport(self)))

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if request.content:
            self.bodies.append(json.loads(request.content))
        if "queries" in request.url.path:
            return httpx.Response(200, json=RESULT)
        known = {"id": "plots", "fingerprint": "f", "revision": 0}
        return httpx.Response(200, json=RECEIPT if "submaps" in request.url.path else known)


def test_all_that_a_file_holds_is_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sent = Sent(monkeypatch)
    body = {
        "landmarks": [{"id": "a", "x": 1.5, "y": 2.5, "dbh_cm": 30.0, "height_m": 12.0, "species": "oak"}],
        "frame_id": "plot",
        "stamp": "2026-05-04T09:30:00Z",
        "session": "monday",
        "map_pose": {"x": 1.0, "y": 2.0, "yaw": 0.5},
        "properties": {"n": 1},
        "query": {"limit": 1},
    }
    file = tmp_path / "seen.json"
    file.write_text(json.dumps(body))
    assert cli.run(["put", "plots", "p7", str(file)]) == 0
    assert sent.bodies[-1] == body
    assert cli.run(["put", "plots", "p7", str(file), "--session", "other"]) == 2
    table = tmp_path / "seen.csv"
    table.write_text("tree_id,x,y,dbh_cm,species\nt7,1.5,2.5,30,oak\nt8,3.5,4.5,,\n")
    assert cli.run(["put", "plots", "p7", str(table), "--session", "monday"]) == 0
    assert sent.bodies[-1] == {
        "landmarks": [
            {"id": "t7", "x": 1.5, "y": 2.5, "dbh_cm": 30.0, "species": "oak"},
            {"id": "t8", "x": 3.5, "y": 4.5},
        ],
        "session": "monday",
    }
    capsys.readouterr()
    assert cli.run(["query", "plots", str(table)]) == 0
    assert "yaw 90.00 deg" in capsys.readouterr().out
    refused = tmp_path / "two.csv"
    refused.write_text(REFUSED["two systems"])
    before = len(sent.bodies)
    assert cli.run(["query", "plots", str(refused)]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), len(sent.bodies)) == ("", 1, before)
    assert cli.run(["put", "plots", "p7", str(refused)]) == 2
    assert len(sent.bodies) == before  # no collection is made for it
