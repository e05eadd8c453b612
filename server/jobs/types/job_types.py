"""The function of each type of job."""

from collections.abc import Mapping
from typing import Final

from server.jobs.running_job import JobFunction
from server.jobs.types.build_map import run_build_map
from server.jobs.types.coregister import run_coregister
from server.jobs.types.find_constraints import run_constraints
from server.jobs.types.import_submaps import run_import
from server.jobs.types.merge_frames import run_merge
from server.jobs.types.reindex import run_reindex

JOB_TYPES: Final[Mapping[str, JobFunction]] = {
    "import": run_import,
    "reindex": run_reindex,
    "constraints": run_constraints,
    "map": run_build_map,
    "merge": run_merge,
    "coregistration": run_coregister,
}
