"""Settings: from the environment, checked together."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from server.config.settings import Limits, Settings
from server.config.settings_groups import IndexSettings


def test_defaults() -> None:
    settings = Settings()
    assert (settings.host, settings.port, settings.database_path) == ("127.0.0.1", 8420, Path("urquhart.db"))
    assert (settings.limits.body_bytes, settings.limits.landmarks) == (8 * 1024 * 1024, 20_000)
    with pytest.raises(ValidationError):
        settings.port = 1  # type: ignore[misc]


def test_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URQUHART_DATABASE", "sqlite:////data/a%20b.db?mode=ro")
    monkeypatch.setenv("URQUHART_PORT", "9000")
    monkeypatch.setenv("URQUHART_LIMITS__LANDMARKS", "500")
    monkeypatch.setenv("URQUHART_INDEX__CACHE_MB", "8")
    settings = Settings()
    assert (settings.database_path, settings.database_read_only) == (Path("/data/a b.db"), True)
    assert (settings.index.cache_mb, settings.index.flush_submaps) == (8, 2_000)
    assert (settings.port, settings.limits.landmarks, settings.limits.page_default) == (9000, 500, 100)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"database": "postgresql://host/db"}, "not a SQLite database"),
        ({"database": "sqlite:///:memory:"}, "must be a file"),
        ({"database": ":memory:"}, "must be a file"),
        ({"port": 70_000}, "65535"),
        ({"busy_timeout_seconds": 0}, "greater than 0"),
        ({"limits": {"page_default": 10, "page_max": 5}}, "must not exceed"),
        ({"limits": {"landmark": 10}}, "landmark"),
        ({"colour": "green"}, "colour"),
    ],
)
def test_what_cannot_be(values: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Settings(**values)  # type: ignore[arg-type]


def test_every_setting_is_described() -> None:
    for model in (Settings, Limits, IndexSettings):
        for name, field in model.model_fields.items():
            assert field.description, name
