"""What operators copy from `contrib/` fits the service: options, settings, metrics, limits."""

import json
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from server.commands.loading import COMMANDS
from server.config.settings import Settings
from server.config.settings_report import describe

ROOT = Path(__file__).parents[1]
CONTRIB = ROOT / "contrib"
METRIC = re.compile(r"\burquhart_[a-z_]+")


def documented_metrics() -> set[str]:
    page = (ROOT / "docs/operations.md").read_text()
    names = set(re.findall(r"^\| `(urquhart_\w+)` \| (\w+)", page, flags=re.MULTILINE))
    parts = {f"{name}_{end}" for name, kind in names if kind == "histogram" for end in ("bucket", "sum", "count")}
    return {name for name, _ in names} | parts


def needed(program: str) -> str:
    """The path of a program, or the test is skipped."""
    path = shutil.which(program)
    if path is None:
        pytest.skip(f"{program} is not installed")
    return path


def compose_files() -> dict[str, Any]:
    paths = (ROOT / "docker-compose.yml", CONTRIB / "compose/docker-compose.yml")
    return {str(path.relative_to(ROOT)): yaml.safe_load(path.read_text()) for path in paths}


@pytest.mark.parametrize("name", ["alerts.yml", "grafana.json"])
def test_what_watches_the_service_asks_for_metrics_that_it_has(name: str) -> None:
    text = (CONTRIB / "monitoring" / name).read_text()
    used = set(METRIC.findall(text))
    assert used
    assert used <= documented_metrics()


def test_the_dashboard_has_a_panel_for_each_question() -> None:
    panels = json.loads((CONTRIB / "monitoring/grafana.json").read_text())["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels) > 10
    assert all(target["expr"] for panel in panels for target in panel["targets"])


def test_the_alert_rules_are_rules() -> None:
    program = needed("promtool")
    subprocess.run([program, "check", "rules", str(CONTRIB / "monitoring/alerts.yml")], check=True)


def test_every_alert_says_what_is_wrong_and_how_urgent_it_is() -> None:
    (group,) = yaml.safe_load((CONTRIB / "monitoring/alerts.yml").read_text())["groups"]
    for rule in group["rules"]:
        assert rule["expr"] and rule["annotations"]["summary"]
        assert rule["labels"]["severity"] in ("page", "ticket")


def test_every_option_of_serve_is_a_setting() -> None:
    parameters = {parameter.name for parameter in COMMANDS["serve"].load("serve").params}
    assert parameters <= set(Settings.model_fields)


def test_variables_of_the_service_are_settings() -> None:
    known = {setting.variable for setting in describe(Settings(), config=None)}
    for path in (ROOT / "Dockerfile", ROOT / "docker-compose.yml", *CONTRIB.rglob("*")):
        if path.is_file():
            used = set(re.findall(r"\bURQUHART_[A-Z_]+", path.read_text()))
            assert used <= known, path.name


def test_the_settings_file_of_the_page_is_valid() -> None:
    page = (ROOT / "docs/deploy.md").read_text()
    for block in re.findall(r"^```toml\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL):
        Settings.model_validate(tomllib.loads(block))


def test_the_page_names_files_that_exist() -> None:
    page = (ROOT / "docs/deploy.md").read_text()
    named = re.findall(r"\bcontrib/[\w./*-]+\w", page)
    assert len(named) > 8
    for name in named:
        assert list(ROOT.glob(name)), name


def test_units_stop_later_than_the_service_needs() -> None:
    unit = (CONTRIB / "systemd/urquhart.service").read_text()
    (seconds,) = re.findall(r"^TimeoutStopSec=(\d+)$", unit, flags=re.MULTILINE)
    assert int(seconds) > Settings().stop_seconds
    for name, document in compose_files().items():
        grace = document["services"]["urquhart"]["stop_grace_period"]
        assert int(grace.removesuffix("s")) > Settings().stop_seconds, name


def test_systemd_accepts_the_units(tmp_path: Path) -> None:
    program = needed("systemd-analyze")
    for path in sorted((CONTRIB / "systemd").iterdir()):
        # The programs are where the page installs them, not here.
        text = re.sub(r"^ExecStart=\S+", "ExecStart=/bin/true", path.read_text(), flags=re.MULTILINE)
        (tmp_path / path.name).write_text(text)
    units = [str(path) for path in sorted(tmp_path.iterdir())]
    checked = subprocess.run([program, "verify", "--man=no", *units], capture_output=True, text=True)
    about = [line for line in checked.stderr.splitlines() if "urquhart" in line]
    assert about == []


def test_only_the_file_for_trying_out_serves_without_keys() -> None:
    assert "INSECURE=" not in (ROOT / "Dockerfile").read_text()
    assert "--insecure" not in (ROOT / "Dockerfile").read_text()
    trial, tls = compose_files().values()
    assert trial["services"]["urquhart"]["environment"] == {"URQUHART_INSECURE": "true"}
    assert all(port.startswith("127.0.0.1:") for port in trial["services"]["urquhart"]["ports"])
    assert "ports" not in tls["services"]["urquhart"]
    assert not any("INSECURE" in name for name in tls["services"]["urquhart"]["environment"])


def test_the_backup_script_is_a_shell_script_that_asks_for_its_target() -> None:
    script = CONTRIB / "backup/off-host.sh"
    subprocess.run(["sh", "-n", str(script)], check=True)
    refused = subprocess.run(["sh", str(script)], env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True)
    assert refused.returncode != 0
    assert "BACKUP_TARGET" in refused.stderr
