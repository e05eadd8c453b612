"""A query as the service answers it: the landmarks it brings, and the submaps that it may find."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from server.config.settings import Limits
from server.errors import InvalidField, TooLarge
from server.schemas.poses import PriorPose
from server.schemas.queries import QueryInput
from server.store.codec import diameters_of, position_names
from server.store.repositories.submaps import SubmapReader
from server.store.submap_records import SubmapFilter
from server.submaps.preparation import check_landmark_count
from urquhart import Effort, Method, Prior


@dataclass(frozen=True, slots=True)
class QueryLandmarks:
    """The landmarks of a query: (N, 2) float64, metres, query frame. `ids` is None if they are the positions in the
    list.

    `diameters`: (N,) float64, metres, NaN where unknown; None if all are.
    """

    xy: NDArray[np.float64]
    diameters: NDArray[np.float64] | None
    ids: list[str] | None

    def names(self) -> list[str]:
        """The ids, or the positions in the list as text."""
        return self.ids if self.ids is not None else position_names(len(self.xy))


@dataclass(frozen=True, slots=True)
class Surroundings:
    """A square in the map frame `frame_id`: its middle and half its side, in metres."""

    frame_id: str
    x: float
    y: float
    radius: float

    def keys(self, submaps: SubmapReader, among: Sequence[int] | None = None) -> set[int]:
        """Keys of the submaps with a footprint in there, of all or `among` some."""
        x, y, r = self.x, self.y, self.radius
        return submaps.matching(SubmapFilter(bbox=(x - r, y - r, x + r, y + r), map_frame_id=self.frame_id), among)


@dataclass(frozen=True, slots=True)
class KnownPlace:
    """The rough pose of a query in the map frame `frame_id`."""

    frame_id: str
    prior: Prior

    @classmethod
    def of(cls, body: PriorPose) -> "KnownPlace":
        """The rough pose that a request gives."""
        covariance = np.reshape(np.asarray(body.covariance, dtype=np.float64), (3, 3))
        return cls(body.frame_id, Prior(body.x, body.y, covariance, body.yaw, body.about, body.noise))


@dataclass(frozen=True, slots=True)
class Exclusion:
    """Submaps to leave out: those with these ids, and those that meet all other conditions that are not None."""

    submap_ids: tuple[str, ...] = ()
    session: str | None = None
    within_seconds: float | None = None

    def keys(self, submaps: SubmapReader, stamp: datetime | None, among: Sequence[int] | None = None) -> set[int]:
        """Keys of the submaps that a query of that time must not find, of all or `among` some.

        Raises InvalidField for a query without a time that needs one.
        """
        keys = set(submaps.keys(self.submap_ids).values()) if self.submap_ids else set[int]()
        since = until = None
        if self.within_seconds is not None:
            if stamp is None:
                raise InvalidField(
                    "needs the query's `stamp`; add it, or leave this out",
                    code="no_stamp",
                    pointer="/exclude/within_seconds",
                )
            span = timedelta(seconds=self.within_seconds)
            since, until = _shifted(stamp, -span), _shifted(stamp, span)
        if self.session is not None or self.within_seconds is not None:
            keys |= submaps.matching(SubmapFilter(session=self.session, since=since, until=until), among)
        return keys


@dataclass(frozen=True, slots=True)
class PlaceQuery:
    """Where was this observed?

    Attributes:
        landmarks: what was observed; None for the landmarks of the stored submap `submap_id`.
        pointer: JSON pointer to the landmarks in the request, for errors.
        frame_id: name of the query's frame; that of the stored submap if None.
        stamp: when it was observed; that of the stored submap if None.
        near: where to search; None for everywhere.
        prior: the rough pose, if it is known; only poses in its window are searched.
        exclude: what not to find.
        limit: most candidates.
        method: of the search.
        effort: of the search.
        min_confidence: that is `matched`; that of the collection if None.
        seed: of random choices.
        explain: whether the answer tells the findings, too.
        hints: whether to search for what would make the query match if nothing is found.
        pairs: whether the answer lists the landmark pairs.
        columns: whether it lists them as columns of positions.
        per_session: whether to search for the best candidate of each session.
        store: whether to store the answer.
        seconds: within which the caller needs the answer.
        compare_each: whether further candidates are compared with the rivals in their own submaps, too.
    """

    landmarks: QueryLandmarks | None
    pointer: str = ""
    submap_id: str | None = None
    frame_id: str | None = None
    stamp: datetime | None = None
    near: Surroundings | None = None
    prior: KnownPlace | None = None
    exclude: Exclusion = Exclusion()
    limit: int = 5
    method: Method = "robust"
    effort: Effort = "full"
    min_confidence: float | None = None
    seed: int | None = None
    explain: bool = False
    hints: bool = False
    pairs: bool = True
    per_session: bool = False
    store: bool = False
    seconds: float | None = None
    columns: bool = False
    compare_each: bool = False

    @classmethod
    def of(cls, body: QueryInput, limits: Limits) -> "PlaceQuery":
        """The query of a request. Raises TooLarge and InvalidField for more than the limits allow."""
        check_landmark_count(body, limits)
        if body.limit > limits.candidates and "limit" in body.model_fields_set:
            detail = f"must be at most {limits.candidates}: see `candidates` in GET /v1/limits"
            raise InvalidField(detail, code="less_than_equal", pointer="/limit")
        excluded, near = body.exclude, body.near
        if len(excluded.submap_ids) > limits.excluded_submaps:
            raise TooLarge(
                "excluded_submaps", limits.excluded_submaps, len(excluded.submap_ids), "Exclude fewer submaps."
            )
        if body.prior is not None and body.method != "robust":
            detail = "needs the method `robust`: leave `method` out, or search without a prior"
            raise InvalidField(detail, code="prior_method", pointer="/prior")
        landmarks = None
        if body.submap_id is None:
            landmarks = QueryLandmarks(body.positions(), diameters_of(body.attributes()), body.landmark_ids())
        return cls(
            landmarks,
            body.landmark_pointer,
            body.submap_id,
            body.frame_id,
            body.stamp,
            None if near is None else Surroundings(near.frame_id, near.x, near.y, near.radius),
            None if body.prior is None else KnownPlace.of(body.prior),
            Exclusion(tuple(excluded.submap_ids), excluded.session, excluded.within_seconds),
            min(body.limit, limits.candidates),  # the default is lower only if the operator's limit is
            body.method,
            body.effort,
            body.min_confidence,
            body.seed,
            body.explain,
            body.explain,
            body.pairs,
            body.per_session,
            body.store,
            None if body.timeout_ms is None else body.timeout_ms / 1000.0,
            body.pair_format == "columns",
        )


def _shifted(stamp: datetime, span: timedelta) -> datetime:
    """`stamp` moved by `span`, within the range of dates."""
    try:
        return stamp + span
    except OverflowError:
        end = datetime.min if span < timedelta(0) else datetime.max
        return end.replace(tzinfo=stamp.tzinfo)
