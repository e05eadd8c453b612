"""The settings: from a file and from `URQUHART_*` in the environment, validated together when they are read."""

from pathlib import Path
from typing import Any, Final, Self
from urllib.parse import unquote

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator
from pydantic_settings import BaseSettings, InitSettingsSource, PydanticBaseSettingsSource, SettingsConfigDict

from server.config.file_and_environment import NESTED, PREFIX, check_environment, config_file, read_file
from server.config.settings_groups import IndexSettings, JobSettings, LogSettings, SnapshotSettings

_SQLITE_URL = "sqlite:///"
STOP_SPARE: Final = 8.0
"""Seconds after `drain_seconds` for ending requests that were cut off, handing back jobs and closing the database."""


class Limits(BaseModel):
    """Limits of requests. `GET /v1/limits` publishes each under its name here."""

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
        description="Most landmark pairs (`inliers`) in the answer to a query or batch. Candidates beyond have none.",
    )
    batch_queries: int = Field(200, ge=1, description="Most queries in one batch.")
    query_seconds: float = Field(
        4.5,
        gt=0,
        le=3600,
        description="Longest time for one query, in seconds. At the deadline it is answered with what was found so "
        "far.",
    )
    batch_seconds: float = Field(
        4.5,
        gt=0,
        le=3600,
        description="Longest time for one batch, in seconds. Queries that have not begun by then are not answered.",
    )
    unfinished_jobs: int = Field(
        20,
        ge=1,
        description="Most unfinished jobs of one key, or of all callers without a key. Another one is answered with "
        "429.",
    )
    import_bytes: int = Field(8 * 1024**3, ge=1024, description="Largest import, in bytes when unpacked.")
    import_lines: int = Field(2_000_000, ge=1, description="Most lines in an import, including blank ones.")
    import_line_seconds: float = Field(
        30.0,
        gt=0,
        le=3600,
        description="Longest time to describe one line of an import, in seconds. A line that takes longer is refused.",
    )
    import_refusal_bytes: int = Field(
        8 * 1024 * 1024,
        ge=0,
        description="Bytes of an import's results for refused lines. Refused lines beyond are only counted.",
    )
    import_all_lines: int = Field(20_000, ge=1, description="Most lines in an import with `mode=all`.")
    import_all_bytes: int = Field(
        256 * 1024 * 1024, ge=1024, description="Largest import with `mode=all`, in bytes when unpacked."
    )
    page_default: int = Field(100, ge=1, description="Rows on a page if the request has no `limit`.")
    page_max: int = Field(1000, ge=1, description="Largest `limit` of a page.")
    page_bytes: int = Field(
        4 * 1024 * 1024,
        ge=1024,
        description="Approximate largest page of submaps, in bytes. A page that would be larger ends early, with "
        "`next`.",
    )
    stored_queries: int = Field(
        10_000, ge=0, description="Stored queries that are kept in each collection. The oldest are deleted first."
    )
    concurrent_requests: int = Field(
        32, ge=1, le=100, description="Most requests that a process works on at once. Further requests wait."
    )
    key_requests: int = Field(
        0,
        ge=0,
        le=100,
        description="Most requests of one key, or of one address without a key, that a process works on at once while "
        "other callers wait. 0: one less than the number of cores, but at least 1.",
    )
    queued_requests: int = Field(
        256, ge=0, description="Most requests that wait in a process. Further requests are answered with 503."
    )
    queue_seconds: float = Field(
        5.0, gt=0, le=600, description="Longest time that a request waits, in seconds. Then it is answered with 503."
    )
    job_waits: int = Field(
        500,
        ge=0,
        description="Most requests that wait for the end of a job (`wait`) in a process. Further ones are answered at "
        "once.",
    )
    key_job_waits: int = Field(
        100,
        ge=0,
        description="Most requests of one key, or of one address without a key, that wait for the end of a job in a "
        "process. Further ones are answered at once.",
    )
    unsent_bytes: int = Field(
        256 * 1024 * 1024,
        ge=1024,
        description="Most bytes of answers that a process keeps until callers have read them. Beyond, the callers that "
        "have read nothing for longest are disconnected.",
    )
    requests_per_second: float = Field(
        0.0,
        ge=0,
        description="Most requests per second of one key, or of one address without a key, in a process. 0: no limit.",
    )
    connections: int = Field(
        1000,
        ge=2,
        description="Most open connections of a process. Another one replaces the connection that was idle for "
        "longest.",
    )
    idle_seconds: float = Field(
        75.0,
        gt=0,
        le=3600,
        description="Seconds that an idle connection stays open after an answer. Clients should close theirs sooner.",
    )
    header_seconds: float = Field(
        10.0,
        gt=0,
        le=3600,
        description="Seconds within which the head of a request must arrive. Then it is answered with 408.",
    )
    body_seconds: float = Field(
        20.0,
        gt=0,
        le=3600,
        description="Seconds within which a body must arrive, plus the time that `body_rate` adds. Then it is answered "
        "with 408.",
    )
    body_rate: int = Field(
        16 * 1024,
        ge=1,
        description="Slowest rate of a body after `body_seconds`, in bytes per second: each byte that arrives adds 1 / "
        "`body_rate` seconds.",
    )
    buffered_bytes: int = Field(
        256 * 1024 * 1024,
        ge=1024,
        description="Most bytes of request bodies in the memory of a process. Further requests are answered with 503.",
    )

    @model_validator(mode="after")
    def _pages_agree(self) -> Self:
        if self.page_default > self.page_max:
            raise ValueError(
                f"limits.page_default ({self.page_default}) must not exceed limits.page_max ({self.page_max})"
            )
        return self


