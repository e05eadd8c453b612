"""Records of constraints between submaps, as the rest of the service sees them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

ConstraintKind = Literal["match", "odometry"]
ConstraintSource = Literal["job", "posted"]
ConstraintState = Literal["active", "stale", "refused"]


@dataclass(frozen=True, slots=True)
class ConstraintRecord:
    """A constraint to store.

    Attributes:
        kind: a match that a search found, or a relative pose that a robot measured.
        from_id, to_id: ids of its submaps.
        from_revision, to_revision: of the collection, when the landmarks of these submaps were stored.
        search: which search found it; empty for odometry. Matches of different searches are kept apart.
        source, source_id: where it comes from, and the id of the job that found it.
        content: as it is answered, without what the other columns have.
    """

    kind: ConstraintKind
    from_id: str
    to_id: str
    from_revision: int
    to_revision: int
    search: str
    source: ConstraintSource
    source_id: str | None
    content: dict[str, Any]


@dataclass(frozen=True, slots=True)
class StoredConstraint(ConstraintRecord):
    """A constraint as it is stored.

    Attributes:
        refused: why the last map that used it left it out; None if it did not, or none used it.
        refused_by: id of the job of that map.
        stale: whether one of its submaps was deleted, or has other landmarks now.
    """

    key: int
    refused: str | None
    refused_by: str | None
    created: datetime
    stale: bool

    @property
    def state(self) -> ConstraintState:
        """`stale` before `refused` before `active`."""
        return "stale" if self.stale else "refused" if self.refused is not None else "active"


@dataclass(frozen=True, slots=True)
class ConstraintFilter:
    """Which constraints: those with all that is given.

    Attributes:
        submap: id of a submap that they join.
        search: of which search; matches of others are left out, odometry is not.
        session: both submaps are of this session.
    """

    kind: ConstraintKind | None = None
    state: ConstraintState | None = None
    submap: str | None = None
    search: str | None = None
    session: str | None = None
