"""Everything that can be set, from `URQUHART_*` in the environment; checked together, once, at construction."""

from pathlib import Path
from typing import Self
from urllib.parse import unquote

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

_SQLITE_URL = "sqlite:///"


class Limits(BaseModel):
    """Sizes that requests are held to; each is published by `GET /v1/limits` under the name it has here."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    body_bytes: int = Field(8 * 1024 * 1024, ge=1024, description="Largest request body, in bytes.")
    landmarks: int = Field(20_000, ge=3, description="Most landmarks in one submap or query.")
    properties_bytes: int = Field(
        16 * 1024, ge=2, description="Largest `properties` object of a submap, as JSON bytes."
    )
    candidates: int = Field(100, ge=1, description="Largest `limit` of a query.")
    excluded_submaps: int = Field(10_000, ge=1, description="Most submap ids in a query's `exclude`.")
    import_bytes: int = Field(8 * 1024**3, ge=1024, description="Largest import, in bytes, unpacked.")
    import_all_lines: int = Field(20_000, ge=1, description="Most lines of an import that stores all or none.")
    page: int = Field(100, ge=1, description="Rows of a page when `limit` is not given.")
    page_max: int = Field(1000, ge=1, description="Largest `limit` of a page.")
    stored_queries: int = Field(10_000, ge=0, description="Stored queries kept per collection; the oldest go first.")

    @model_validator(mode="after")
    def _pages_agree(self) -> Self:
        if self.page > self.page_max:
            raise ValueError(f"limits.page ({self.page}) must not exceed limits.page_max ({self.page_max})")
        return self


class IndexSettings(BaseModel):
    """How the index is kept: what of it lies in memory, and when that is written to segments."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cache_mb: int = Field(64, ge=0, description="Memory for features that were read lately, in MB; 0 keeps none.")
    flush_submaps: int = Field(
        2_000, ge=1, description="Submaps changed since the last segment that are left in memory; more are written."
    )
    memory_submaps: int = Field(
        5_000, ge=1, description="Changed submaps that a query takes into memory; where there are more, it writes them."
    )
    block_submaps: int = Field(20_000, ge=1, description="Submaps of a segment when it is first written.")
    upkeep_seconds: float = Field(
        1.0, gt=0, le=3600, description="Seconds between two looks at what is to be written or merged."
    )


class JobSettings(BaseModel):
    """How long work is done beside the requests."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    processes: int | None = Field(
        None, ge=1, le=256, description="Processes that describe imported submaps, the service among them; one a core."
    )
    keep_days: float = Field(7.0, gt=0, le=3650, description="Days for which results of finished jobs are kept.")


class SnapshotSettings(BaseModel):
    """How snapshots of the whole database are kept."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    keep: int = Field(5, ge=0, description="Snapshots that are kept; a new one removes the oldest beyond. 0 keeps all.")


class Settings(BaseSettings):
    """The service's settings. Nested ones use two underscores: `URQUHART_LIMITS__BODY_BYTES=1048576`."""

    model_config = SettingsConfigDict(
        env_prefix="URQUHART_", env_nested_delimiter="__", frozen=True, extra="forbid", env_ignore_empty=True
    )

    database: str = Field(
        "urquhart.db", description="Path of the SQLite file, or an URL `sqlite:///path[?mode=ro]`.", min_length=1
    )
    busy_timeout: float = Field(
        10.0, gt=0, le=600, description="Seconds that a write waits for another writer before it answers 503."
    )
    host: str = Field("127.0.0.1", description="Address to listen on.", min_length=1)
    port: int = Field(8420, ge=0, le=65535, description="Port to listen on; 0 takes a free one.")
    insecure: bool = Field(False, description="Serve without API keys on an address that other machines can reach.")
    idempotency_hours: float = Field(
        24.0, gt=0, le=24 * 365, description="Hours for which the answer to a POST with Idempotency-Key is kept."
    )
    docs_url: str = Field(
        "",
        description="Where the documentation is served, linked from the landing page; empty: the service's own /docs.",
    )
    limits: Limits = Field(default_factory=Limits, description="Sizes that requests are held to.")
    index: IndexSettings = Field(default_factory=IndexSettings, description="How the index is kept.")
    jobs: JobSettings = Field(default_factory=JobSettings, description="How long work is done beside the requests.")
    snapshots: SnapshotSettings = Field(default_factory=SnapshotSettings, description="How snapshots are kept.")

    @field_validator("database")
    @classmethod
    def _database_is_a_file(cls, value: str) -> str:
        if "://" in value and not value.startswith(_SQLITE_URL):
            raise ValueError(f"{value!r} is not a SQLite database; give a file path or sqlite:///path")
        path = value.removeprefix(_SQLITE_URL).split("?")[0]
        if path in {"", ":memory:"}:
            raise ValueError("the database must be a file: several connections and processes share it")
        return value

    @property
    def database_path(self) -> Path:
        """The database file."""
        if self.database.startswith(_SQLITE_URL):
            return Path(unquote(self.database.removeprefix(_SQLITE_URL).split("?")[0]))
        return Path(self.database)

    @property
    def database_read_only(self) -> bool:
        """True for `sqlite:///path?mode=ro`: the file is opened without write access."""
        return "mode=ro" in self.database.partition("?")[2].split("&") if "://" in self.database else False
