"""Constraints between submaps are rows, and so is which submaps were searched for them."""

from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the tables and their indexes."""
    for statement in STATEMENTS:
        op.execute(statement)


STATEMENTS = (
    """
    CREATE TABLE constraints (
        key INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
        collection_key INTEGER NOT NULL,
        kind TEXT NOT NULL,
        search TEXT NOT NULL,
        from_id TEXT NOT NULL,
        to_id TEXT NOT NULL,
        from_revision INTEGER NOT NULL,
        to_revision INTEGER NOT NULL,
        source TEXT NOT NULL,
        source_id TEXT,
        refused TEXT,
        refused_by TEXT,
        created INTEGER NOT NULL,
        content TEXT NOT NULL,
        CONSTRAINT uq_constraints_collection_key_kind_search_from_id_to_id
            UNIQUE (collection_key, kind, search, from_id, to_id),
        CONSTRAINT ck_constraints_known_kind CHECK (kind IN ('match', 'odometry')),
        CONSTRAINT ck_constraints_known_source CHECK (source IN ('job', 'query', 'posted')),
        CONSTRAINT ck_constraints_search_of_a_match CHECK ((kind = 'match') = (search <> '')),
        CONSTRAINT ck_constraints_two_submaps CHECK (from_id <> to_id),
        CONSTRAINT ck_constraints_revisions_from_one CHECK (min(from_revision, to_revision) > 0),
        CONSTRAINT ck_constraints_known_refusal CHECK (refused IS NULL
            OR refused IN ('contradicted', 'unconfirmed', 'undecided')),
        CONSTRAINT ck_constraints_refused_by_a_map CHECK (refused IS NULL OR refused_by IS NOT NULL),
        CONSTRAINT ck_constraints_content_is_json CHECK (iif(json_valid(content), json_type(content) = 'object', 0)),
        CONSTRAINT ck_constraints_moments_in_range CHECK (created BETWEEN -62135596800000000 AND 253402300799999999),
        CONSTRAINT fk_constraints_collection_key_collections
            FOREIGN KEY (collection_key) REFERENCES collections (key) ON DELETE CASCADE
    ) STRICT
    """,
    "CREATE INDEX ix_constraints_collection_key ON constraints (collection_key)",
    "CREATE INDEX ix_constraints_collection_key_from_id ON constraints (collection_key, from_id)",
    "CREATE INDEX ix_constraints_collection_key_to_id ON constraints (collection_key, to_id)",
    """
    CREATE TABLE searched_submaps (
        submap_key INTEGER NOT NULL,
        search TEXT NOT NULL,
        collection_key INTEGER NOT NULL,
        content_revision INTEGER NOT NULL,
        CONSTRAINT pk_searched_submaps PRIMARY KEY (submap_key, search),
        CONSTRAINT ck_searched_submaps_revision_from_one CHECK (content_revision > 0),
        CONSTRAINT fk_searched_submaps_submap_key_submaps
            FOREIGN KEY (submap_key) REFERENCES submaps (key) ON DELETE CASCADE,
        CONSTRAINT fk_searched_submaps_collection_key_collections
            FOREIGN KEY (collection_key) REFERENCES collections (key) ON DELETE CASCADE
    ) STRICT
    """,
    "CREATE INDEX ix_searched_submaps_collection_key_search ON searched_submaps (collection_key, search)",
)
