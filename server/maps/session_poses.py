"""The poses of sessions while robots drive, kept up to date with what is stored.

Each process keeps the sessions that were asked for last. All that it keeps follows from the rows: a session that is not
kept, or whose rows changed otherwise than by more of them, is searched again.
"""

import logging
import threading
from collections import OrderedDict
from dataclasses import dataclass, field
from time import monotonic
from typing import Any, Final

import numpy as np
import orjson

from server.errors import Conflict, PosesPending
from server.maps.building import check_optimiser
from server.maps.session_rows import SessionRows, read_members, read_rows
from server.maps.whole_searches import Search, WholeSearches, waited
from server.store.storage import Storage
from urquhart.mapping.online.session_poses import CurrentPoses, GrowingPoses

_KEPT: Final = 8
"""Sessions that a process keeps; one of 1,000 submaps takes about 60 MB."""
_MOST: Final = 10_000
"""Submaps of a session: of more, the search of all constraints takes hours."""
_PAUSE: Final = 2.0
"""Times as long as the last search of a session until it is searched again: other sessions need the process, too."""
_log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Kept:
    """A session that is kept.

    Attributes:
        rows, poses: what it is of, and the poses; None before the first search.
        search, searched: the search in progress, and what it is of.
        began, not_before: when that search began, and when the next one may.
    """

    lock: threading.Lock = field(default_factory=threading.Lock)
    rows: SessionRows | None = None
    poses: GrowingPoses | None = None
    search: Search | None = None
    searched: SessionRows | None = None
    began: float = 0.0
    not_before: float = 0.0


class SessionPoses:
    """Answers with the poses of sessions; safe for use by several threads."""

    def __init__(self, database: Storage) -> None:
        self._database, self._searches = database, WholeSearches()
        self._kept: OrderedDict[tuple[str, str], _Kept] = OrderedDict()
        self._lock = threading.Lock()

    def answer(self, collection_id: str, session: str, seconds: float) -> bytes:
        """The poses of a session now, as JSON.

        Raises NotFound, Conflict (too many submaps), OptimiserMissing, PosesPending (the first search takes longer than
        `seconds`), WorkerLost and StorageError.
        """
        check_optimiser()
        until = monotonic() + seconds
        kept = self._kept_of(collection_id, session)
        if not kept.lock.acquire(timeout=max(until - monotonic(), 0.0)):
            raise PosesPending("Another request waits for the poses of this session. Ask again in a few seconds.", 2.0)
        try:
            rows, current = self._current(kept, collection_id, session, until)
        finally:
            kept.lock.release()
        return _document(session, rows, current)

    def close(self) -> None:
        """End the searches in progress."""
        self._searches.close()

    def _kept_of(self, collection_id: str, session: str) -> _Kept:
        key = (collection_id, session)
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        with self._database.read() as tx:
            _check_size(len(read_members(tx, collection_id, session)))  # what does not exist is not kept
        with self._lock:
            kept = self._kept.setdefault(key, _Kept())
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
            return kept

    def _current(self, kept: _Kept, collection_id: str, session: str, until: float) -> tuple[SessionRows, CurrentPoses]:
        while True:
            self._adopt(kept)
            with self._database.read() as tx:
                rows = read_rows(tx, collection_id, session, kept.rows)
            _check_size(len(rows.members))
            if kept.poses is None or kept.rows is None or not rows.continues(kept.rows):
                kept.poses = None
                if kept.search is None or kept.searched is None or not rows.continues(kept.searched):
                    self._begin(kept, rows)
                assert kept.search is not None
                waited(kept.search, until - monotonic())
                continue
            if len(rows.members) > kept.poses.submaps or len(rows.edges) > kept.poses.constraints:
                kept.poses.add(len(rows.members), rows.constraints.since(kept.poses.constraints))
            kept.rows = rows
            current = kept.poses.current()
            if not current.search_due or kept.search is not None or monotonic() < kept.not_before:
                return rows, current
            if not self._begin(kept, rows).done():
                return rows, current

    def _begin(self, kept: _Kept, rows: SessionRows) -> Search:
        if kept.search is not None:
            kept.search.cancel()
        kept.began, kept.searched = monotonic(), rows
        kept.search = self._searches.begin(len(rows.members), rows.constraints)
        return kept.search

    def _adopt(self, kept: _Kept) -> None:
        """Take the result of a search that has ended. Raises what it raised, if there are no poses without it."""
        if kept.search is None or kept.searched is None or not kept.search.done():
            return
        search, rows = kept.search, kept.searched
        kept.search = kept.searched = None
        kept.not_before = monotonic() + _PAUSE * (monotonic() - kept.began)
        error = search.exception()
        if error is not None:
            if kept.poses is None:
                raise error
            _log.warning("the constraints of a session could not be searched: %s", error)
            return
        kept.poses, kept.rows = GrowingPoses(len(rows.members), rows.constraints, search.result()), rows


def _check_size(count: int) -> None:
    if count > _MOST:
        raise Conflict(
            f"The session has {count} submaps, and poses are kept up to date for up to {_MOST}. Build a map of it "
            "instead: POST the session to /v1/collections/{collection}/maps."
        )


def _document(session: str, rows: SessionRows, current: CurrentPoses) -> bytes:
    sizes = np.bincount(current.part)
    order = np.argsort(-sizes, kind="stable")
    numbers = (np.argsort(order, kind="stable") + 1)[current.part].tolist()
    covariances = current.covariances.reshape(-1, 9).tolist()
    told: dict[str, Any] = {
        "session": session,
        "revision": rows.revision,
        "settled": not current.search_due,
        "parts": [
            {"part": number, "submaps": int(sizes[part]), "frame_of": rows.members[int(current.frame_of[part])].id}
            for number, part in enumerate(order.tolist(), start=1)
        ],
        "poses": [
            {
                "id": one.id,
                "content_revision": one.content_revision,
                "part": part,
                "pose": {"x": x, "y": y, "yaw": yaw, "covariance": covariance},
            }
            for one, part, (x, y, yaw), covariance in zip(
                rows.members, numbers, current.poses.tolist(), covariances, strict=True
            )
        ],
        "constraints": [
            {"id": str(one.key), "kind": one.kind, "from": one.from_id, "to": one.to_id, "standing": standing}
            for one, standing in zip(rows.edges, current.standings, strict=True)
        ],
    }
    return orjson.dumps(told)
