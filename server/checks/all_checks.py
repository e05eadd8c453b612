"""Everything that can be checked in a database: file, schema, rows, features, derived columns, and the index."""

from collections.abc import Iterator

from server.checks.database import Discrepancy, discrepancies
from server.checks.derived_columns import content_discrepancies
from server.checks.index import index_discrepancies
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner


def inspect(database: Database) -> Iterator[Discrepancy]:
    """Everything that does not agree, in order of dependence. A check whose basis is damaged is skipped.

    Nothing is changed. Raises StorageError.
    """
    migrations_runner.claim(database)
    sound = True
    for finding in discrepancies(database):
        sound = False
        yield finding
    if sound:
        yield from content_discrepancies(database)
        yield from index_discrepancies(database)
