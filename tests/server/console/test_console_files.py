"""The console as it is served: built from its sources, small, cached, and loading nothing from another host."""

import gzip
import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path

import httpx
import pytest

from server.console.built_files import FOLDER

ROOT = Path(__file__).parents[3]
SOURCES = ("ui", "clients/typescript/src", "package-lock.json")
MOST_BYTES = 150_000
"""Of all files together, compressed with gzip: over a link of 1 Mbit/s the console starts in about a second."""
STALE = "the console was not built from these sources: run `make ui`, which needs node, and commit what it writes"
BROWSER = {"Accept": "text/html,application/xhtml+xml,*/*;q=0.8"}


def digest_of_sources() -> str:
    """As `ui/record-sources.mjs` makes it."""
    paths = [
        path
        for source in SOURCES
        for path in ((ROOT / source).rglob("*") if (ROOT / source).is_dir() else [ROOT / source])
        if path.is_file() and "node_modules" not in path.parts
    ]
    digest = hashlib.sha256()
    for name in sorted(path.relative_to(ROOT).as_posix() for path in paths):
        digest.update(f"{name}\0".encode() + (ROOT / name).read_bytes() + b"\0")
    return digest.hexdigest()


def test_the_built_files_are_of_these_sources() -> None:
    assert json.loads((FOLDER / "build.json").read_text())["sources"] == digest_of_sources(), STALE


@pytest.mark.skipif(
    shutil.which("node") is None or not (ROOT / "node_modules" / "vite").exists(),
    reason="node, or what `npm ci` installs, is not here",
)
def test_a_build_writes_the_same_files(tmp_path: Path) -> None:
    vite = ROOT / "node_modules/vite/bin/vite.js"
    out = tmp_path / "assets"
    built = subprocess.run(
        ["node", str(vite), "build", "--outDir", str(out)], cwd=ROOT / "ui", capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stdout + built.stderr

    def files(folder: Path) -> dict[str, bytes]:
        return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    assert files(out) == files(FOLDER), STALE


def test_all_files_together_are_small() -> None:
    assert sum(len(gzip.compress(path.read_bytes(), 6)) for path in FOLDER.rglob("*") if path.is_file()) <= MOST_BYTES


def test_a_browser_is_sent_to_the_console_and_a_program_is_not(shared_client: httpx.Client) -> None:
    answer = shared_client.get("/", headers=BROWSER, follow_redirects=False)
    assert (answer.status_code, answer.headers["Location"], answer.headers["Vary"]) == (303, "/ui", "Accept")
    assert shared_client.get("/").json()["links"]["console"] == "/ui"


@pytest.mark.parametrize("path", ["/ui", "/ui/", "/ui/collections/plots/queries/1", "/ui/%3Cscript%3E"])
def test_every_address_below_is_the_page(shared_client: httpx.Client, path: str) -> None:
    page = shared_client.get(path, headers=BROWSER)
    assert page.status_code == 200
    assert page.text == (FOLDER / "index.html").read_text()
    policy = dict(part.strip().split(" ", 1) for part in page.headers["Content-Security-Policy"].split(";"))
    assert policy["default-src"] == "'self'"
    assert policy["frame-ancestors"] == policy["base-uri"] == policy["object-src"] == "'none'"
    assert "unsafe" not in page.headers["Content-Security-Policy"]
    assert page.headers["X-Content-Type-Options"] == "nosniff"
    assert page.headers["Cache-Control"] == "no-cache"
    again = shared_client.get(path, headers={"If-None-Match": page.headers["ETag"]})
    assert (again.status_code, again.content) == (304, b"")
    # A browser replaces the headers of the page that it has with these.
    for name in ("Content-Security-Policy", "Cache-Control", "X-Content-Type-Options", "ETag"):
        assert again.headers[name] == page.headers[name]


def test_the_page_loads_files_of_this_service_only(shared_client: httpx.Client) -> None:
    page = (FOLDER / "index.html").read_text()
    linked = re.findall(r'(?:src|href)="([^"]+)"', page)
    assert len(linked) >= 3
    assert not re.search(r"<script(?![^>]*\bsrc=)|\bstyle=|<style", page)
    for path in linked:
        assert path.startswith("/ui/files/")
        file = shared_client.get(path)
        assert file.status_code == 200
        assert file.headers["Cache-Control"] == "public, max-age=31536000, immutable"
        assert re.search(r"-[\w-]{8}\.(js|css|svg)$", path), "a file that is cached for ever has a hash in its name"
        assert "charset" in file.headers["Content-Type"] or path.endswith(".svg")
    for path in FOLDER.rglob("*.js"):
        hosts = set(re.findall(r"https?://([\w.-]+)", path.read_text()))
        assert hosts <= {"www.w3.org"}, "names of XML only"


@pytest.mark.parametrize("name", ["nothing.js", "..%2findex.html", "build.json", "index.html"])
def test_nothing_else_is_served(shared_client: httpx.Client, name: str) -> None:
    answer = shared_client.get(f"/ui/files/{name}")
    assert answer.status_code == 404 or answer.text == (FOLDER / "index.html").read_text()


def test_the_sources_hold_no_host() -> None:
    for path in (ROOT / "ui").rglob("*.ts*"):
        if "node_modules" not in path.parts:
            hosts = set(re.findall(r"https?://([\w.-]+)", path.read_text()))
            assert hosts <= {"www.w3.org", "127.0.0.1"}, path
    assert "registry" not in (ROOT / "package-lock.json").read_text()
