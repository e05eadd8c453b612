"""The job that builds a map: it finds constraints as the job of that name, optimises those that the collection keeps,
and may move all submaps.
"""

import math
from concurrent.futures import wait
from functools import partial
from typing import Final

from server.constraints.extraction import search_of
from server.constraints.rows import store_found
from server.jobs.running_job import JobContext, RunningJob
from server.jobs.types.find_constraints import find_all, parameters_of, write_results
from server.maps.applying import apply_map
from server.maps.building import build, check_optimiser
from server.maps.results import lines_of_map, refusals_of
from server.maps.selection import choose, chosen_keys, names_of
from server.maps.whole_searches import WholeSearches
from server.schemas.maps.request import MapInput
from server.store.repositories.maps.constraint_records import ConstraintFilter
from urquhart.mapping.consistency import MappingNumbers
from urquhart.mapping.optimisation import OptimisedPoses
from urquhart.mapping.pose_graph import PoseConstraints

_LOOK: Final = 1.0
"""Seconds between two checks whether a job that waits for its poses must stop."""


def run_build_map(job: RunningJob, context: JobContext) -> None:
    """Build a map; write it to the results; apply it in the transaction that ends the job.

    The poses are optimised in a process of their own, so that requests go on meanwhile. A job that is killed finds the
    constraints that it has not found yet, and builds the map again: it is applied once or not at all. Raises NotFound,
    InvalidField, Conflict, WorkerLost, StorageError and others.
    """
    if "written" in job.progress:
        return  # only its end could not be stored
    body = parameters_of(job, MapInput)
    check_optimiser()
    searched = body
    if body.sessions is not None:  # the search for constraints knows of one session only
        with context.database.read() as tx:
            names = names_of(tx, job.collection(tx).key, chosen_keys(tx, job.collection_id, body))
        searched = body.model_copy(update={"submap_ids": names})
    search = find_all(job, context, searched)
    with context.database.write() as tx:
        key = job.collection(tx).key
        store_found(tx, key, search.kept, search.looked_up, (search_of(body), job.id))
    with context.database.read() as tx:
        key = job.collection(tx).key
        chosen = choose(tx, job.collection_id, body)
        kept = tx.constraints(key).page(ConstraintFilter(search=search_of(body)))
    built = build(chosen, kept, body, partial(_solve, job))
    refused = sum(reason is not None for reason in built.poses.refusals)
    job.counts = search.counts | {"refused": refused, "parts": len(built.part_sizes), "trees": len(built.trees)}
    size = write_results(job, context, lines_of_map(built))
    with context.database.write() as tx:
        tx.constraints(job.collection(tx).key).judge(refusals_of(built), job.id)
        if body.apply:
            job.counts["map_version"] = apply_map(tx, job.collection_id, built)
        job.report(tx, written=size)


def _solve(job: RunningJob, count: int, constraints: PoseConstraints, numbers: MappingNumbers) -> OptimisedPoses:
    """The poses of a map, optimised in another process, which is ended if the job must stop.

    Raises WorkerLost, and what `RunningJob.report` raises.
    """
    with WholeSearches(math.inf, None) as searches:
        search = searches.begin(count, constraints, numbers)
        while not search.done():
            wait([search], _LOOK)
            job.report()
        return search.result()
