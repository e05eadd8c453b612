"""The tables of what the service does for its callers: API keys, jobs, and answers that are given again."""

from datetime import datetime
from typing import Any

from sqlalchemy import Index, Integer, LargeBinary, Text, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from server.store.columns import KEYS_ONCE, STRICT, BaseRow, Flag, Instant, Json, are_moments, holds_json, rule


class KeyRow(BaseRow):
    """An API key: its secret is not here, only the SHA-256 of it. `id` is the part of the key that may be shown."""

    __tablename__ = "api_keys"
    __table_args__ = (
        rule("whole_digest", "length(digest) = 32"),
        holds_json("scopes", "array"),
        holds_json("patterns", "array"),
        rule("scopes_and_patterns", "scopes <> '[]' AND patterns <> '[]'"),
        are_moments("created", "expires", "revoked"),
        STRICT,
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    id: Mapped[str] = mapped_column(Text, unique=True)
    name: Mapped[str] = mapped_column(Text)
    digest: Mapped[bytes] = mapped_column(LargeBinary)
    scopes: Mapped[list[str]] = mapped_column(Json)
    patterns: Mapped[list[str]] = mapped_column(Json)
    created: Mapped[datetime] = mapped_column(Instant)
    expires: Mapped[datetime | None] = mapped_column(Instant)
    revoked: Mapped[datetime | None] = mapped_column(Instant)


class JobRow(BaseRow):
    """Long work. It outlives the process that took it; a lock on a file tells whether somebody is at it.

    `collection_id` is a name, not a reference: the job is still listed when the collection is gone.
    """

    __tablename__ = "jobs"
    __table_args__ = (
        Index(None, "state", "key"),
        Index(None, "collection_id", "key"),
        rule("known_state", "state IN ('accepted', 'running', 'successful', 'failed', 'dismissed')"),
        rule("time_of_its_end", "(state IN ('successful', 'failed', 'dismissed')) = (finished IS NOT NULL)"),
        rule("time_of_its_start", "state <> 'running' OR started IS NOT NULL"),
        # `done` may be more than `total`: earlier versions counted what others stored during a job only there.
        rule("counts_from_zero", "done >= 0 AND (total IS NULL OR total >= 0)"),
        rule("dismissed_or_not", "dismissed IN (0, 1)"),
        holds_json("parameters", "object"),
        holds_json("counts", "object"),
        holds_json("progress", "object"),
        holds_json("problem", "object", optional=True),
        are_moments("created", "started", "finished"),
        KEYS_ONCE,
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    id: Mapped[str] = mapped_column(Text, unique=True)
    kind: Mapped[str] = mapped_column(Text)
    collection_id: Mapped[str] = mapped_column(Text)
    collection_key: Mapped[int] = mapped_column(Integer)
    caller: Mapped[str] = mapped_column(Text)
    state: Mapped[str] = mapped_column(Text)
    parameters: Mapped[dict[str, Any]] = mapped_column(Json)
    total: Mapped[int | None] = mapped_column(Integer)
    done: Mapped[int] = mapped_column(Integer)
    counts: Mapped[dict[str, int]] = mapped_column(Json)
    # Where a restart goes on: what of the input is done, and how much of the results is written.
    progress: Mapped[dict[str, Any]] = mapped_column(Json)
    problem: Mapped[dict[str, Any] | None] = mapped_column(Json)
    dismissed: Mapped[bool] = mapped_column(Flag)
    created: Mapped[datetime] = mapped_column(Instant)
    started: Mapped[datetime | None] = mapped_column(Instant)
    finished: Mapped[datetime | None] = mapped_column(Instant)


class IdempotencyRow(BaseRow):
    """The answer to a POST that carried an Idempotency-Key, written with what the POST did, to be given again."""

    __tablename__ = "idempotency"
    __table_args__ = (
        UniqueConstraint("caller", "operation", "name"),
        Index(None, "created"),
        rule("status_of_an_answer", "status BETWEEN 200 AND 599"),
        rule("whole_digest", "length(digest) = 64"),
        rule("length_of_its_name", "length(name) BETWEEN 1 AND 255"),
        holds_json("headers", "object"),
        are_moments("created"),
        STRICT,
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    caller: Mapped[str] = mapped_column(Text)
    operation: Mapped[str] = mapped_column(Text)
    name: Mapped[str] = mapped_column(Text)
    digest: Mapped[str] = mapped_column(Text)
    status: Mapped[int] = mapped_column(Integer)
    headers: Mapped[dict[str, str]] = mapped_column(Json)
    body: Mapped[bytes] = mapped_column(LargeBinary)
    created: Mapped[datetime] = mapped_column(Instant)
