"""The service behind nginx, configured as `contrib/nginx/urquhart.conf` says."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from server.commands.serve import bind
from tests.server.factories import forest, points
from tests.server.served import Served, wait_until

CONFIGURATION = Path(__file__).parents[3] / "contrib/nginx/urquhart.conf"
PLOTS = "/v1/collections/plots"


@pytest.fixture(scope="module")
def proxied(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[httpx.Client, Served]]:
    """A client of nginx in front of a service."""
    program = shutil.which("nginx", path="/usr/sbin:/usr/local/sbin:/usr/bin:/usr/local/bin")
    if program is None:
        pytest.skip("nginx is not installed")
    folder = tmp_path_factory.mktemp("nginx")
    served = Served(folder)
    with bind("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    # TLS is not what is tested, and certificates would have to be made.
    text = CONFIGURATION.read_text().replace("127.0.0.1:8420", f"127.0.0.1:{served.port}")
    text = re.sub(r"^ +(ssl_\w+|listen \[::\]).*\n", "", text, flags=re.MULTILINE)
    text = text.replace("listen 443 ssl;", f"listen 127.0.0.1:{port};").replace("forest.example", "localhost")
    kinds = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    folders = "".join(f"{kind}_temp_path {folder}/{kind};\n" for kind in kinds)
    main = folder / "nginx.conf"
    main.write_text(
        f"daemon off;\nmaster_process off;\npid {folder}/nginx.pid;\nerror_log {folder}/error.log;\n"
        f"events {{}}\nhttp {{\naccess_log off;\n{folders}{text}\n}}\n"
    )
    nginx = subprocess.Popen([program, "-e", f"{folder}/error.log", "-c", str(main), "-p", str(folder)])
    try:
        with httpx.Client(base_url=f"http://localhost:{port}", timeout=60.0) as client:
            wait_until(lambda: answers(client), served)
            client.put(PLOTS, json={}).raise_for_status()
            yield client, served
    finally:
        nginx.terminate()
        nginx.wait()
        served.close()


def answers(client: httpx.Client) -> bool:
    try:
        return client.get("/readyz").status_code == 200
    except httpx.TransportError:
        return False


def test_bodies_of_eight_mebibytes_go_through(proxied: tuple[httpx.Client, Served]) -> None:
    client, _ = proxied
    body = b'{"xy": ' + str(points(forest(1))).encode() + b"}"
    headers = {"Content-Type": "application/json"}
    stored = client.put(f"{PLOTS}/submaps/p", content=body.ljust(8 * 1024 * 1024), headers=headers)
    assert stored.status_code == 201
    refused = client.put(f"{PLOTS}/submaps/p", content=body.ljust(8 * 1024 * 1024 + 1), headers=headers)
    assert (refused.status_code, refused.headers["Content-Type"]) == (413, "application/problem+json")


def test_imports_go_through_as_they_arrive(proxied: tuple[httpx.Client, Served]) -> None:
    client, _ = proxied
    line = b'{"id": "q", "xy": ' + str(points(forest(2))).encode() + b"}\n"

    def pieces() -> Iterator[bytes]:
        yield line
        for _ in range(12):
            yield b" " * (1 << 20) + b"\n"

    sent = client.post(f"{PLOTS}/imports", content=pieces(), headers={"Content-Type": "application/x-ndjson"})
    assert sent.status_code == 202
    job = client.get(sent.headers["Location"], params={"wait": "25"}).json()
    assert job["counts"] == {"created": 1}


def test_the_log_has_the_address_of_the_caller(proxied: tuple[httpx.Client, Served]) -> None:
    client, served = proxied
    client.get("/v1/limits", headers={"X-Forwarded-For": "203.0.113.9"}).raise_for_status()

    def logged() -> list[str]:
        return [line for line in served.log.read_text().splitlines() if "/v1/limits" in line]

    wait_until(lambda: bool(logged()), served)  # the line is written after the answer
    assert "address=127.0.0.1" in logged()[-1]
