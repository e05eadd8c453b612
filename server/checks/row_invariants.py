"""Rows that the service can never have written: SQLite lets any value into any column.

Each rule is a statement that selects where (a collection, a submap in it, "" or what stands in its place) for each row
that breaks it. They read columns as they lie there, so they also find what the mapped tables could not be read with.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from sqlalchemy.orm import Session


@dataclass(frozen=True, slots=True)
class RowViolation:
    """A row that cannot be: where, and what about it; `unreadable` where it stops whoever reads the table."""

    where: str
    what: str
    unreadable: bool


def row_violations(session: Session) -> Iterator[RowViolation]:
    """All rows that break a rule. Raises StorageError."""
    connection = session.connection()
    for unreadable, rules in ((True, _UNREADABLE), (False, _RULES)):
        found = False
        for what, statement in rules:
            for (where,) in connection.exec_driver_sql(statement):
                found = True
                yield RowViolation(str(where), what, unreadable)
        if found and unreadable:
            return


_UNREADABLE: Final = (
    (
        "its row holds what is no number, text or JSON where one must be",
        "SELECT id FROM collections WHERE typeof(id) <> 'text' OR typeof(fingerprint) <> 'text' "
        "OR typeof(revision) <> 'integer' OR typeof(submap_count) <> 'integer' OR typeof(landmark_count) <> 'integer' "
        "OR typeof(polygon_count) <> 'integer' OR typeof(query_sequence) <> 'integer' "
        "OR typeof(pruned_revision) <> 'integer' OR typeof(created) <> 'integer' OR typeof(updated) <> 'integer' "
        "OR typeof(origin_x) NOT IN ('null', 'real', 'integer') OR typeof(origin_y) NOT IN ('null', 'real', 'integer') "
        "OR typeof(title) NOT IN ('null', 'text') OR typeof(crs) NOT IN ('null', 'text') "
        "OR CASE WHEN json_valid(config) THEN json_type(config) <> 'object' ELSE 1 END",
    ),
    (
        "its row holds what is no number, text or JSON where one must be",
        "SELECT c.id || '/' || s.id FROM submaps s JOIN collections c ON c.key = s.collection_key "
        "WHERE typeof(s.id) <> 'text' OR typeof(s.revision) <> 'integer' OR typeof(s.content_revision) <> 'integer' "
        "OR typeof(s.landmark_count) <> 'integer' OR typeof(s.polygon_count) <> 'integer' "
        "OR typeof(s.created) <> 'integer' OR typeof(s.updated) <> 'integer' "
        "OR typeof(s.stamp) NOT IN ('null', 'integer') OR typeof(s.frame_id) NOT IN ('null', 'text') "
        "OR typeof(s.session) NOT IN ('null', 'text') OR typeof(s.etag) <> 'text' "
        "OR typeof(s.landmarks_hash) <> 'text' OR typeof(s.map_frame_id) NOT IN ('null', 'text') "
        "OR CASE WHEN json_valid(s.counts) THEN json_type(s.counts) <> 'object' ELSE 1 END "
        "OR (s.properties IS NOT NULL AND CASE WHEN json_valid(s.properties) "
        "THEN json_type(s.properties) <> 'object' ELSE 1 END) "
        "OR (s.map_covariance IS NOT NULL AND CASE WHEN json_valid(s.map_covariance) "
        "THEN json_type(s.map_covariance) <> 'array' ELSE 1 END)",
    ),
    (
        "landmarks, ids, attributes or features are not stored as bytes",
        "SELECT c.id || '/' || s.id FROM submaps s JOIN collections c ON c.key = s.collection_key "
        "WHERE typeof(s.landmarks) <> 'blob' OR typeof(s.features) <> 'blob' "
        "OR typeof(s.landmark_ids) NOT IN ('null', 'blob') OR typeof(s.attributes) NOT IN ('null', 'blob')",
    ),
    (
        "a segment is listed with what is no number or text",
        "SELECT c.id FROM segments g JOIN collections c ON c.key = g.collection_key "
        "WHERE typeof(g.name) <> 'text' OR typeof(g.since) <> 'integer' OR typeof(g.revision) <> 'integer' "
        "OR typeof(g.submaps) <> 'integer' OR typeof(g.bytes) <> 'integer' OR typeof(g.created) <> 'integer'",
    ),
)
_RULES: Final = (
    (
        "counts or revisions are below zero",
        "SELECT id FROM collections WHERE min(revision, submap_count, landmark_count, polygon_count, query_sequence, "
        "pruned_revision) < 0",
    ),
    ("deletions are forgotten beyond its revision", "SELECT id FROM collections WHERE pruned_revision > revision"),
    ("half an origin", "SELECT id FROM collections WHERE (origin_x IS NULL) <> (origin_y IS NULL)"),
    (
        "half a map pose",
        "SELECT c.id || '/' || s.id FROM submaps s JOIN collections c ON c.key = s.collection_key "
        "WHERE (s.map_frame_id IS NULL) + (s.map_x IS NULL) + (s.map_y IS NULL) + (s.map_yaw IS NULL) "
        "+ (s.map_min_x IS NULL) + (s.map_min_y IS NULL) + (s.map_max_x IS NULL) + (s.map_max_y IS NULL) "
        "NOT IN (0, 8) OR (s.map_frame_id IS NULL AND s.map_covariance IS NOT NULL)",
    ),
    (
        "belongs to a stand that is not there, or to one of another collection",
        "SELECT c.id || '/' || s.id FROM submaps s JOIN collections c ON c.key = s.collection_key "
        "WHERE s.stand_key IS NOT NULL AND NOT EXISTS "
        "(SELECT 1 FROM stands t WHERE t.key = s.stand_key AND t.collection_key = s.collection_key)",
    ),
    (
        "a deletion is noted that should be forgotten",
        "SELECT c.id FROM deletions d JOIN collections c ON c.key = d.collection_key "
        "WHERE d.revision <= c.pruned_revision OR typeof(d.revision) <> 'integer'",
    ),
    (
        "a segment is listed beyond its revision",
        "SELECT c.id FROM segments g JOIN collections c ON c.key = g.collection_key WHERE g.revision > c.revision",
    ),
    (
        "keys of submaps would be given out again",
        "SELECT '' FROM (SELECT coalesce((SELECT seq FROM sqlite_sequence WHERE name = 'submaps'), 0) AS last) "
        "WHERE last < max(coalesce((SELECT max(key) FROM submaps), 0), "
        "coalesce((SELECT max(submap_key) FROM deletions), 0))",
    ),
    (
        "keys of collections would be given out again",
        "SELECT '' WHERE coalesce((SELECT seq FROM sqlite_sequence WHERE name = 'collections'), 0) "
        "< coalesce((SELECT max(key) FROM collections), 0)",
    ),
    (
        "keys of jobs would be given out again",
        "SELECT '' WHERE coalesce((SELECT seq FROM sqlite_sequence WHERE name = 'jobs'), 0) "
        "< coalesce((SELECT max(key) FROM jobs), 0)",
    ),
    (
        "has a state that no job has",
        "SELECT 'job ' || id FROM jobs "
        "WHERE state NOT IN ('accepted', 'running', 'successful', 'failed', 'dismissed') OR typeof(state) <> 'text'",
    ),
    (
        "is finished without a time, or has one and is not",
        "SELECT 'job ' || id FROM jobs "
        "WHERE (state IN ('successful', 'failed', 'dismissed')) <> (finished IS NOT NULL) "
        "OR (state = 'running' AND started IS NULL)",
    ),
    (
        # `done` may be more than `total`: earlier versions counted what others stored during a job only there.
        "counts less than nothing",
        "SELECT 'job ' || id FROM jobs WHERE typeof(done) <> 'integer' OR done < 0 OR (total IS NOT NULL "
        "AND (typeof(total) <> 'integer' OR total < 0))",
    ),
    (
        "its row cannot be read",
        "SELECT 'job ' || id FROM jobs WHERE typeof(id) <> 'text' OR typeof(kind) <> 'text' "
        "OR typeof(collection_id) <> 'text' OR typeof(collection_key) <> 'integer' "
        "OR CASE WHEN json_valid(parameters) THEN json_type(parameters) <> 'object' ELSE 1 END "
        "OR CASE WHEN json_valid(counts) THEN json_type(counts) <> 'object' ELSE 1 END "
        "OR CASE WHEN json_valid(progress) THEN json_type(progress) <> 'object' ELSE 1 END "
        "OR (problem IS NOT NULL AND CASE WHEN json_valid(problem) THEN json_type(problem) <> 'object' ELSE 1 END) "
        "OR dismissed NOT IN (0, 1) OR typeof(created) <> 'integer' "
        "OR typeof(started) NOT IN ('null', 'integer') OR typeof(finished) NOT IN ('null', 'integer')",
    ),
    (
        "is no answer that can be given again",
        "SELECT 'kept answer ' || key FROM idempotency "
        "WHERE typeof(status) <> 'integer' OR status NOT BETWEEN 200 AND 599 OR length(digest) <> 64 "
        "OR typeof(body) <> 'blob' OR typeof(created) <> 'integer' OR length(name) NOT BETWEEN 1 AND 255 "
        "OR CASE WHEN json_valid(headers) THEN json_type(headers) <> 'object' ELSE 1 END",
    ),
    (
        "is no key that anybody can have",
        "SELECT 'key ' || id FROM api_keys WHERE typeof(digest) <> 'blob' OR length(digest) <> 32 "
        "OR typeof(id) <> 'text' OR typeof(created) <> 'integer' "
        "OR typeof(expires) NOT IN ('null', 'integer') OR typeof(revoked) NOT IN ('null', 'integer') "
        "OR CASE WHEN json_valid(scopes) THEN json_type(scopes) <> 'array' OR json_array_length(scopes) = 0 "
        "ELSE 1 END "
        "OR CASE WHEN json_valid(patterns) THEN json_type(patterns) <> 'array' OR json_array_length(patterns) = 0 "
        "ELSE 1 END",
    ),
    (
        "allows what no key allows",
        "SELECT 'key ' || k.id FROM api_keys k, json_each(CASE WHEN json_valid(k.scopes) THEN k.scopes ELSE '[]' END) "
        "WHERE json_each.value NOT IN ('read', 'write', 'admin')",
    ),
    (
        "a stored query cannot be read",
        "SELECT c.id FROM queries q JOIN collections c ON c.key = q.collection_key "
        "WHERE typeof(q.number) <> 'integer' OR q.number < 1 OR typeof(q.created) <> 'integer' "
        "OR typeof(q.landmarks) <> 'blob' OR length(q.landmarks) % 16 <> 0 OR typeof(q.answer) <> 'blob' "
        "OR NOT json_valid(CAST(q.answer AS TEXT)) "
        "OR CASE WHEN json_valid(q.candidates) THEN json_type(q.candidates) <> 'array' ELSE 1 END",
    ),
)
