"""The job that lays one map frame onto another: it finds matches between them, and may move all submaps of one."""

from server.constraints.extraction import search_of
from server.constraints.rows import store_found
from server.jobs.running_job import JobContext, RunningJob
from server.jobs.types.find_constraints import find_all, parameters_of, write_results
from server.maps.merging import apply_merge, check_frames, lines_of_merge, merge, searched, summary_of
from server.schemas.maps.merges import MergeInput


def run_merge(job: RunningJob, context: JobContext) -> None:
    """Merge two frames; write the result; move the submaps in the transaction that ends the job.

    A job that is killed goes on where it was: the submaps are moved once or not at all. Raises NotFound, InvalidField,
    Conflict, StorageError and others.
    """
    if "written" in job.progress:
        return  # only its end could not be stored
    body = parameters_of(job, MergeInput)
    wanted = searched(body)
    with context.database.read() as tx:
        job.collection(tx)
        check_frames(tx, job.collection_id, body)
    search = find_all(job, context, wanted)
    with context.database.write() as tx:
        key = job.collection(tx).key
        store_found(tx, key, search.kept, search.looked_up, (search_of(wanted), job.id))
    with context.database.read() as tx:
        job.collection(tx)
        made = merge(tx, job.collection_id, body, search_of(wanted))
    told = summary_of(made)
    job.counts = search.counts | {"used": told.used, "refused": told.refused, "joined": int(told.verdict == "joined")}
    size = write_results(job, context, lines_of_merge(made))
    with context.database.write() as tx:
        job.collection(tx)
        if body.apply:
            job.counts["map_version"] = apply_merge(tx, job.collection_id, made)
        job.report(tx, written=size)
