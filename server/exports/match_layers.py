"""Matches of stored queries, and the pairs of trees that they rest on, as rows of a table."""

from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from server.exports.selection import ExportChoice, ExportPlaces
from server.outputs.tables import OutputColumn, OutputLayer, OutputRows
from server.queries.stored_queries import stored_answers
from server.schemas.candidates import CandidateAnswer
from server.schemas.queries import QueryAnswer
from server.store.codec import unpack_attributes, unpack_ids, unpack_positions
from server.store.storage import ReadTransaction, Storage
from server.store.submap_records import SubmapContent
from urquhart import Budget

MATCH_COLUMNS: Final = (
    OutputColumn("query", "text"),
    OutputColumn("verdict", "text"),
    OutputColumn("reason", "text"),
    OutputColumn("landmarks", "integer"),
    OutputColumn("submap", "text"),
    OutputColumn("session", "text"),
    OutputColumn("stamp", "time"),
    OutputColumn("frame_id", "text"),
    OutputColumn("confidence", "real"),
    OutputColumn("inliers", "integer"),
    OutputColumn("inlier_ratio", "real"),
    OutputColumn("overlap_ratio", "real"),
    OutputColumn("rms_m", "real"),
    OutputColumn("shift_x_m", "real"),
    OutputColumn("shift_y_m", "real"),
    OutputColumn("turn_degrees", "real"),
    OutputColumn("sigma_x_m", "real"),
    OutputColumn("sigma_y_m", "real"),
    OutputColumn("sigma_turn_degrees", "real"),
    OutputColumn("warnings", "text"),
)
PAIR_COLUMNS: Final = (
    OutputColumn("query", "text"),
    OutputColumn("query_landmark", "text"),
    OutputColumn("submap_landmark", "text"),
    OutputColumn("residual_m", "real"),
    OutputColumn("submap_dbh_cm", "real"),
    OutputColumn("submap", "text"),
    OutputColumn("frame_id", "text"),
)
_PAGE: Final = 20
"""Stored answers that are read at once."""
_CHANGED: Final = "the submap was changed or deleted after the query"


def match_layer(places: ExportPlaces) -> OutputLayer:
    """The table of stored queries: a point for each that is `matched`, where the middle of its trees is."""
    return OutputLayer("matches", MATCH_COLUMNS, places.system)


def pair_layer(places: ExportPlaces) -> OutputLayer:
    """The table of pairs of trees: a point for each, where the map has the tree."""
    return OutputLayer("pairs", PAIR_COLUMNS, places.system, leading=3)


def match_rows(
    database: Storage, places: ExportPlaces, choice: ExportChoice, budget: Budget | None = None
) -> Iterator[OutputRows]:
    """A row for each stored query. Only one that is `matched` has a pose, because any other pose is only a guess."""

    def make(tx: ReadTransaction, answer: QueryAnswer) -> OutputRows:
        return _match(answer, places)

    return _rows(database, places, choice, budget, make)


def pair_rows(
    database: Storage, places: ExportPlaces, choice: ExportChoice, budget: Budget | None = None
) -> Iterator[OutputRows]:
    """The pairs of each stored query that is `matched`, a batch for each query."""

    def make(tx: ReadTransaction, answer: QueryAnswer) -> OutputRows | None:
        if answer.verdict != "matched" or not answer.candidates[0].inliers:
            return None
        return _pairs(tx, answer, answer.candidates[0], places)

    return _rows(database, places, choice, budget, make)


def _rows(
    database: Storage,
    places: ExportPlaces,
    choice: ExportChoice,
    budget: Budget | None,
    make: Callable[[ReadTransaction, QueryAnswer], OutputRows | None],
) -> Iterator[OutputRows]:
    """What is made of stored answers, oldest first, some of them in each transaction.

    With a map frame chosen, those that were matched in another are left out.
    """
    after, frame_id = 0, choice.chosen.map_frame_id
    while True:
        with database.read() as tx:
            page = stored_answers(tx, places.collection, after=after, limit=_PAGE)
            made = []
            for answer in page:
                if budget is not None:
                    budget.check()
                if frame_id is None or answer.verdict != "matched" or _frame(answer.candidates[0]) == frame_id:
                    made.append(make(tx, answer))
        yield from (rows for rows in made if rows is not None)
        if len(page) < _PAGE:
            return
        after = int(page[-1].id or 0)


def _frame(best: CandidateAnswer) -> str | None:
    return None if best.map_pose is None else best.map_pose.frame_id


def _match(answer: QueryAnswer, places: ExportPlaces) -> OutputRows:
    head: list[Any] = [answer.id, answer.verdict, answer.reason, answer.landmark_count]
    nowhere = np.full((1, 2), np.nan)
    if answer.verdict != "matched":
        blank = [None] * (len(MATCH_COLUMNS) - len(head))
        return OutputRows([[value] for value in (*head, *blank)], nowhere, why=[f"its verdict is {answer.verdict}"])
    best = answer.candidates[0]
    survey, frame_id = best.survey, _frame(best)
    values = [*head, best.submap_id, best.session, best.stamp, frame_id, best.confidence, best.inlier_count]
    values += [best.inlier_ratio, best.overlap_ratio, best.rms]
    if survey is None:
        values += [None] * 6
    else:
        sigmas = survey.shift_sigma or (None, None)
        # In the system of the row's position: the two must tell the same place.
        values += [*(survey.crs_shift or survey.shift), survey.turn_degrees, *sigmas, survey.turn_sigma_degrees]
    values.append(" ".join(best.warnings) or None)
    there, why = nowhere, "an older version stored it"
    if survey is not None and frame_id is None:
        why = "its submap has no map_pose"
    elif survey is not None and frame_id is not None:
        there, why = places.of_frame(frame_id, np.array([survey.position])), places.missing(frame_id)
    return OutputRows([[value] for value in values], there, why=() if np.isfinite(there).all() else [why])


def _pairs(tx: ReadTransaction, answer: QueryAnswer, best: CandidateAnswer, places: ExportPlaces) -> OutputRows:
    count = len(best.inliers)
    row = tx.submaps(places.collection.key).get(best.submap_id, SubmapContent)
    if row is not None and row.content_revision > answer.revision:
        row = None
    where = {} if row is None else {name: i for i, name in enumerate(unpack_ids(row.landmark_ids, row.landmark_count))}
    known = [where.get(pair.submap) for pair in best.inliers]
    diameters = None if row is None else unpack_attributes(row.attributes).get("dbh_cm")
    frame_id = None if row is None or row.place is None else row.place.map_frame_id
    values: list[list[Any]] = [
        [answer.id] * count,
        [pair.query for pair in best.inliers],
        [pair.submap for pair in best.inliers],
        [pair.residual for pair in best.inliers],
        [None if diameters is None or i is None else diameters[i] for i in known],
        [best.submap_id] * count,
        [frame_id] * count,
    ]
    there = np.full((count, 2), np.nan)
    if row is not None:
        there = _of_landmarks(row, known, places)
    why = () if np.isfinite(there).all() else [_CHANGED if row is None else places.missing(frame_id)] * count
    return OutputRows(values, there, why=why)


def _of_landmarks(row: SubmapContent, known: list[int | None], places: ExportPlaces) -> NDArray[np.float64]:
    """Positions (N, 2) of landmarks of a submap, in coordinates of the export; NaN for those that it does not have."""
    local = unpack_positions(row.landmarks)
    xy = np.array([(np.nan, np.nan) if i is None else tuple(local[i]) for i in known], dtype=np.float64).reshape(-1, 2)
    return places.of_submap(row.place, xy)
