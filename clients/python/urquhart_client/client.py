"""The blocking client."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from types import TracebackType
from typing import Any, Self, TypeVar

import httpx
from pydantic import BaseModel

from urquhart_client import _bodies, _requests
from urquhart_client._bodies import UNSET, Diameters, Landmarks, Points, Pose, Unset
from urquhart_client._exchange import Request, answer
from urquhart_client.errors import ConnectionFailed
from urquhart_client.models import (
    Collection,
    Explanation,
    Limits,
    Method,
    Page,
    QueryResult,
    Submap,
    SubmapReceipt,
    Tessellation,
)

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)


class Client:
    """A connection to one service; usable as a context manager, and by several threads at once.

    Args:
        base_url: where the service is, e.g. `http://127.0.0.1:8420`; a path in front of `/v1` may be part of it.
        timeout: seconds for connecting and for each read and write, or an `httpx.Timeout`.
        api_key: as the operator made it, where the service asks for one.
        headers: sent with every request.
        transport: an httpx transport instead of the network, e.g. `httpx.MockTransport` in tests.

    Every call raises `ProblemError` when the service refuses, `ConnectionFailed` when it cannot be reached and
    `UnexpectedAnswer` when something else answers. Nothing is retried.
    """

    def __init__(
        self,
        base_url: str,
        *,
        timeout: float | httpx.Timeout = 30.0,
        api_key: str | None = None,
        headers: Mapping[str, str] | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        sent = dict(headers or {}) | ({} if api_key is None else {"Authorization": f"Bearer {api_key}"})
        self._http = httpx.Client(base_url=base_url, timeout=timeout, headers=sent, transport=transport)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections; the client cannot be used afterwards."""
        self._http.close()

    def _send(self, request: Request[T]) -> T:
        try:
            response = self._http.request(
                request.method,
                request.path,
                params=dict(request.params),
                headers=dict(request.headers),
                content=request.content,
            )
        except (httpx.TransportError, httpx.DecodingError) as error:
            raise ConnectionFailed(f"{request.method} {request.path}: {error or type(error).__name__}") from error
        return answer(request, response)

    # -------------------------------------------------------------- service

    def landing(self) -> dict[str, Any]:
        """What the service is and where its parts are."""
        return self._send(_requests.get_landing())

    def live(self) -> dict[str, Any]:
        """Answers when the process runs."""
        return self._send(_requests.get_probe("livez"))

    def ready(self) -> dict[str, Any]:
        """Answers when the service takes requests; until then a `ProblemError` with status 503 names the open check."""
        return self._send(_requests.get_probe("readyz"))

    def metrics(self) -> str:
        """The service's metrics, in Prometheus' text format."""
        return self._send(_requests.get_metrics())

    def limits(self) -> Limits:
        """What requests are held to."""
        return self._send(_requests.get_limits())

    # ---------------------------------------------------------- collections

    def collections(self, *, page_size: int | None = None) -> Iterator[Collection]:
        """All collections; a page is fetched when it is needed."""
        return self._pages(lambda cursor: _requests.get_collections(page_size, cursor))

    def get_collection(self, collection: str) -> Collection:
        """One collection, with its counts and revision."""
        return self._send(_requests.get_collection(collection))

    def put_collection(
        self,
        collection: str,
        *,
        title: str | None = None,
        config: Mapping[str, Any] | None = None,
        crs: str | None = None,
        origin: Sequence[float] | None = None,
    ) -> Collection:
        """Create a collection. With the same content it may be repeated; with another `config` it is refused (409)."""
        return self._send(_requests.put_collection(collection, title, config, crs, origin))

    def patch_collection(
        self,
        collection: str,
        *,
        title: str | Unset | None = UNSET,
        crs: str | Unset | None = UNSET,
        origin: Sequence[float] | Unset | None = UNSET,
    ) -> Collection:
        """Change what is given; None clears a field."""
        return self._send(_requests.patch_collection(collection, _bodies.changes(title=title, crs=crs, origin=origin)))

    def delete_collection(self, collection: str) -> None:
        """Delete a collection and its submaps."""
        self._send(_requests.delete_collection(collection))

    # -------------------------------------------------------------- submaps

    def put_submap(
        self,
        collection: str,
        submap_id: str,
        *,
        xy: Points | None = None,
        ids: Iterable[str] | None = None,
        dbh: Diameters | None = None,
        landmarks: Landmarks | None = None,
        frame_id: str | None = None,
        stamp: datetime | str | None = None,
        session: str | None = None,
        map_pose: Pose | None = None,
        properties: Mapping[str, Any] | None = None,
        if_match: str | None = None,
        if_none_match: str | None = None,
    ) -> SubmapReceipt:
        """Store a submap under the caller's id; the next query finds it.

        Args:
            xy: N pairs (x, y), metres, in the submap's own frame; a (N, 2) array will do.
            ids: N landmark ids, unique; default "0", "1", ... in the order of `xy`.
            dbh: N stem diameters, metres, None or NaN where one is not known; evidence where a query has them too.
            landmarks: instead of `xy`, `ids` and `dbh`, landmarks with whatever else is known of each.
            stamp: when it was seen, with a time zone, or as RFC 3339 text.
            map_pose: where the submap's frame lies in a map; editable later.
            if_match: the `etag` that must be stored, or `*` for any; otherwise the service refuses (412).
            if_none_match: `*` to create only.
        """
        body = _bodies.submap_body(
            _bodies.landmarks(xy, ids, dbh, landmarks), frame_id, stamp, session, map_pose, properties
        )
        return self._send(_requests.put_submap(collection, submap_id, body, if_match, if_none_match))

    def submaps(
        self,
        collection: str,
        *,
        bbox: Sequence[float] | None = None,
        interval: str | None = None,
        session: str | None = None,
        page_size: int | None = None,
    ) -> Iterator[Submap]:
        """The submaps of a collection that pass the filters; a page is fetched when it is needed.

        Args:
            bbox: (x minimum, y minimum, x maximum, y maximum), metres, map frame.
            interval: an instant or an interval `from/to` in RFC 3339, either end `..` for open.
        """
        return self._pages(lambda cursor: _requests.get_submaps(collection, bbox, interval, session, page_size, cursor))

    def get_submap(self, collection: str, submap_id: str) -> Submap:
        """One submap with its landmarks."""
        return self._send(_requests.get_submap(collection, submap_id))

    def patch_submap(
        self,
        collection: str,
        submap_id: str,
        *,
        map_pose: Pose | Unset | None = UNSET,
        properties: Mapping[str, Any] | Unset | None = UNSET,
        if_match: str | None = None,
    ) -> Submap:
        """Change the pose in the map or the properties; None clears a field. The landmarks stay as they are."""
        changes = _bodies.changes(map_pose=map_pose, properties=properties)
        return self._send(_requests.patch_submap(collection, submap_id, changes, if_match))

    def delete_submap(self, collection: str, submap_id: str, *, if_match: str | None = None) -> None:
        """Delete a submap; the next query does not find it."""
        self._send(_requests.delete_submap(collection, submap_id, if_match))

    def tessellation(self, collection: str, submap_id: str) -> Tessellation:
        """Triangles, interior polygons and descriptors of a submap."""
        return self._send(_requests.get_tessellation(collection, submap_id))

    def tessellation_svg(self, collection: str, submap_id: str) -> str:
        """The tessellation as a drawing."""
        return self._send(_requests.get_tessellation_svg(collection, submap_id))

    # -------------------------------------------------------------- queries

    def query(
        self,
        collection: str,
        xy: Points | None = None,
        ids: Iterable[str] | None = None,
        *,
        dbh: Diameters | None = None,
        landmarks: Landmarks | None = None,
        submap_id: str | None = None,
        limit: int = 5,
        method: Method | None = None,
        seed: int | None = None,
        store: bool = False,
        explain: bool = False,
        frame_id: str | None = None,
        stamp: datetime | str | None = None,
        near: Mapping[str, Any] | None = None,
        exclude: Mapping[str, Any] | None = None,
    ) -> QueryResult:
        """Ask where an observation was made.

        Args:
            xy: N pairs (x, y), metres, in the observer's frame; a (N, 2) array will do. Any N gets an answer.
            ids: N landmark ids; default "0", "1", ...
            dbh: N stem diameters, metres, None or NaN where one is not known.
            landmarks: instead of `xy`, `ids` and `dbh`.
            submap_id: instead of landmarks, a stored submap.
            limit: most candidates to answer.
            method: "robust" (the default of the service) or "paper".
            seed: of the random choices, for the same answer again.
            store: keep the answer, under `result.id`, so that its drawing and explanation can be fetched.
            explain: answer what each level found in each submap, too (`result.findings`).
            near: about where in a map it was made, `{"x": ..., "y": ..., "radius": ..., "frame_id": "map"}`, metres.
            exclude: what must not be found, e.g. `{"submap_ids": [...]}`, `{"session": "monday"}`, or
                `{"within_seconds": 60}` of `stamp`.
        """
        if submap_id is None:
            observation = _bodies.landmarks(xy, ids, dbh, landmarks)
        elif xy is None and landmarks is None and ids is None and dbh is None:
            observation = {"submap_id": submap_id}
        else:
            raise ValueError("give either landmarks or submap_id, not both")
        return self._send(
            _requests.post_query(
                collection, observation, limit, method, seed, store, explain, frame_id, stamp, near, exclude
            )
        )

    def get_query(self, collection: str, query_id: str) -> QueryResult:
        """A stored query's result again."""
        return self._send(_requests.get_query(collection, query_id))

    def match_svg(self, collection: str, query_id: str, rank: int = 1) -> str:
        """A stored query's candidate as a drawing: both sets of landmarks, overlaid, and the inlier pairs."""
        return self._send(_requests.get_match_svg(collection, query_id, rank))

    def explanation(self, collection: str, query_id: str) -> Explanation:
        """Why a stored query was answered as it was: stages, findings, rivals, gates."""
        return self._send(_requests.get_explanation(collection, query_id))

    def explanation_svg(self, collection: str, query_id: str) -> str:
        """The explanation as a drawing."""
        return self._send(_requests.get_explanation_svg(collection, query_id))

    def _pages(self, request: Callable[[str | None], Request[Page[M]]]) -> Iterator[M]:
        cursor: str | None = None
        while True:
            page = self._send(request(cursor))
            yield from page.items
            if page.next is None:
                return
            cursor = page.next
