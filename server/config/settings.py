"""Everything that can be set, from a file and `URQUHART_*` in the environment; checked together, at construction."""

from pathlib import Path
from typing import Any, Final, Literal, Self
from urllib.parse import unquote

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator
from pydantic_settings import BaseSettings, InitSettingsSource, PydanticBaseSettingsSource, SettingsConfigDict

from server.config.settings_sources import NESTED, PREFIX, check_environment, config_file, read_file

_SQLITE_URL = "sqlite:///"
STOP_SPARE: Final = 8.0
"""Seconds after `drain_seconds` in which what is cut off ends, jobs are handed back and the database is closed."""


class Limits(BaseModel):
    """Sizes that requests are held to; each is published by `GET /v1/limits` under the name it has here."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    body_bytes: int = Field(8 * 1024 * 1024, ge=1024, description="Largest request body, in bytes.")
    body_values: int = Field(250_000, ge=1024, description="Most arrays and objects in a JSON body.")
    landmarks: int = Field(20_000, ge=3, description="Most landmarks in one submap or query.")
    properties_bytes: int = Field(
        16 * 1024, ge=2, description="Largest `properties` object of a submap, as JSON bytes."
    )
    candidates: int = Field(100, ge=1, description="Largest `limit` of a query.")
    excluded_submaps: int = Field(10_000, ge=1, description="Most submap ids in a query's `exclude`.")
    answer_pairs: int = Field(
        100_000,
        ge=0,
        description="Most landmark pairs (`inliers`) in the answer to a query or batch; further candidates have none.",
    )
    batch_queries: int = Field(200, ge=1, description="Most queries in one batch.")
    query_seconds: float = Field(
        4.5, gt=0, le=3600, description="Seconds in which a query is worked on; it is answered with what was found."
    )
    batch_seconds: float = Field(
        4.5, gt=0, le=3600, description="Seconds in which a batch is worked on; the queries left then are not asked."
    )
    unfinished_jobs: int = Field(
        20, ge=1, description="Most unfinished jobs of one key, or of all callers without one; more are answered 429."
    )
    import_bytes: int = Field(8 * 1024**3, ge=1024, description="Largest import, in bytes, unpacked.")
    import_lines: int = Field(2_000_000, ge=1, description="Most lines of an import, blank ones among them.")
    import_line_seconds: float = Field(
        30.0, gt=0, le=3600, description="Seconds that describing one line of an import may take; then it is refused."
    )
    import_refusal_bytes: int = Field(
        8 * 1024 * 1024,
        ge=0,
        description="Bytes of an import's results that tell of refused lines one by one; further ones are counted.",
    )
    import_all_lines: int = Field(20_000, ge=1, description="Most lines of an import that stores all or none.")
    import_all_bytes: int = Field(
        256 * 1024 * 1024, ge=1024, description="Largest import that stores all or none, in bytes, unpacked."
    )
    page: int = Field(100, ge=1, description="Rows of a page when `limit` is not given.")
    page_max: int = Field(1000, ge=1, description="Largest `limit` of a page.")
    page_bytes: int = Field(
        4 * 1024 * 1024,
        ge=1024,
        description="Bytes of a page of submaps, about; a larger one ends early, and `next` goes on.",
    )
    stored_queries: int = Field(10_000, ge=0, description="Stored queries kept per collection; the oldest go first.")
    concurrent_requests: int = Field(
        32, ge=1, le=100, description="Requests that a process works on at once; more wait in the queue."
    )
    key_requests: int = Field(
        0,
        ge=0,
        le=100,
        description="Requests of one key, or of one address without one, that a process works on at once while others "
        "ask, too; 0: one fewer than there are cores, at least 1.",
    )
    queued_requests: int = Field(256, ge=0, description="Requests that wait in a process; more are answered 503.")
    queue_seconds: float = Field(
        5.0, gt=0, le=600, description="Seconds that a request waits before it is answered 503."
    )
    waits: int = Field(
        500, ge=0, description="Requests that wait for the end of a job in a process; more are answered at once."
    )
    key_waits: int = Field(
        100, ge=0, description="Those of one key, or of one address without one; more are answered at once."
    )
    unsent_bytes: int = Field(
        256 * 1024 * 1024,
        ge=1024,
        description="Bytes of answers that a process holds until they are read; beyond, the callers that have read "
        "nothing for longest are cut off.",
    )
    requests_per_second: float = Field(
        0.0, ge=0, description="Requests a second of one key, or of one address without a key, in a process; 0: any."
    )
    connections: int = Field(
        1000, ge=2, description="Open connections of a process; for one more the longest idle one is closed."
    )
    idle_seconds: float = Field(
        75.0,
        gt=0,
        le=3600,
        description="Seconds for which a connection is kept after an answer; callers should keep theirs for less.",
    )
    header_seconds: float = Field(
        10.0, gt=0, le=3600, description="Seconds within which the head of a request must arrive; then it is 408."
    )
    body_seconds: float = Field(
        20.0,
        gt=0,
        le=3600,
        description="Seconds within which a body must arrive, apart from `body_rate`; then it is 408.",
    )
    body_rate: int = Field(
        16 * 1024, ge=1, description="Bytes a second: each that arrives gives the body 1 / `body_rate` seconds more."
    )
    buffered_bytes: int = Field(
        256 * 1024 * 1024, ge=1024, description="Bytes of bodies that a process holds at once; more are answered 503."
    )

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
    maintenance_seconds: float = Field(
        1.0, gt=0, le=3600, description="Seconds between two looks at what is to be written or merged."
    )


class JobSettings(BaseModel):
    """How long work is done beside the requests."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    processes: int | None = Field(
        None, ge=1, le=256, description="Processes that describe imported submaps, the service among them; one a core."
    )
    slice_seconds: float = Field(
        5.0,
        gt=0,
        le=3600,
        description="Seconds after which a job gives way while one of another key, or on another collection, waits.",
    )
    keep_days: float = Field(7.0, gt=0, le=3650, description="Days for which results of finished jobs are kept.")
    keep_rows: int = Field(10_000, ge=1, description="Finished jobs that are listed; the oldest are forgotten first.")


