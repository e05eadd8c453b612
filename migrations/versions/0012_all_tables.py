"""All tables. Databases of the schemas 0001 to 0011 are copied into them: see server/store/sqlite/upgrade."""

from alembic import op

revision = "0012"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the tables and their indexes."""
    for statement in STATEMENTS:
        op.execute(statement)


STATEMENTS = (
    """
    CREATE TABLE collections (
        key INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
        id TEXT NOT NULL,
        title TEXT,
        config TEXT NOT NULL,
        fingerprint TEXT NOT NULL,
        crs TEXT,
        origin_x REAL,
        origin_y REAL,
        revision INTEGER NOT NULL,
        submap_count INTEGER NOT NULL,
        landmark_count INTEGER NOT NULL,
        polygon_count INTEGER NOT NULL,
        query_sequence INTEGER NOT NULL,
        pruned_revision INTEGER NOT NULL,
        created INTEGER NOT NULL,
        updated INTEGER NOT NULL,
        CONSTRAINT ck_collections_counts_from_zero CHECK (min(revision, submap_count, landmark_count,
            polygon_count, query_sequence, pruned_revision) >= 0),
        CONSTRAINT ck_collections_pruned_up_to_its_revision CHECK (pruned_revision <= revision),
        CONSTRAINT ck_collections_whole_origin CHECK ((origin_x IS NULL) = (origin_y IS NULL)),
        CONSTRAINT ck_collections_config_is_json CHECK (iif(json_valid(config), json_type(config) = 'object', 0)),
        CONSTRAINT ck_collections_moments_in_range CHECK (created BETWEEN -62135596800000000
            AND 253402300799999999 AND updated BETWEEN -62135596800000000 AND 253402300799999999),
        CONSTRAINT uq_collections_id UNIQUE (id)
    ) STRICT
    """,
    """
    CREATE TABLE stands (
        key INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
        collection_key INTEGER NOT NULL,
        name TEXT NOT NULL,
        frame_id TEXT NOT NULL,
        source_hash TEXT NOT NULL,
        trees_hash TEXT NOT NULL,
        tree_count INTEGER NOT NULL,
        radius REAL NOT NULL,
        spacing REAL NOT NULL,
        created INTEGER NOT NULL,
        updated INTEGER NOT NULL,
        CONSTRAINT uq_stands_collection_key_name UNIQUE (collection_key, name),
        CONSTRAINT uq_stands_collection_key_key UNIQUE (collection_key, key),
        CONSTRAINT ck_stands_sizes_of_a_grid CHECK (tree_count >= 0 AND radius > 0 AND spacing > 0),
        CONSTRAINT ck_stands_moments_in_range CHECK (created BETWEEN -62135596800000000 AND 253402300799999999
            AND updated BETWEEN -62135596800000000 AND 253402300799999999),
        CONSTRAINT fk_stands_collection_key_collections FOREIGN KEY (collection_key)
            REFERENCES collections (key) ON DELETE CASCADE
    ) STRICT
    """,
    """
    CREATE TABLE submaps (
        key INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
        collection_key INTEGER NOT NULL,
        id TEXT NOT NULL,
        frame_id TEXT,
        session TEXT,
        stamp INTEGER,
        landmark_count INTEGER NOT NULL,
        polygon_count INTEGER NOT NULL,
        counts TEXT NOT NULL,
        map_frame_id TEXT,
        map_x REAL,
        map_y REAL,
        map_yaw REAL,
        map_covariance TEXT,
        map_min_x REAL,
        map_min_y REAL,
        map_max_x REAL,
        map_max_y REAL,
        map_width REAL GENERATED ALWAYS AS (map_max_x - map_min_x) VIRTUAL,
        properties TEXT,
        stand_key INTEGER,
        landmarks_hash TEXT NOT NULL,
        etag TEXT NOT NULL,
        revision INTEGER NOT NULL,
        content_revision INTEGER NOT NULL,
        created INTEGER NOT NULL,
        updated INTEGER NOT NULL,
        landmarks BLOB NOT NULL,
        landmark_ids BLOB,
        attributes BLOB,
        features BLOB NOT NULL,
        CONSTRAINT uq_submaps_collection_key_id UNIQUE (collection_key, id),
        CONSTRAINT fk_submaps_collection_key_stand_key_stands FOREIGN KEY (collection_key, stand_key)
            REFERENCES stands (collection_key, key),
        CONSTRAINT ck_submaps_whole_map_pose CHECK ((map_frame_id IS NULL) + (map_x IS NULL) + (map_y IS NULL)
            + (map_yaw IS NULL) + (map_min_x IS NULL) + (map_min_y IS NULL) + (map_max_x IS NULL)
            + (map_max_y IS NULL) IN (0, 8) AND (map_covariance IS NULL OR map_frame_id IS NOT NULL)),
        CONSTRAINT ck_submaps_map_box_in_order CHECK (map_min_x <= map_max_x AND map_min_y <= map_max_y),
        CONSTRAINT ck_submaps_counts_from_zero CHECK (polygon_count >= 0),
        CONSTRAINT ck_submaps_positions_of_every_landmark CHECK (length(landmarks) = 16 * landmark_count),
        CONSTRAINT ck_submaps_revisions_in_order CHECK (0 < content_revision AND content_revision <= revision),
        CONSTRAINT ck_submaps_counts_is_json CHECK (iif(json_valid(counts), json_type(counts) = 'object', 0)),
        CONSTRAINT ck_submaps_map_covariance_is_json
            CHECK (map_covariance IS NULL OR iif(json_valid(map_covariance), json_type(map_covariance) = 'array', 0)),
        CONSTRAINT ck_submaps_properties_is_json CHECK (properties IS NULL OR iif(json_valid(properties),
            json_type(properties) = 'object', 0)),
        CONSTRAINT ck_submaps_landmark_ids_is_json
            CHECK (landmark_ids IS NULL OR json_valid(CAST(landmark_ids AS TEXT))),
        CONSTRAINT ck_submaps_attributes_is_json CHECK (attributes IS NULL OR json_valid(CAST(attributes AS TEXT))),
        CONSTRAINT ck_submaps_moments_in_range CHECK (stamp BETWEEN -62135596800000000 AND 253402300799999999
            AND created BETWEEN -62135596800000000 AND 253402300799999999
            AND updated BETWEEN -62135596800000000 AND 253402300799999999),
        CONSTRAINT fk_submaps_collection_key_collections FOREIGN KEY (collection_key)
            REFERENCES collections (key) ON DELETE CASCADE
    ) STRICT
    """,
    "CREATE INDEX ix_submaps_collection_key ON submaps (collection_key)",
    "CREATE INDEX ix_submaps_collection_key_content_revision ON submaps (collection_key, content_revision)",
    """
    CREATE INDEX ix_submaps_collection_key_session_stamp_landmark_count
        ON submaps (collection_key, session, stamp, landmark_count)
    """,
    "CREATE INDEX ix_submaps_collection_key_stamp ON submaps (collection_key, stamp)",
    """
    CREATE INDEX ix_submaps_collection_key_stand_key
        ON submaps (collection_key, stand_key) WHERE stand_key IS NOT NULL
    """,
    """
    CREATE INDEX ix_submaps_footprint
        ON submaps (collection_key, map_frame_id, map_min_x, map_min_y, map_max_x, map_max_y)
    """,
    "CREATE INDEX ix_submaps_width ON submaps (collection_key, map_frame_id, map_width)",
    """
    CREATE TABLE map_frames (
        collection_key INTEGER NOT NULL,
        frame_id TEXT NOT NULL,
        crs TEXT NOT NULL,
        origin_x REAL,
        origin_y REAL,
        CONSTRAINT pk_map_frames PRIMARY KEY (collection_key, frame_id),
        CONSTRAINT ck_map_frames_whole_origin CHECK ((origin_x IS NULL) = (origin_y IS NULL)),
        CONSTRAINT fk_map_frames_collection_key_collections FOREIGN KEY (collection_key)
            REFERENCES collections (key) ON DELETE CASCADE
    ) STRICT
    """,
    """
    CREATE TABLE deletions (
        submap_key INTEGER NOT NULL,
        collection_key INTEGER NOT NULL,
        revision INTEGER NOT NULL,
        CONSTRAINT pk_deletions PRIMARY KEY (submap_key),
        CONSTRAINT ck_deletions_revision_from_one CHECK (revision > 0),
        CONSTRAINT fk_deletions_collection_key_collections FOREIGN KEY (collection_key)
            REFERENCES collections (key) ON DELETE CASCADE
    ) STRICT
    """,
    "CREATE INDEX ix_deletions_collection_key_revision ON deletions (collection_key, revision)",
    """
    CREATE TABLE segments (
        key INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
        collection_key INTEGER NOT NULL,
        name TEXT NOT NULL,
        since INTEGER NOT NULL,
        revision INTEGER NOT NULL,
        submaps INTEGER NOT NULL,
        bytes INTEGER NOT NULL,
        created INTEGER NOT NULL,
        CONSTRAINT ck_segments_revisions_in_order CHECK (0 <= since AND since < revision),
        CONSTRAINT ck_segments_counts_from_zero CHECK (submaps >= 0 AND bytes >= 0),
        CONSTRAINT ck_segments_moments_in_range CHECK (created BETWEEN -62135596800000000 AND 253402300799999999),
        CONSTRAINT fk_segments_collection_key_collections FOREIGN KEY (collection_key)
            REFERENCES collections (key) ON DELETE CASCADE,
        CONSTRAINT uq_segments_name UNIQUE (name)
    ) STRICT
    """,
    "CREATE INDEX ix_segments_collection_key_since ON segments (collection_key, since)",
    """
    CREATE TABLE queries (
        key INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
        collection_key INTEGER NOT NULL,
        number INTEGER NOT NULL,
        created INTEGER NOT NULL,
        candidates TEXT NOT NULL,
        landmarks BLOB NOT NULL,
        landmark_ids BLOB,
        answer BLOB NOT NULL,
        CONSTRAINT uq_queries_collection_key_number UNIQUE (collection_key, number),
        CONSTRAINT ck_queries_number_from_one CHECK (number > 0),
        CONSTRAINT ck_queries_whole_positions CHECK (length(landmarks) % 16 = 0),
        CONSTRAINT ck_queries_candidates_is_json CHECK (iif(json_valid(candidates),
            json_type(candidates) = 'array', 0)),
        CONSTRAINT ck_queries_landmark_ids_is_json
            CHECK (landmark_ids IS NULL OR json_valid(CAST(landmark_ids AS TEXT))),
        CONSTRAINT ck_queries_answer_is_json CHECK (json_valid(CAST(answer AS TEXT))),
        CONSTRAINT ck_queries_moments_in_range CHECK (created BETWEEN -62135596800000000 AND 253402300799999999),
        CONSTRAINT fk_queries_collection_key_collections FOREIGN KEY (collection_key)
            REFERENCES collections (key) ON DELETE CASCADE
    ) STRICT
    """,
    """
    CREATE TABLE api_keys (
        key INTEGER NOT NULL,
        id TEXT NOT NULL,
        name TEXT NOT NULL,
        digest BLOB NOT NULL,
        scopes TEXT NOT NULL,
        patterns TEXT NOT NULL,
        created INTEGER NOT NULL,
        expires INTEGER,
        revoked INTEGER,
        CONSTRAINT pk_api_keys PRIMARY KEY (key),
        CONSTRAINT ck_api_keys_whole_digest CHECK (length(digest) = 32),
        CONSTRAINT ck_api_keys_scopes_is_json CHECK (iif(json_valid(scopes), json_type(scopes) = 'array', 0)),
        CONSTRAINT ck_api_keys_patterns_is_json CHECK (iif(json_valid(patterns), json_type(patterns) = 'array', 0)),
        CONSTRAINT ck_api_keys_scopes_and_patterns CHECK (scopes <> '[]' AND patterns <> '[]'),
        CONSTRAINT ck_api_keys_moments_in_range CHECK (created BETWEEN -62135596800000000
            AND 253402300799999999 AND expires BETWEEN -62135596800000000 AND 253402300799999999
            AND revoked BETWEEN -62135596800000000 AND 253402300799999999),
        CONSTRAINT uq_api_keys_id UNIQUE (id)
    ) STRICT
    """,
    """
    CREATE TABLE jobs (
        key INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
        id TEXT NOT NULL,
        kind TEXT NOT NULL,
        collection_id TEXT NOT NULL,
        collection_key INTEGER NOT NULL,
        caller TEXT NOT NULL,
        state TEXT NOT NULL,
        parameters TEXT NOT NULL,
        total INTEGER,
        done INTEGER NOT NULL,
        counts TEXT NOT NULL,
        progress TEXT NOT NULL,
        problem TEXT,
        dismissed INTEGER NOT NULL,
        created INTEGER NOT NULL,
        started INTEGER,
        finished INTEGER,
        CONSTRAINT ck_jobs_known_state CHECK (state IN ('accepted', 'running', 'successful', 'failed', 'dismissed')),
        CONSTRAINT ck_jobs_time_of_its_end CHECK ((state IN ('successful', 'failed',
            'dismissed')) = (finished IS NOT NULL)),
        CONSTRAINT ck_jobs_time_of_its_start CHECK (state <> 'running' OR started IS NOT NULL),
        CONSTRAINT ck_jobs_counts_from_zero CHECK (done >= 0 AND (total IS NULL OR total >= 0)),
        CONSTRAINT ck_jobs_dismissed_or_not CHECK (dismissed IN (0, 1)),
        CONSTRAINT ck_jobs_parameters_is_json CHECK (iif(json_valid(parameters), json_type(parameters) = 'object', 0)),
        CONSTRAINT ck_jobs_counts_is_json CHECK (iif(json_valid(counts), json_type(counts) = 'object', 0)),
        CONSTRAINT ck_jobs_progress_is_json CHECK (iif(json_valid(progress), json_type(progress) = 'object', 0)),
        CONSTRAINT ck_jobs_problem_is_json CHECK (problem IS NULL OR iif(json_valid(problem),
            json_type(problem) = 'object', 0)),
        CONSTRAINT ck_jobs_moments_in_range CHECK (created BETWEEN -62135596800000000 AND 253402300799999999
            AND started BETWEEN -62135596800000000 AND 253402300799999999
            AND finished BETWEEN -62135596800000000 AND 253402300799999999),
        CONSTRAINT uq_jobs_id UNIQUE (id)
    ) STRICT
    """,
    "CREATE INDEX ix_jobs_collection_id_key ON jobs (collection_id, key)",
    "CREATE INDEX ix_jobs_state_key ON jobs (state, key)",
    """
    CREATE TABLE idempotency (
        key INTEGER NOT NULL,
        caller TEXT NOT NULL,
        operation TEXT NOT NULL,
        name TEXT NOT NULL,
        digest TEXT NOT NULL,
        status INTEGER NOT NULL,
        headers TEXT NOT NULL,
        body BLOB NOT NULL,
        created INTEGER NOT NULL,
        CONSTRAINT pk_idempotency PRIMARY KEY (key),
        CONSTRAINT uq_idempotency_caller_operation_name UNIQUE (caller, operation, name),
        CONSTRAINT ck_idempotency_status_of_an_answer CHECK (status BETWEEN 200 AND 599),
        CONSTRAINT ck_idempotency_whole_digest CHECK (length(digest) = 64),
        CONSTRAINT ck_idempotency_length_of_its_name CHECK (length(name) BETWEEN 1 AND 255),
        CONSTRAINT ck_idempotency_headers_is_json CHECK (iif(json_valid(headers), json_type(headers) = 'object', 0)),
        CONSTRAINT ck_idempotency_moments_in_range CHECK (created BETWEEN -62135596800000000 AND 253402300799999999)
    ) STRICT
    """,
    "CREATE INDEX ix_idempotency_created ON idempotency (created)",
)
