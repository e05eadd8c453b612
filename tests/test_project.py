"""The project's own files agree with each other, and hold nothing that ties them to one machine."""

import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from server.commands.loading import COMMANDS

ROOT = Path(__file__).parents[1]
LOCKS = ("requirements.lock", "requirements-build.lock", "requirements-dev.lock", "requirements-docs.lock")
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())
CLIENT: dict[str, Any] = tomllib.loads((ROOT / "clients" / "python" / "pyproject.toml").read_text())
PAGES = (
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "clients/python/README.md",
    ROOT / "clients/typescript/README.md",
    *ROOT.glob("docs/**/*.md"),
)
VERBS = {
    "help",
    "demo",
    "serve",
    "test",
    "test-unit",
    "coverage",
    "kernels",
    "lint",
    "bench",
    "bench-check",
    "bench-library",
    "bench-paper",
    "bench-robust",
    "bench-levels",
    "bench-maps",
    "bench-scale",
    "bench-reliability",
    "docs",
    "screenshots",
    "ui",
    "client-types",
    "lock",
    "clean",
}


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def locked(name: str) -> dict[str, set[str]]:
    """Versions by package of a lock file; a package may have several, each for other systems."""
    versions: dict[str, set[str]] = {}
    for package, version in re.findall(r"^([a-z0-9-]+)==(\S+)", read(name), flags=re.MULTILINE):
        versions.setdefault(package, set()).add(version)
    return versions