class LogSettings(BaseModel):
    """What is written to standard error, and how."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal["text", "json"] = Field("text", description="A line for people, or a JSON object in a line.")
    level: Literal["debug", "info", "warning", "error"] = Field(
        "info",
        description="The least level that is written; the line of each request is `info`, or `warning` from 500 on.",
    )


class SnapshotSettings(BaseModel):
    """How snapshots of the whole database are kept."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    keep: int = Field(5, ge=0, description="Snapshots that are kept; a new one removes the oldest beyond. 0 keeps all.")


class Settings(BaseSettings):
    """The service's settings. Nested ones use two underscores: `URQUHART_LIMITS__BODY_BYTES=1048576`.

    Raises `sources.Misconfigured` for names that are no setting, besides what pydantic raises for values.
    """

    model_config = SettingsConfigDict(
        env_prefix=PREFIX, env_nested_delimiter=NESTED, frozen=True, extra="forbid", env_ignore_empty=True
    )

    config: str = Field("", description="The settings file, TOML; empty: `urquhart.toml`, where it is there.")
    database: str = Field(
        "urquhart.db", description="Path of the SQLite file, or an URL `sqlite:///path[?mode=ro]`.", min_length=1
    )
    busy_timeout: float = Field(
        10.0, gt=0, le=600, description="Seconds that a write waits for another writer before it answers 503."
    )
    host: str = Field("127.0.0.1", description="Address to listen on.", min_length=1)
    port: int = Field(8420, ge=0, le=65535, description="Port to listen on; 0 takes a free one.")
    allowed_hosts: str = Field(
        "",
        description="Host names under which the service answers, and whose pages may call it, separated by commas; "
        "`*` for any. Empty: localhost and the address it is reached at, and any name once it asks for keys.",
    )
    insecure: bool = Field(False, description="Serve without API keys on an address that other machines can reach.")
    idempotency_hours: float = Field(
        24.0, gt=0, le=24 * 365, description="Hours for which the answer to a POST with Idempotency-Key is kept."
    )
    docs_url: str = Field(
        "",
        description="Where the documentation is served, linked from the landing page; empty: the service's own /docs.",
    )
    notice_seconds: float = Field(
        1.0,
        ge=0,
        le=600,
        description="Seconds after SIGTERM for which requests are still taken while /readyz says 503; "
        "more than the interval of what watches it.",
    )
    drain_seconds: float = Field(
        15.0,
        ge=0,
        le=3600,
        description="Seconds that requests in progress have to finish when the service ends; then they are cut off.",
    )
    metrics_collections: int = Field(
        20, ge=0, le=1000, description="Collections that metrics tell by name, the largest; the rest is `other`."
    )
    log: LogSettings = Field(default_factory=LogSettings, description="What is written to standard error, and how.")
    limits: Limits = Field(default_factory=Limits, description="Sizes and times that requests are held to.")
    index: IndexSettings = Field(default_factory=IndexSettings, description="How the index is kept.")
    jobs: JobSettings = Field(default_factory=JobSettings, description="How long work is done beside the requests.")
    snapshots: SnapshotSettings = Field(default_factory=SnapshotSettings, description="How snapshots are kept.")

    @property
    def stop_seconds(self) -> float:
        """Seconds after SIGTERM within which the service has ended, whatever is in progress."""
        return self.notice_seconds + self.drain_seconds + STOP_SPARE

    @field_validator("database")
    @classmethod
    def _database_is_a_file(cls, value: str) -> str:
        if "://" in value and not value.startswith(_SQLITE_URL):
            raise ValueError(f"{value!r} is not a SQLite database; give a file path or sqlite:///path")
        path = value.removeprefix(_SQLITE_URL).split("?")[0]
        if path in {"", ":memory:"}:
            raise ValueError("the database must be a file, because several connections and processes share it")
        return value

    @field_validator("allowed_hosts")
    @classmethod
    def _hosts_are_names(cls, value: str) -> str:
        for name in value.split(","):
            if "/" in name or (":" in name and name.count(":") == 1):
                raise ValueError(f"{name.strip()!r} is not a host name; leave out scheme and port")
        return value

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """What is given goes before the environment, and that before the file. Raises Misconfigured."""
        check_environment(cls)
        given: dict[str, Any] = getattr(init_settings, "init_kwargs", {})
        path = config_file(given.get("config"))
        values = {} if path is None else read_file(path, cls)
        return init_settings, env_settings, InitSettingsSource(settings_cls, init_kwargs=values)

    @property
    def host_names(self) -> tuple[str, ...]:
        """The names in `allowed_hosts`."""
        return tuple(name for part in self.allowed_hosts.split(",") if (name := part.strip().strip("[]")))

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
