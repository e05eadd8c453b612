"""The tables of constraints between submaps, and of which submaps were searched for them."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, Index, Integer, Text, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from server.store.columns import KEYS_ONCE, STRICT, BaseRow, Instant, Json, are_moments, holds_json, rule


class ConstraintRow(BaseRow):
    """A relative pose of two submaps, which are known by their ids: it outlives them, and is stale then."""

    __tablename__ = "constraints"
    __table_args__ = (
        UniqueConstraint("collection_key", "kind", "search", "from_id", "to_id"),
        Index(None, "collection_key", "from_id"),
        Index(None, "collection_key", "to_id"),
        Index(None, "collection_key"),
        rule("known_kind", "kind IN ('match', 'odometry')"),
        rule("known_source", "source IN ('job', 'query', 'posted')"),
        rule("search_of_a_match", "(kind = 'match') = (search <> '')"),
        rule("two_submaps", "from_id <> to_id"),
        rule("revisions_from_one", "min(from_revision, to_revision) > 0"),
        rule("known_refusal", "refused IS NULL OR refused IN ('contradicted', 'unconfirmed', 'undecided')"),
        rule("refused_by_a_map", "refused IS NULL OR refused_by IS NOT NULL"),
        holds_json("content", "object"),
        are_moments("created"),
        KEYS_ONCE,
    )

    key: Mapped[int] = mapped_column(Integer, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    kind: Mapped[str] = mapped_column(Text)
    search: Mapped[str] = mapped_column(Text)
    from_id: Mapped[str] = mapped_column(Text)
    to_id: Mapped[str] = mapped_column(Text)
    from_revision: Mapped[int] = mapped_column(Integer)
    to_revision: Mapped[int] = mapped_column(Integer)
    source: Mapped[str] = mapped_column(Text)
    source_id: Mapped[str | None] = mapped_column(Text)
    refused: Mapped[str | None] = mapped_column(Text)
    refused_by: Mapped[str | None] = mapped_column(Text)
    created: Mapped[datetime] = mapped_column(Instant)
    content: Mapped[dict[str, Any]] = mapped_column(Json)


class SearchedRow(BaseRow):
    """The landmarks of a submap that a search looked up last, so that it need not look them up again."""

    __tablename__ = "searched_submaps"
    __table_args__ = (
        Index(None, "collection_key", "search"),
        rule("revision_from_one", "content_revision > 0"),
        STRICT,
    )

    submap_key: Mapped[int] = mapped_column(ForeignKey("submaps.key", ondelete="CASCADE"), primary_key=True)
    search: Mapped[str] = mapped_column(Text, primary_key=True)
    collection_key: Mapped[int] = mapped_column(ForeignKey("collections.key", ondelete="CASCADE"))
    content_revision: Mapped[int] = mapped_column(Integer)
