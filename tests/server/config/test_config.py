"""Settings from a file and the environment: which goes first, what is refused, and what is told of them."""

import json
from pathlib import Path

import pytest
from pydantic import BaseModel, Field, SecretStr

from server.config import settings_loading, settings_report
from server.config.file_and_environment import Misconfigured, fields, variable
from server.config.settings import Settings
from tests.server.commands.cli_helpers import Urquhart, refused

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No file of the working folder has a say."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A settings file where it is looked for."""
    path = tmp_path / "urquhart.toml"
    path.write_text(
        'port = 1111\nhost = "::1"\nbusy_timeout_seconds = 3\n'
        "[limits]\npage_default = 11\npage_max = 12\nlandmarks = 13\n"
    )
    return path


def test_option_before_environment_before_file(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URQUHART_PORT", "2222")
    monkeypatch.setenv("urquhart_limits__page_default", "7")
    monkeypatch.setenv("URQUHART_BUSY_TIMEOUT_SECONDS", "2")
    settings = settings_loading.load(port=3333, database=None)
    assert (settings.port, settings.busy_timeout_seconds, settings.host) == (3333, 2.0, "::1")
    # A group is put together from all of them.
    assert (settings.limits.page_default, settings.limits.page_max, settings.limits.landmarks) == (7, 12, 13)
    assert settings.limits.candidates == 100
    told = {one.name: one for one in settings_report.describe(settings, port=3333, database=None)}
    assert told["port"].source == "option"
    assert told["busy_timeout_seconds"].source == "URQUHART_BUSY_TIMEOUT_SECONDS"
    assert told["limits.page_default"].source == "urquhart_limits__page_default"
    assert told["limits.page_max"].source == file.name
    assert (told["limits.candidates"].source, told["database"].source) == ("default", "default")
    assert (told["limits.page_default"].value, told["limits.page_default"].default) == (7, 100)


def test_the_file_is_named_by_the_environment_or_an_option(
    tmp_path: Path, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, port in (("one.toml", 1), ("two.toml", 2)):
        (tmp_path / name).write_text(f"port = {port}\n")
    assert Settings().port == 1111
    monkeypatch.setenv("URQUHART_CONFIG", "one.toml")
    assert Settings().port == 1
    assert settings_loading.load(config=Path("two.toml")).port == 2
    with pytest.raises(Misconfigured, match=r"none.toml: no such settings file"):
        settings_loading.load(config="none.toml")


def test_nothing_is_read_where_there_is_no_file() -> None:
    assert Settings() == settings_loading.load()
    assert {one.source for one in settings_report.describe(Settings())} == {"default"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("prt = 1\n", "there is no setting prt; did you mean port"),
        ("[limits]\npage_defalt = 1\n", r"there is no setting limits.page_defalt; did you mean limits.page_default\?"),
        ("[limts]\npage_default = 1\n", "there is no setting limts.page_default; did you mean limits.page_default"),
        ("[limits.page_default]\nrows = 1\n", "there is no setting limits.page_default.rows"),
        ("colour = 'green'\n", "there is no setting colour"),
        ("limits = 5\n", r"limits is a table: write \[limits\]"),
        ("config = 'other.toml'\n", "cannot be set in it"),
        ("port = \n", "not TOML"),
        ("port = 70000\n", "port: must be at most 65,535"),
        ("[log]\nlevel = 'loud'\n", "log.level: must be 'debug', 'info'"),
        ("[limits]\npage_default = 5\npage_max = 4\n", "must not exceed"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused_by_name(file: Path, text: str, message: str) -> None:
    file.write_text(text)
    with pytest.raises(Misconfigured, match=message) as refusal:
        settings_loading.load()
    assert "must not exceed" in message or str(refusal.value).startswith("urquhart.toml: ")


def test_a_file_that_is_no_text_is_refused(file: Path) -> None:
    file.write_bytes(b"port = '\xff'\n")
    with pytest.raises(Misconfigured, match=r"urquhart.toml: not TOML"):
        settings_loading.load()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("URQUHART_PROT", "URQUHART_PROT; did you mean URQUHART_PORT?"),
        ("URQUHART_LIMITS_PAGE_MAX", "did you mean URQUHART_LIMITS__PAGE_MAX?"),
        ("urquhart_limits__page_defalt", "urquhart_limits__page_defalt; did you mean URQUHART_LIMITS__PAGE_DEFAULT"),
        ("URQUHART_PORT_8420_TCP_ADDR", "there is no setting URQUHART_PORT_8420_TCP_ADDR"),
        ("URQUHART_", "there is no setting URQUHART_"),
    ],
)
def test_a_variable_that_is_no_setting_is_refused(monkeypatch: pytest.MonkeyPatch, name: str, message: str) -> None:
    monkeypatch.setenv(name, "1")
    with pytest.raises(Misconfigured) as refusal:
        Settings()
    assert message in str(refusal.value)
    monkeypatch.delenv(name)
    monkeypatch.setenv("OTHER_URQUHART_PROT", "1")
    assert Settings().port == 8420


def test_a_value_that_makes_no_sense_is_told_where_it_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URQUHART_LIMITS__PAGE_DEFAULT", "none")
    with pytest.raises(Misconfigured, match=r"^setting URQUHART_LIMITS__PAGE_DEFAULT: "):
        settings_loading.load()
    monkeypatch.delenv("URQUHART_LIMITS__PAGE_DEFAULT")
    with pytest.raises(Misconfigured, match=r"^option --port: "):
        settings_loading.load(port=-1)


def test_the_command_prints_all_of_them(urquhart: Urquhart, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URQUHART_LOG__FORMAT", "json")
    said = urquhart("config")
    rows = {line.split()[0]: line.split()[1:] for line in said.out.splitlines()}
    assert set(rows) == {"setting"} | {name for name, _ in fields(Settings)}
    assert rows["limits.page_default"] == ["11", "100", "urquhart.toml"]
    assert rows["log.format"] == ['"json"', '"text"', "URQUHART_LOG__FORMAT"]
    listed = json.loads(urquhart("config", "--json").out)
    assert {one["name"] for one in listed} == {name for name, _ in fields(Settings)}
    assert {"name": "port", "value": 1111, "source": "urquhart.toml"}.items() <= next(
        one for one in listed if one["name"] == "port"
    ).items()
    refused(urquhart("config", "--config", "none.toml"), "none.toml")
    file.write_text("prt = 1\n")
    refused(urquhart("serve", "--port", "0"), "urquhart.toml: there is no setting prt")


def test_secrets_are_never_told(monkeypatch: pytest.MonkeyPatch) -> None:
    class WithSecret(Settings):
        password: SecretStr = Field(SecretStr("changeme"), description="A word.")

    for module in (settings_loading, settings_report):
        monkeypatch.setattr(module, "Settings", WithSecret)
    monkeypatch.setenv("URQUHART_PASSWORD", "open sesame")
    told = settings_report.describe(settings_loading.load())
    assert next(one for one in told if one.name == "password").value == settings_report.HIDDEN
    for text in (settings_report.as_text(told), settings_report.as_json(told), settings_report.as_markdown(WithSecret)):
        assert "password" in text
        assert "sesame" not in text
        assert "changeme" not in text


def test_the_documentation_is_that_of_the_model() -> None:
    """Written by `urquhart config --markdown > docs/settings.md`."""
    assert (ROOT / "docs/settings.md").read_text(encoding="utf-8") == settings_report.as_markdown()


def test_every_setting_is_documented_with_its_variable_default_and_bounds() -> None:
    class Group(BaseModel):
        share: float = Field(0.5, gt=0, lt=1, description="How much.")

    class Few(BaseModel):
        name: str = Field("x", description="What it is called.")
        group: Group = Field(default_factory=Group, description="A group.")

    text = settings_report.as_markdown(Few)
    assert '| `name` | `URQUHART_NAME` | `"x"` | text | What it is called. |' in text
    assert "## `[group]`\n\nA group.\n" in text
    assert "| `share` | `URQUHART_GROUP__SHARE` | `0.5` | more than 0, less than 1 | How much. |" in text
    assert variable("limits.page_default") == "URQUHART_LIMITS__PAGE_DEFAULT"
    for name, field in fields(Settings):
        assert field.description, name


def test_the_clients_variables_are_none_of_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who has both at hand in one shell can use both."""
    monkeypatch.setenv("URQUHART_URL", "http://127.0.0.1:8420")
    monkeypatch.setenv("URQUHART_API_KEY", "urq_secret")
    assert "secret" not in settings_report.as_json(settings_report.describe(settings_loading.load()))
