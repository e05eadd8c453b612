"""What several commands of `urquhart-client` print and need."""

import argparse
import sys

from pydantic import BaseModel

from urquhart_client.client import Client
from urquhart_client.errors import ProblemError
from urquhart_client.job_models import Job, Progress


def ensure_collection(client: Client, name: str) -> None:
    """Create the collection where it is missing: that needs the scope admin, which a robot's key does not have."""
    try:
        client.get_collection(name)
    except ProblemError as error:
        if error.status == 404:
            client.put_collection(name)
        elif error.status != 403:  # a key that may only write: the write itself tells what is missing
            raise


def show(progress: Progress) -> None:
    """Write progress over the last one, on a terminal."""
    part = f" of {progress.total}" if progress.total else ""
    left = f", {progress.eta_seconds:.0f} s left" if progress.eta_seconds is not None else ""
    sys.stderr.write(f"\r\033[K{progress.phase} {progress.done}{part}{left}")


def tell_job(options: argparse.Namespace, job: Job) -> None:
    """Print a job."""
    counts = ", ".join(f"{count} {outcome}" for outcome, count in job.counts.items())
    why = f": {job.problem['detail']}" if job.problem else ""
    tell(options, job, f"{job.id} {job.type} on {job.collection}: {job.state}{why} ({counts or 'nothing yet'})")


def tell(options: argparse.Namespace, model: BaseModel, line: str) -> None:
    """Print an answer: as a line for people, or with --json whole."""
    sys.stdout.write(f"{model.model_dump_json() if options.json else line}\n")
