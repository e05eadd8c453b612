"""Calls for submaps."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any

from urquhart_client._protocol import bodies, job_requests, listings, requests
from urquhart_client._protocol.bodies import UNSET, Diameters, Landmarks, Points, Pose, Unset
from urquhart_client._protocol.listings import LandmarkColumns
from urquhart_client._sync.connection import Connection
from urquhart_client.models import SessionSummary, Submap, SubmapReceipt, Tessellation


class SubmapCalls(Connection):
    """Submaps of a collection."""

    def put_submap(
        self,
        collection: str,
        submap_id: str,
        *,
        xy: Points | None = None,
        ids: Iterable[str] | None = None,
        dbh_cm: Diameters | None = None,
        landmarks: Landmarks | None = None,
        frame_id: str | None = None,
        stamp: datetime | str | None = None,
        session: str | None = None,
        map_pose: Pose | None = None,
        properties: Mapping[str, Any] | None = None,
        query: Mapping[str, Any] | None = None,
        if_match: str | None = None,
        if_none_match: str | None = None,
    ) -> SubmapReceipt:
        """Store a submap under the caller's id; the next query finds it.

        It replaces the whole submap: what is left out is cleared, and `receipt.cleared` names it. `patch_submap`
        changes the landmarks and keeps the rest.

        Args:
            xy: N pairs (x, y), metres, in the submap's own frame; a (N, 2) array will do.
            ids: N landmark ids, unique; default "0", "1", ... in the order of `xy`.
            dbh_cm: N stem diameters, centimetres, None or NaN where not known; evidence where a query has them too.
            landmarks: instead of `xy`, `ids` and `dbh_cm`, landmarks with whatever else is known of each.
            stamp: when it was seen, with a time zone, or as RFC 3339 text.
            map_pose: where the submap's frame lies in a map; editable later.
            query: ask where else it was seen, and how, `{}` as usual; the answer is `receipt.query`. Too few trees
                are an answer then (`receipt.outcome` is `not_stored`), without a query they are refused.
            if_match: the `etag` that must be stored, or `*` for any; otherwise the service refuses (412).
            if_none_match: `*` to create only.
        """
        body = bodies.submap_body(
            bodies.landmarks(xy, ids, dbh_cm, landmarks), frame_id, stamp, session, map_pose, properties, query
        )
        return self._send(requests.put_submap(collection, submap_id, body, if_match, if_none_match))

    def post_submap(
        self,
        collection: str,
        *,
        xy: Points | None = None,
        ids: Iterable[str] | None = None,
        dbh_cm: Diameters | None = None,
        landmarks: Landmarks | None = None,
        frame_id: str | None = None,
        stamp: datetime | str | None = None,
        session: str | None = None,
        map_pose: Pose | None = None,
        properties: Mapping[str, Any] | None = None,
        query: Mapping[str, Any] | None = None,
        idempotency_key: str | None = None,
    ) -> SubmapReceipt:
        """Store a new submap under an id that the service makes: `receipt.id`. Arguments as of `put_submap`.

        Args:
            idempotency_key: the same for every attempt to store this submap; made up when left out, so that this call
                may send it again, but another call would store it again.
        """
        body = bodies.submap_body(
            bodies.landmarks(xy, ids, dbh_cm, landmarks), frame_id, stamp, session, map_pose, properties, query
        )
        return self._send(requests.post_submap(collection, body, idempotency_key))

    def submaps(
        self,
        collection: str,
        *,
        bbox: Sequence[float] | None = None,
        interval: str | None = None,
        session: str | None = None,
        page_size: int | None = None,
    ) -> Iterator[Submap]:
        """The submaps of a collection that pass the filters. Pages are fetched as needed.

        Args:
            bbox: (x minimum, y minimum, x maximum, y maximum), metres, map frame.
            interval: an instant or an interval `from/to` in RFC 3339, either end `..` for open.
        """
        return self._pages(lambda cursor: requests.get_submaps(collection, bbox, interval, session, page_size, cursor))

    def landmark_columns(
        self,
        collection: str,
        frame_id: str,
        *,
        session: str | None = None,
        bbox: Sequence[float] | None = None,
        limit: int | None = None,
    ) -> LandmarkColumns:
        """The trees of all submaps that have a place in a map frame, as columns: fast to read, and to be drawn.

        Args:
            frame_id: the map frame.
            bbox: (x minimum, y minimum, x maximum, y maximum), metres, map frame: only submaps that overlap it.
            limit: most positions, at most 1,000,000 (default 200,000). If there are more, every second, fourth, ...
                is sent.
        """
        box = None if bbox is None else ",".join(repr(float(one)) for one in bbox)
        asked = {"frame_id": frame_id, "session": session, "bbox": box, "limit": limit}
        return self._send(listings.get_landmarks(collection, asked))

    def get_submap(self, collection: str, submap_id: str) -> Submap:
        """One submap with its landmarks."""
        return self._send(requests.get_submap(collection, submap_id))

    def patch_submap(
        self,
        collection: str,
        submap_id: str,
        *,
        xy: Points | None = None,
        ids: Iterable[str] | None = None,
        dbh_cm: Diameters | None = None,
        landmarks: Landmarks | None = None,
        frame_id: str | Unset | None = UNSET,
        stamp: datetime | str | Unset | None = UNSET,
        session: str | Unset | None = UNSET,
        map_pose: Pose | Unset | None = UNSET,
        properties: Mapping[str, Any] | Unset | None = UNSET,
        if_match: str | None = None,
    ) -> Submap:
        """Change members of a submap. None removes a member; members that are left out stay.

        Args:
            xy, ids, dbh_cm, landmarks: as of `put_submap`, the landmarks that take the place of all that were there.
            if_match: the `etag` that must be stored, or `*` for any; otherwise the service refuses (412).
        """
        trees = {} if xy is None and landmarks is None else bodies.landmarks(xy, ids, dbh_cm, landmarks)
        if not trees and (ids is not None or dbh_cm is not None):
            raise ValueError("ids and dbh_cm go with xy")
        seen = stamp if isinstance(stamp, Unset) else bodies.rfc3339(stamp)
        changes = trees | bodies.changes(
            frame_id=frame_id, stamp=seen, session=session, map_pose=map_pose, properties=properties
        )
        return self._send(requests.patch_submap(collection, submap_id, changes, if_match))

    def delete_submap(self, collection: str, submap_id: str, *, if_match: str | None = None) -> None:
        """Delete a submap. The next query no longer finds it."""
        self._send(requests.delete_submap(collection, submap_id, if_match))

    def tessellation(self, collection: str, submap_id: str) -> Tessellation:
        """Triangles, interior polygons and descriptors of a submap."""
        return self._send(requests.get_tessellation(collection, submap_id))

    def tessellation_svg(self, collection: str, submap_id: str) -> str:
        """The tessellation as a drawing."""
        return self._send(requests.get_tessellation_svg(collection, submap_id))

    def delete_session(self, collection: str, session: str) -> None:
        """Delete all submaps of a session, in one transaction."""
        self._send(job_requests.delete_session(collection, session))

    def session_poses(self, collection: str, session: str) -> dict[str, Any]:
        """Where each submap of a session is now, by all matches and odometry that the collection keeps of it.

        `poses` has a pose with its covariance for each submap, in the frame of its part; `constraints` what became of
        each constraint. While `settled` is false, a search of all constraints runs in the background.
        """
        return self._send(job_requests.get_session_poses(collection, session))

    def sessions(self, collection: str, *, page_size: int | None = None) -> Iterator[SessionSummary]:
        """The sessions of a collection by name. Pages are fetched as needed."""
        return self._pages(lambda cursor: requests.get_sessions(collection, page_size, cursor))
