"""The job that rewrites a collection's index. Queries use the old one until the new one is complete."""

from server.index.flushing import Stopped, rebuild
from server.index.maintenance import Maintenance
from server.jobs.running_job import Interrupted, JobContext, RunningJob
from server.platform.disk_errors import disk_errors


def run_reindex(job: RunningJob, context: JobContext) -> None:
    """Write all submaps to new segments and merge them. After a restart it begins again if these are not listed yet.

    Raises NotFound, StorageError, Interrupted, Dismissed.
    """
    try:
        with disk_errors(context.indexes.folder.path):
            if not job.progress.get("listed", False):
                _rebuild(job, context)
            Maintenance(context.database, context.indexes, context.metrics).merge_all(job.collection_id)
    except Stopped as error:
        raise Interrupted from error


def _rebuild(job: RunningJob, context: JobContext) -> None:
    with context.database.read() as tx:
        job.total, job.done = job.collection(tx).submap_count, 0
    job.report()

    def advance(submaps: int) -> None:
        job.done += submaps
        job.report()

    written = rebuild(context.indexes.flush_context, job.collection_id, progress=advance)
    with context.database.read() as tx:
        job.collection(tx)
    job.total = job.done = written
    job.counts = {"indexed": written}
    job.report(listed=True)
