"""The job that rewrites a collection's index. Queries use the old one until the new one is complete."""

from server.index.flushing import Stopped, rebuild
from server.index.maintenance import Maintenance
from server.jobs.assignment import Assignment, Interrupted, JobContext
from server.platform.disk_errors import disk_errors


def run_reindex(assignment: Assignment, context: JobContext) -> None:
    """Write all submaps to new segments and merge them. After a restart it begins again if these are not listed yet.

    Raises NotFound, StorageError, Interrupted, Dismissed.
    """
    try:
        with disk_errors(context.catalog.folder.path):
            if not assignment.progress.get("listed", False):
                _rebuild(assignment, context)
            Maintenance(context.database, context.catalog, context.metrics).merge_all(assignment.collection_id)
    except Stopped as error:
        raise Interrupted from error


def _rebuild(assignment: Assignment, context: JobContext) -> None:
    with context.database.read() as tx:
        assignment.total, assignment.done = assignment.collection(tx).submap_count, 0
    assignment.report()

    def advance(submaps: int) -> None:
        assignment.done += submaps
        assignment.report()

    written = rebuild(context.catalog.flush_context, assignment.collection_id, progress=advance)
    with context.database.read() as tx:
        assignment.collection(tx)
    assignment.total = assignment.done = written
    assignment.counts = {"indexed": written}
    assignment.report(listed=True)
