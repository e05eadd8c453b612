"""The job that writes a collection's index anew; the old one serves until the new one takes its place."""

from server.index.flushing import Stopped, rebuild
from server.index.maintenance import Upkeep
from server.jobs.assignment import Assignment, Interrupted, Tools
from server.store.sqlite.sqlite_errors import storage_errors


def run_reindex(assignment: Assignment, tools: Tools) -> None:
    """Write all submaps to new segments, and merge them. Begun again after a restart, where these are not listed yet.

    Raises NotFound, StorageError, Interrupted, Dismissed.
    """
    try:
        with storage_errors(tools.catalog.folder.path):
            if not assignment.progress.get("listed", False):
                _rebuild(assignment, tools)
            Upkeep(tools.database, tools.catalog, tools.metrics).merge_all(assignment.collection_id)
    except Stopped as error:
        raise Interrupted from error


def _rebuild(assignment: Assignment, tools: Tools) -> None:
    with tools.database.read() as session:
        assignment.total, assignment.done = assignment.collection(session).submap_count, 0
    assignment.report()

    def advance(submaps: int) -> None:
        assignment.done += submaps
        assignment.report()

    written = rebuild(tools.catalog.shop, assignment.collection_id, progress=advance)
    with tools.database.read() as session:
        assignment.collection(session)
    assignment.total = assignment.done = written
    assignment.counts = {"indexed": written}
    assignment.report(listed=True)
