"""The job that writes a collection's index anew; the old one serves until the new one takes its place."""

from server.flushing import Stopped, rebuild
from server.jobs.runner import Assignment, Interrupted, Tools
from server.store.database import storage_errors
from server.upkeep import Upkeep


def run_reindex(assignment: Assignment, tools: Tools) -> None:
    """Write all submaps to new segments, and merge them. Begun again from the start after a restart.

    Raises NotFound, StorageError, Interrupted, Dismissed.
    """
    with tools.database.read() as session:
        assignment.total, assignment.done = assignment.collection(session).submap_count, 0
    assignment.report()

    def advance(submaps: int) -> None:
        assignment.done += submaps
        assignment.report()

    try:
        with storage_errors(tools.catalog.folder.path):
            written = rebuild(tools.catalog.shop, assignment.collection_id, progress=advance)
            Upkeep(tools.database, tools.catalog, tools.metrics).merge_all(assignment.collection_id)
    except Stopped as error:
        raise Interrupted from error
    assignment.done, assignment.counts = written, {"indexed": written}
    assignment.report()