class Settings(BaseSettings):
    """The service's settings. Names of nested ones have two underscores: `URQUHART_LIMITS__BODY_BYTES=1048576`.

    Raises `settings_sources.Misconfigured` for an unknown name, and what pydantic raises for an invalid value.
    """

    model_config = SettingsConfigDict(
        env_prefix=PREFIX, env_nested_delimiter=NESTED, frozen=True, extra="forbid", env_ignore_empty=True
    )

    config: str = Field(
        "", description="The settings file, in TOML. Empty: `urquhart.toml` in the working folder, if it exists."
    )
    database: str = Field(
        "urquhart.db", description="Path of the SQLite file, or a URL `sqlite:///path[?mode=ro]`.", min_length=1
    )
    busy_timeout_seconds: float = Field(
        10.0, gt=0, le=600, description="Seconds that a write waits for another writer. Then it is answered with 503."
    )
    host: str = Field("127.0.0.1", description="Address to listen on.", min_length=1)
    port: int = Field(8420, ge=0, le=65535, description="Port to listen on. 0: any free one.")
    workers: int = Field(
        1, ge=1, le=64, description="Number of processes that answer requests; one for each core is best."
    )
    allowed_hosts: str = Field(
        "",
        description="Host names under which the service may be called, and whose web pages may call it, separated by "
        "commas. `*`: any. Empty: localhost and the service's own address, or any name if the service has keys.",
    )
    insecure: bool = Field(False, description="Serve without API keys on an address that other machines can reach.")
    idempotency_hours: float = Field(
        24.0,
        gt=0,
        le=24 * 365,
        description="Hours for which the answer to a request with an `Idempotency-Key` is kept.",
    )
    docs_url: str = Field(
        "",
        description="Address of the documentation that the landing page links to. Empty: the service's own /docs.",
    )
    shutdown_delay_seconds: float = Field(
        1.0,
        ge=0,
        le=600,
        description="Seconds after SIGTERM during which requests are still accepted while /readyz answers 503. It "
        "should be longer than the interval at which a load balancer reads /readyz.",
    )
    drain_seconds: float = Field(
        15.0,
        ge=0,
        le=3600,
        description="Seconds that requests in progress have to finish when the service stops. Then they are cut off.",
    )
    metrics_collections: int = Field(
        20,
        ge=0,
        le=1000,
        description="Number of collections that metrics list by name, the largest first. The rest is `other`.",
    )
    log: LogSettings = Field(default_factory=LogSettings, description="What is written to standard error, and how.")
    limits: Limits = Field(default_factory=Limits, description="Limits of requests: sizes, times and numbers.")
    index: IndexSettings = Field(default_factory=IndexSettings, description="The index.")
    jobs: JobSettings = Field(default_factory=JobSettings, description="Jobs.")
    snapshots: SnapshotSettings = Field(default_factory=SnapshotSettings, description="Snapshots.")

    @property
    def stop_seconds(self) -> float:
        """Seconds after SIGTERM within which the service stops, whatever is in progress."""
        return self.shutdown_delay_seconds + self.drain_seconds + STOP_SPARE

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
        """Arguments take precedence over the environment, and the environment over the file. Raises Misconfigured."""
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
