"""The places that an ambiguous plot fits, each once, in map coordinates."""

import math
from collections.abc import Callable
from typing import Final

from server.collections.frame_systems import FrameSystem
from server.coregistration.plot_poses import turn_cw
from server.coregistration.results import PossiblePlace
from server.coregistration.season import SeasonPlot
from server.queries.lookup import LookupResult
from server.schemas.poses import Transform
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction
from urquhart import SE2

_SAME_PLACE: Final = 1.0
"""Metres: centres of one plot that are closer than this are one place, which several submaps contain."""
_SAME_TURN: Final = 10.0
"""Degrees: turns that differ by less are one."""


def distinct_places(
    tx: ReadTransaction,
    collection: CollectionRecord,
    look: LookupResult,
    plot: SeasonPlot,
    system_of: Callable[[str], FrameSystem],
) -> list[PossiblePlace]:
    """The places of the first candidate and of its rivals, the best first.

    `plot` is what was looked up: the query's frame has its origin at its centre. `system_of` says what system a map is
    in.
    """
    answer = look.answer
    fits: list[tuple[str, Transform, int]] = []
    fits += [(one.submap_id, one.transform, one.inlier_count) for one in answer.candidates[:1]]
    fits += [(one.submap_id, one.transform, one.inlier_count) for one in answer.rivals]
    keys = tx.submaps(collection.key).keys({submap_id for submap_id, _, _ in fits})
    rows = tx.candidates(collection.key).read(set(keys.values()), landmarks=False)
    found: list[PossiblePlace] = []
    for submap_id, transform, trees in fits:
        row = rows.get(keys.get(submap_id, -1))
        if row is None:
            continue
        pose, frame_id = SE2(transform.x, transform.y, transform.yaw), row.frame_id or row.id
        system = FrameSystem(frame_id, None, None)
        if row.place is not None:
            frame_id = row.place.map_frame_id
            system = system_of(frame_id)
            pose = SE2(row.place.map_x, row.place.map_y, row.place.map_yaw) @ pose
        e, n = float(pose.x + system.origin[0]), float(pose.y + system.origin[1])
        turn = turn_cw(plot, pose.yaw, system)
        place = PossiblePlace(frame_id, submap_id, e, n, turn, trees, system.name)
        if not any(is_same_place(place, other) for other in found):
            found.append(place)
    return found


def is_same_place(a: PossiblePlace, b: PossiblePlace) -> bool:
    """Whether two places are one."""
    turn = abs(math.remainder(a.turn_cw - b.turn_cw, 360.0))
    return a.frame_id == b.frame_id and math.hypot(a.e - b.e, a.n - b.n) <= _SAME_PLACE and turn <= _SAME_TURN
