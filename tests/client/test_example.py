"""The example is run as its docstring says, by a robot whose key may read and write but creates no collection."""

import os
import subprocess
import sys
from pathlib import Path

from server.security import api_keys
from server.security.principal import Scope
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from tests.server.processes import Server
from urquhart_client import Client

ROOT = Path(__file__).parents[2]
CLI = "from urquhart_client.cli import main; main()"


def test_the_robot_closes_its_loops(tmp_path: Path) -> None:
    database = Database(tmp_path / "urquhart.db")
    bring_up_to_date(database)
    robot, _ = api_keys.make(database, "robot", [Scope.READ, Scope.WRITE], ["robots"])
    office, _ = api_keys.make(database, "office", [Scope.ADMIN], ["*"])
    database.dispose()
    server = Server(tmp_path / "urquhart.db", tmp_path / "log")
    try:
        url = str(server.client.base_url)
        with Client(url, api_key=office) as client:
            client.put_collection("robots")
        ran = subprocess.run(
            [sys.executable, ROOT / "examples/robot_loop.py", url],
            env=os.environ | {"URQUHART_API_KEY": robot},
            capture_output=True,
            text=True,
            timeout=120,
        )
        seen = tmp_path / "seen.csv"
        seen.write_text("x,y\n1,2\n4,9\n8,1\n12,7\n3,15\n")
        put = subprocess.run(
            [sys.executable, "-c", CLI, "--url", url, "put", "robots", "extra", seen],
            env=os.environ | {"URQUHART_API_KEY": robot},
            capture_output=True,
            text=True,
            timeout=60,
        )
    finally:
        server.close()
    assert (ran.returncode, ran.stderr) == (0, "")
    closed = ran.stdout.splitlines()
    assert len(closed) > 15
    assert all(line.startswith("stop ") and "trees agree" in line for line in closed)
    assert (put.returncode, put.stderr) == (0, "seen.csv: read x_m from 'x', y_m from 'y'\n")
    assert put.stdout.startswith("extra: created")


def test_three_drives_become_one_map(tmp_path: Path) -> None:
    server = Server(tmp_path / "urquhart.db", tmp_path / "log")
    try:
        ran = subprocess.run(
            [sys.executable, ROOT / "examples/drives_to_map.py", str(server.client.base_url), tmp_path / "trees.csv"],
            capture_output=True,
            text=True,
            timeout=120,
        )
    finally:
        server.close()
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout.startswith("24 submaps in 1 part(s): ")
    count = int(ran.stdout.split()[5])
    assert 325 < count < 345  # 335 of longleaf's 584 trees are seen; the others stand at the edges, out of sight
    assert len((tmp_path / "trees.csv").read_text().splitlines()) == 1 + count
