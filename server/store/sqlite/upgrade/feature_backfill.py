"""Features of an older format, or described in an older way, are rebuilt once, so that no start has to do it again.

They are looked for when the file was last brought up to date by a version that made others: its `user_version` says so.
Every batch is a transaction of its own; what is left when the process ends is done the next time.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from sqlalchemy import Connection, func, select, update

from server.store.codec import unpack_diameters, unpack_positions
from server.store.sqlite.database import Database
from server.store.sqlite.file_checks import set_user_version, user_version
from server.store.sqlite.upgrade import migrations_runner
from server.store.tables import CollectionRow, SubmapRow
from urquhart.config import FEATURES_VERSION, Config, ConfigError

if TYPE_CHECKING:
    from urquhart import Features

_BATCH: Final = 100
_CONFIGS: Final = select(CollectionRow.key, CollectionRow.config).order_by(CollectionRow.key)
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class BackfillProgress:
    """How far it is: submaps looked after, of as many; of how many the features were rebuilt."""

    done: int
    total: int
    made: int


def bring_up_to_date(database: Database) -> bool:
    """Bring the schema and the features to this version; True when something had to be done.

    Raises what `schema.upgrade` does.
    """
    changed = migrations_runner.upgrade(database)
    for step in backfill(database):
        changed = changed or step.made > 0
    return changed


def backfill(database: Database, *, all_rows: bool = False) -> Iterator[BackfillProgress]:
    """Rebuild features that this version cannot use, a batch at a time; nothing is yielded when there are none.

    The schema must be this version's. A file that is only read stays as it is: what cannot be used is then described at
    every reading.

    Args:
        all_rows: look at every row, even if the file says that this version has done so.
    """
    if database.read_only:
        return
    with database.read_connection() as connection:
        marked = user_version(connection) == FEATURES_VERSION
        stale = [] if marked and not all_rows else _stale(connection)
    made = 0
    for start in range(0, len(stale), _BATCH):
        made += _backfill_batch(database, stale[start : start + _BATCH])
        yield BackfillProgress(min(start + _BATCH, len(stale)), len(stale), made)
    if not marked:
        with database.write_connection() as connection:
            set_user_version(connection, FEATURES_VERSION)


def _stale(connection: Connection) -> list[tuple[int, Config]]:
    """Keys of the submaps whose features cannot be used, with the configuration of their collection."""
    from urquhart.features.describe import HEAD, Features  # loads the kernels, which few commands need

    found = []
    for collection_key, chosen in connection.execute(_CONFIGS).all():
        try:
            config = Config.from_dict(chosen)
        except ConfigError:
            continue  # named by whatever uses the collection, and by `urquhart db check`
        heads = select(SubmapRow.key, func.substr(SubmapRow.features, 1, HEAD)).where(
            SubmapRow.collection_key == collection_key
        )
        for key, head in connection.execute(heads.order_by(SubmapRow.key).execution_options(yield_per=1000)):
            if not Features.is_current(bytes(head), config.fingerprint()):
                found.append((key, config))
    return found


def _backfill_batch(database: Database, batch: list[tuple[int, Config]]) -> int:
    from urquhart import LandmarkError, describe

    configs = dict(batch)
    columns = (SubmapRow.key, SubmapRow.id, SubmapRow.content_revision, SubmapRow.landmarks, SubmapRow.attributes)
    with database.read_connection() as connection:
        rows = connection.execute(select(*columns).where(SubmapRow.key.in_(configs))).all()
    made = []
    for row in rows:
        try:
            xy, diameters = unpack_positions(row.landmarks), unpack_diameters(row.attributes)
            made.append((row, describe(xy, configs[row.key], diameters)))
        except (LandmarkError, ValueError):
            _log.warning("the landmarks of the submap %s cannot be described; `urquhart db check` says why", row.id)
    # Described outside of the transaction: other writers wait for the writing alone.
    with database.write_connection() as connection:
        return sum(_write(connection, row, features) for row, features in made)


def _write(connection: Connection, row: Any, features: "Features") -> bool:
    # Written only where the landmarks are still those that were described.
    same = (SubmapRow.key == row.key, SubmapRow.content_revision == row.content_revision)
    before = connection.execute(select(SubmapRow.collection_key, SubmapRow.polygon_count).where(*same)).one_or_none()
    if before is None:
        return False
    polygons = len(features.tessellation)
    values = {"features": features.pack(), "counts": features.counts(), "polygon_count": polygons}
    connection.execute(update(SubmapRow).where(*same).values(**values))
    total = {
        "polygon_count": CollectionRow.polygon_count + polygons - before.polygon_count,
        "fingerprint": features.fingerprint,
    }
    connection.execute(update(CollectionRow).where(CollectionRow.key == before.collection_key).values(**total))
    return True
