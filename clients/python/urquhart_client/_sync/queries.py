"""Calls for queries."""

from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from typing import Any

from urquhart_client._protocol import bodies, listings, requests
from urquhart_client._protocol.bodies import Diameters, Landmarks, Points
from urquhart_client._protocol.listings import StoredQuery
from urquhart_client._sync.connection import Connection
from urquhart_client.errors import ProblemError
from urquhart_client.models import Effort, Explanation, Method, PairFormat, QueryResult


class QueryCalls(Connection):
    """Queries: where is this?"""

    def query(
        self,
        collection: str,
        xy: Points | None = None,
        ids: Iterable[str] | None = None,
        *,
        dbh_cm: Diameters | None = None,
        landmarks: Landmarks | None = None,
        submap_id: str | None = None,
        keyframes: Iterable[Mapping[str, Any]] | None = None,
        limit: int = 5,
        method: Method | None = None,
        effort: Effort | None = None,
        min_confidence: float | None = None,
        seed: int | None = None,
        store: bool = False,
        explain: bool = False,
        per_session: bool = False,
        frame_id: str | None = None,
        stamp: datetime | str | None = None,
        near: Mapping[str, Any] | None = None,
        prior: Mapping[str, Any] | None = None,
        exclude: Mapping[str, Any] | None = None,
        pairs: bool = True,
        pair_format: PairFormat | None = None,
        timeout_ms: int | None = None,
    ) -> QueryResult:
        """Ask where an observation was made.

        Args:
            xy: N pairs (x, y), metres, in the observer's frame; a (N, 2) array will do. Any N gets an answer.
            ids: N landmark ids; default "0", "1", ...
            dbh_cm: N stem diameters, centimetres, None or NaN where one is not known.
            landmarks: instead of `xy`, `ids` and `dbh_cm`.
            submap_id: instead of landmarks, a stored submap.
            keyframes: instead of landmarks, several views in a row, each `{"xy": [...], "pose": {"x": ..., "y": ...,
                "yaw": ...}}` with its pose by odometry, metres and radians. They get one verdict.
            limit: most candidates to answer.
            method: "robust" (the default of the service) or "paper".
            effort: "full" (the default of the service), or "fast": a `no_match` comes much sooner, and
                places seen with more noise than 40 cm, or with fewer than 80 % of the trees, are not found.
            min_confidence: least confidence that is `matched`, above 0.5 and below 1; default: the collection's.
            seed: of the random choices, for the same answer again.
            store: keep the answer, under `result.id`, so that its drawing and explanation can be fetched.
            explain: answer what each level found in each submap, too (`result.findings`).
            per_session: who has been here, and when: the best candidate of every session.
            near: about where in a map it was made, `{"x": ..., "y": ..., "radius": ..., "frame_id": "map"}`, metres.
            prior: the rough pose, `{"x": ..., "y": ..., "covariance": [9 numbers], "frame_id": "map"}`, metres and
                radians, with `"yaw"` if the heading is known: every pose whose position and whose heading are each
                within 3.5 standard deviations is tried, and none outside, so less evidence is enough and trees may be
                off by up to 1 m.
            exclude: what must not be found, e.g. `{"submap_ids": [...]}`, `{"session": "monday"}`, or
                `{"within_seconds": 60}` of `stamp`.
            pairs: answer the pairs of landmarks of each candidate; without them an answer is much smaller.
            pair_format: "objects" (the default of the service: `inliers`, with ids), or "columns": positions in
                `inlier_columns`, a quarter of the bytes.
            timeout_ms: milliseconds after which the service answers with what it found so far (`no_match`, reason
                `deadline`); less than the client's own `timeout`, so that there is an answer.
        """
        body = bodies.query_body(
            bodies.observation(xy, ids, dbh_cm, landmarks, submap_id, keyframes),
            limit=limit,
            method=method,
            effort=effort,
            min_confidence=min_confidence,
            seed=seed,
            store=store,
            explain=explain,
            per_session=per_session,
            frame_id=frame_id,
            stamp=stamp,
            near=near,
            prior=prior,
            exclude=exclude,
            pairs=pairs,
            pair_format=pair_format,
            timeout_ms=timeout_ms,
        )
        return self._send(requests.post_query(collection, body))

    def query_batch(
        self, collection: str, queries: Iterable[Mapping[str, Any]], *, timeout_ms: int | None = None
    ) -> tuple[QueryResult | ProblemError, ...]:
        """Answer several queries at once, each the body of a query. The result of an invalid query is its problem.

        Args:
            queries: each like `{"xy": [[x, y], ...], "limit": 3}` or `{"submap_id": "p7"}`.
            timeout_ms: milliseconds for all of them; in the place of those that are not begun by then stands a problem.
        """
        return self._send(requests.post_batch(collection, [dict(query) for query in queries], timeout_ms))

    def get_query(self, collection: str, query_id: str) -> QueryResult:
        """The result of a stored query."""
        return self._send(requests.get_query(collection, query_id))

    def queries(
        self, collection: str, *, verdict: str | None = None, page_size: int | None = None
    ) -> Iterator[StoredQuery]:
        """The queries that were sent with `store` and are still kept, newest first. Pages are fetched as needed.

        Args:
            verdict: only those with this verdict: `matched`, `ambiguous` or `no_match`.
        """
        return self._pages(lambda cursor: listings.get_queries(collection, verdict, page_size, cursor))

    def match_svg(self, collection: str, query_id: str, rank: int = 1) -> str:
        """A candidate of a stored query as a drawing: both sets of landmarks, overlaid, and the inlier pairs."""
        return self._send(requests.get_match_svg(collection, query_id, rank))

    def explanation(self, collection: str, query_id: str) -> Explanation:
        """The explanation of a stored query: stages, findings, rivals, gates."""
        return self._send(requests.get_explanation(collection, query_id))

    def explanation_svg(self, collection: str, query_id: str) -> str:
        """The explanation as a drawing."""
        return self._send(requests.get_explanation_svg(collection, query_id))