def required(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=\[; ]", requirement)[0].lower() for requirement in requirements}


def make(*arguments: str, check: bool = True) -> "subprocess.CompletedProcess[str]":
    # The tests may be run by make themselves: what that one hands down would change what this one prints.
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    return subprocess.run(
        ["make", "--silent", *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=check
    )


# ------------------------------------------------------------- containers


def test_the_compose_file_follows_the_specification() -> None:
    document = yaml.safe_load(read("docker-compose.yml"))
    schema = json.loads(read("tests/compose_spec/compose_spec.json"))
    jsonschema.Draft201909Validator.check_schema(schema)
    jsonschema.Draft201909Validator(schema).validate(document)
    with pytest.raises(jsonschema.ValidationError):  # the schema does refuse what is not in it
        jsonschema.Draft201909Validator(schema).validate({"services": {"urquhart": {"volume": []}}})


def test_the_default_profile_is_the_service_on_loopback_and_its_volume() -> None:
    document = yaml.safe_load(read("docker-compose.yml"))
    service = document["services"]["urquhart"]
    assert "profiles" not in service
    assert all(port.startswith("127.0.0.1:") for port in service["ports"])
    volumes = [volume.split(":")[0] for volume in service["volumes"]]
    assert volumes == list(document["volumes"])
    assert service["image"] == f"urquhart:{PROJECT['project']['version']}"


def test_the_base_image_is_pinned_by_its_digest() -> None:
    dockerfile = read("Dockerfile")
    assert re.search(r"^ARG BASE=python:3\.11\S*@sha256:[0-9a-f]{64}$", dockerfile, flags=re.MULTILINE)
    assert re.findall(r"^FROM (\S+)", dockerfile, flags=re.MULTILINE) == ["${BASE}"] * 2


def test_the_image_runs_what_the_command_line_has() -> None:
    dockerfile = read("Dockerfile")
    assert len(re.findall(r"^FROM ", dockerfile, flags=re.MULTILINE)) == 2
    assert re.search(r"^USER (?!root)", dockerfile, flags=re.MULTILINE)
    assert "/readyz" in dockerfile.split("HEALTHCHECK", 1)[1]
    command = json.loads(dockerfile.rsplit("CMD ", 1)[1])
    assert command[:2] == ["urquhart", "serve"]
    options = {name for parameter in COMMANDS["serve"].load("serve").params for name in parameter.opts}
    assert {word for word in command if word.startswith("--")} <= options
    copied = re.findall(r"^COPY (?!--from)(.+) \S+$", dockerfile, flags=re.MULTILINE)
    for name in " ".join(copied).split():
        assert (ROOT / name).exists(), name


# ------------------------------------------------------------------- make


def test_help_tells_every_verb_in_a_line_each() -> None:
    makefile = read("Makefile")
    verbs = set(re.search(r"^\.PHONY: (.+)$", makefile, flags=re.MULTILINE)[1].split())  # type: ignore[index]
    assert verbs == VERBS
    said = make("help").stdout
    assert {line.split()[1] for line in said.splitlines()} == VERBS
    assert all(len(line.split()) > 2 for line in said.splitlines())


def test_without_a_python_make_says_what_to_do() -> None:
    ran = make("VENV=/nonexistent/urquhart", "PYTHON=", "test", check=False)
    assert ran.returncode != 0
    assert "Python 3.11 or newer is needed" in ran.stderr


def test_continuous_integration_runs_what_a_developer_runs() -> None:
    assert re.search(r"^exec make test$", read(".ci/run"), flags=re.MULTILINE)
    assert os.access(ROOT / ".ci" / "run", os.X_OK)


# ------------------------------------------------------------------ locks


@pytest.mark.parametrize("name", LOCKS)
def test_lock_files_name_no_host_and_no_machine(name: str) -> None:
    text = read(name)
    for pattern in (r"://", r"\bindex-url\b", r"\bfind-links\b", r"\bpypi\b", r"(^|\s)/\w", r"\\\w"):
        assert not re.search(pattern, text, flags=re.IGNORECASE), pattern


@pytest.mark.parametrize("name", LOCKS)
def test_every_locked_package_has_hashes(name: str) -> None:
    entries = re.split(r"^(?=[a-z0-9-]+==)", read(name), flags=re.MULTILINE)[1:]
    assert entries
    assert all("--hash=sha256:" in entry for entry in entries)


def test_the_locks_hold_what_the_project_names_and_agree() -> None:
    runtime, build, dev, docs = (locked(name) for name in LOCKS)
    assert required(PROJECT["project"]["dependencies"]) <= set(runtime)
    assert required(CLIENT["project"]["dependencies"]) <= set(runtime)
    assert required(PROJECT["dependency-groups"]["build"]) <= set(build)
    assert required(PROJECT["build-system"]["requires"]) <= set(build)
    assert required(CLIENT["build-system"]["requires"]) <= set(build)
    assert required(PROJECT["project"]["optional-dependencies"]["dev"]) <= set(dev)
    assert required(PROJECT["dependency-groups"]["docs"]) <= set(docs)
    for lock in (runtime, build):
        assert all(dev[package] == versions for package, versions in lock.items())
    # They are installed into one environment.
    assert all(dev.get(package, versions) == versions for package, versions in docs.items())


# ---------------------------------------------------------------- packages


def test_versions_agree() -> None:
    version = PROJECT["project"]["version"]
    assert CLIENT["project"]["version"] == version
    assert "## [Unreleased]" in read("CHANGELOG.md") or f"## [{version}]" in read("CHANGELOG.md")


def test_the_wheel_holds_the_packages_and_not_the_stem_maps(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(tmp_path)],
        cwd=ROOT, capture_output=True, check=True,
    )  # fmt: skip
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    assert tops == {"urquhart", "server", "migrations"}
    assert not [name for name in names if name.endswith(".csv")]
    assert [name for name in names if name.endswith("licenses/LICENSE")]
    assert [name for name in names if name.startswith("migrations/versions/0012")]
    assert "urquhart/calibration.json" in names
    assert {"server/console/assets/index.html", "server/console/assets/build.json"} <= set(names)
    assert [name for name in names if re.fullmatch(r"server/console/assets/files/index-.+\.js", name)]


def test_the_stem_maps_carry_their_licence() -> None:
    folder = ROOT / "data" / "stem_maps"
    assert "GNU GENERAL PUBLIC LICENSE" in (folder / "GPL-2.txt").read_text()
    readme = (folder / "README.md").read_text()
    for path in folder.glob("*.csv"):
        assert f"`{path.name}`" in readme
    assert "Apache License" in read("LICENSE")


def test_commit_hooks_are_local() -> None:
    config = yaml.safe_load(read(".pre-commit-config.yaml"))
    assert [repository["repo"] for repository in config["repos"]] == ["local"]


# ------------------------------------------------------------ documentation


def test_the_commands_of_the_documentation_exist() -> None:
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        for verb in re.findall(r"\bmake ([a-z][a-z-]*)\b(?=`|\s*$| ARGS)", text, flags=re.MULTILINE):
            assert verb in VERBS, f"{path.name}: make {verb}"
        for verb in re.findall(r"(?:^\s*|`|bin/)urquhart ([a-z]+)\b", text, flags=re.MULTILINE):
            assert verb in COMMANDS, f"{path.name}: urquhart {verb}"


def anchors(path: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" not in link:
            name, _, anchor = link.partition("#")
            target = page.parent / name if name else page
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), link


def test_every_command_and_option_has_help() -> None:
    def walk(name: str, command: Any) -> None:
        assert command.help, name
        for parameter in command.params:
            assert getattr(parameter, "help", None), f"{name} {parameter.name}"
        for child, subcommand in getattr(command, "commands", {}).items():
            walk(f"{name} {child}", subcommand)

    for name, entry in COMMANDS.items():
        walk(name, entry.load(name))
