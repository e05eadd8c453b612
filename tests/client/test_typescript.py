"""The TypeScript client: its types are those of the service, and its own tests pass against a real one."""

import hashlib
import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from server.app import create_app
from server.config.settings import Settings

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "clients" / "typescript"
STALE = "the API has changed: run `make client-types`, which needs node, and commit what it writes"

needs_node = pytest.mark.skipif(
    shutil.which("node") is None or not (ROOT / "node_modules" / "openapi-typescript").exists(),
    reason="node, or what `npm ci` installs, is not here",
)


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The OpenAPI document as `urquhart reference --openapi` prints it."""
    app = create_app(Settings(database=str(tmp_path_factory.mktemp("document") / "none.db")))
    made: dict[str, Any] = app.openapi()
    app.state.service.database.dispose()
    return json.dumps(made, indent=1, sort_keys=True) + "\n"


def run(*command: str, given: str | None = None, **environment: str) -> str:
    done = subprocess.run(
        command, cwd=PACKAGE, env=os.environ | environment, input=given, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_types_are_of_this_api(document: str) -> None:
    written = (PACKAGE / "src" / "schema.ts").read_text()
    recorded = re.search(r"openapi sha256 ([0-9a-f]{64})", written)
    assert recorded is not None
    assert recorded[1] == hashlib.sha256(document.encode()).hexdigest(), STALE


@needs_node
def test_the_types_are_what_the_generator_writes(document: str) -> None:
    assert run("node", "generate.mjs", "--print", given=document) == (PACKAGE / "src" / "schema.ts").read_text(), STALE


@needs_node
def test_its_own_tests_pass_against_a_service(service_url: str) -> None:
    run("node", str(ROOT / "node_modules/typescript/bin/tsc"), "-p", "tsconfig.json")
    said = run("node", "--test", "build/test/", URQUHART_TEST_URL=service_url)
    assert "# skipped 0" in said
    assert int(re.findall(r"^# pass (\d+)$", said, flags=re.MULTILINE)[0]) >= 11


def test_its_version_is_that_of_the_python_client() -> None:
    versions = {
        json.loads((ROOT / folder / "package.json").read_text())["version"] for folder in ("clients/typescript", "ui")
    }
    assert versions == {re.findall(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), flags=re.MULTILINE)[0]}
