"""Calls that start and follow jobs (imports, reindexing, constraints), and calls about snapshots."""

import hashlib
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from urquhart_client._protocol import job_requests
from urquhart_client._sync.connection import Connection
from urquhart_client.errors import UnexpectedAnswer
from urquhart_client.job_models import Constraint, Job, JobLine, Progress, Snapshot

_WAIT = 20.0
"""Seconds that the service is asked to hold an answer back; less than it takes to time out."""


class JobCalls(Connection):
    """Jobs and snapshots."""

    def import_file(
        self,
        collection: str,
        path: str | Path,
        *,
        on_conflict: Literal["replace", "skip", "fail"] = "replace",
        mode: Literal["continue", "all"] = "continue",
        wait: bool = True,
        progress: Callable[[Progress], None] | None = None,
        idempotency_key: str | None = None,
    ) -> Job:
        """Store the submaps of an NDJSON file (packed where its name ends with `.gz`), and wait until they are.

        The file is read as it is sent, never as a whole. Where the connection breaks it is sent again, and taken on
        once. What was refused is told by `job_errors`.

        Args:
            on_conflict: what to do where an id is taken by other content.
            mode: go on past lines that are refused, or store all or none.
            wait: until the job is finished; else it is returned as it was taken on.
            progress: called now and then.
            idempotency_key: the same for every attempt to upload this; made up when left out.
        """
        source = Path(path)
        size = source.stat().st_size

        def sent(read: int) -> None:
            if progress is not None:
                progress(Progress("sending", read, size))

        job = self._send(job_requests.post_import(collection, source, on_conflict, mode, idempotency_key, sent))
        return self.wait_for_job(job.id, progress=progress) if wait else job

    def reindex(self, collection: str) -> Job:
        """Have the index of a collection rewritten; the job that does it."""
        return self._send(job_requests.post_reindex(collection))

    def constraints(self, collection: str, body: Mapping[str, Any] | None = None) -> Job:
        """Look submaps up in each other. Returns the job. `body`: filters and gates, see the API."""
        return self._send(job_requests.post_constraints(collection, dict(body or {})))

    def jobs(
        self, *, state: str | None = None, collection: str | None = None, page_size: int | None = None
    ) -> Iterator[Job]:
        """Jobs, newest first. Pages are fetched as needed."""
        return self._pages(lambda cursor: job_requests.get_jobs(state, collection, page_size, cursor))

    def get_job(self, job_id: str, *, wait: float = 0.0) -> Job:
        """The progress of a job. Answered when it ends, or after `wait` seconds."""
        return self._send(job_requests.get_job(job_id, wait))

    def wait_for_job(
        self, job_id: str, *, timeout: float | None = None, progress: Callable[[Progress], None] | None = None
    ) -> Job:
        """Wait until a job has ended, whatever its outcome: see `job.state`.

        Raises:
            TimeoutError: it is not finished after `timeout` seconds; it goes on.
        """
        began = time.monotonic()
        while True:
            left = _WAIT if timeout is None else min(timeout - (time.monotonic() - began), _WAIT)
            job = self.get_job(job_id, wait=1.0 if progress is not None and left > 1.0 else max(left, 0.0))
            if progress is not None:
                progress(Progress("storing", job.done, job.total, job.eta_seconds))
            if job.is_finished:
                return job
            if left <= 0.0:
                raise TimeoutError(f"job {job_id} has not ended in time: {job.state}, {job.done} of {job.total} done")

    def delete_job(self, job_id: str) -> Job | None:
        """Cancel an unfinished job, which ends after the work in progress, or delete a finished one (returns None)."""
        return self._send(job_requests.delete_job(job_id))

    def job_results(self, job_id: str) -> Iterator[JobLine]:
        """The result of each line of an import, as it arrives."""
        for line in self._lines(job_requests.get_results(job_id, "results")):
            yield JobLine.model_validate_json(line)

    def job_errors(self, job_id: str) -> Iterator[JobLine]:
        """The results of the lines that an import refused."""
        for line in self._lines(job_requests.get_results(job_id, "errors")):
            yield JobLine.model_validate_json(line)

    def constraints_of(self, job_id: str, wanted: job_requests.ConstraintFormat = "json") -> str:
        """The constraints that a job found, in a format.

        `g2o_middle` has its vertices among the trees, for coordinates far from the origin.
        """
        return self._send(job_requests.get_constraints(job_id, wanted))

    def kept_constraints(
        self,
        collection: str,
        *,
        kind: Literal["match", "odometry"] | None = None,
        state: Literal["active", "stale", "refused"] | None = None,
        submap: str | None = None,
        page_size: int | None = None,
    ) -> Iterator[Constraint]:
        """The constraints that the collection keeps. Pages are fetched as needed."""
        chosen = {"kind": kind, "state": state, "submap": submap}
        return self._pages(lambda cursor: job_requests.get_kept_constraints(collection, chosen, page_size, cursor))

    def constraints_as(
        self,
        collection: str,
        wanted: job_requests.KeptFormat,
        *,
        state: Literal["active", "stale", "refused"] | None = None,
        frame_id: str | None = None,
    ) -> str:
        """All constraints that the collection keeps, in a format. g2o, TUM and KITTI start in the map `frame_id`."""
        chosen = {"state": state, "frame_id": frame_id}
        return self._send(job_requests.get_constraints_as(collection, wanted, chosen))

    def post_odometry(self, collection: str, edges: Iterable[Mapping[str, Any]]) -> int:
        """Store relative poses that a robot measured, all or none. Returns how many.

        Each has `from`, `to`, `x` and `y` (metres), `yaw` (radians): the pose of `to` in the frame of `from`; and
        `covariance`, 3 x 3, row by row, over (x, y, yaw).
        """
        return self._send(job_requests.post_odometry(collection, {"edges": [dict(edge) for edge in edges]}))

    def delete_constraint(self, collection: str, constraint: str) -> None:
        """Delete a constraint by its id."""
        self._send(job_requests.delete_constraint(collection, constraint))

    def build_map(self, collection: str, body: Mapping[str, Any] | None = None) -> Job:
        """Make one map of submaps. Returns the job. `body`: which submaps, gates, odometry, `apply`; see the API."""
        return self._send(job_requests.post_map(collection, dict(body or {})))

    def get_map(self, collection: str, map_id: str) -> dict[str, Any]:
        """A map that a job has built: its numbers, the pose of each submap, and what became of each constraint.

        `map_id` is the id of the job.
        """
        return self._send(job_requests.get_map(collection, map_id))

    def map_trees(
        self, collection: str, map_id: str, wanted: job_requests.TreeFormat = "csv", *, part: int = 1
    ) -> bytes:
        """The trees of one part of a map as a file; part 1 is the largest one."""
        return self._send(job_requests.get_map_trees(collection, map_id, wanted, part))

    def merge_frames(self, collection: str, source: str, target: str, *, apply: bool = False) -> Job:
        """Lay the map frame `source` onto the map frame `target` by their matches. Returns the job.

        With `apply`, all submaps of `source` get poses in `target`, in one transaction.
        """
        return self._send(job_requests.post_merge(collection, {"from": source, "to": target, "apply": apply}))

    def get_merge(self, collection: str, merge: str) -> dict[str, Any]:
        """A merge that a job has computed: verdict, transform, and each match with why it was left out.

        `merge` is the id of the job.
        """
        return self._send(job_requests.get_merge(collection, merge))

    def move_submaps(self, collection: str, poses: Mapping[str, Mapping[str, Any] | None]) -> int:
        """Write the map poses of many submaps by id, all or none; None removes one. Returns the new revision."""
        moves = [{"id": name, "map_pose": pose} for name, pose in poses.items()]
        return self._send(job_requests.post_poses(collection, {"poses": moves}))

    # ------------------------------------------------------------ snapshots

    def create_snapshot(self, name: str | None = None) -> Snapshot:
        """Create a snapshot of the whole database."""
        return self._send(job_requests.post_snapshot(name))

    def snapshots(self, *, page_size: int | None = None) -> Iterator[Snapshot]:
        """The snapshots. Pages are fetched as needed."""
        return self._pages(lambda cursor: job_requests.get_snapshots(page_size, cursor))

    def get_snapshot(self, name: str) -> Snapshot:
        """One snapshot."""
        return self._send(job_requests.get_snapshot(name))

    def delete_snapshot(self, name: str) -> None:
        """Delete a snapshot."""
        self._send(job_requests.delete_snapshot(name))

    def download_snapshot(self, name: str, path: str | Path) -> Path:
        """Download a snapshot's database to a new file, which appears when it is complete and its checksum is right.

        Raises:
            UnexpectedAnswer: what came is not what the snapshot's SHA-256 says.
            FileExistsError.
        """
        about, target = self.get_snapshot(name), Path(path)
        if target.exists():
            raise FileExistsError(str(target))
        part, digest = target.with_name(f"{target.name}.part"), hashlib.sha256()
        try:
            with part.open("wb") as file:
                for piece in self._pieces(job_requests.get_snapshot_file(name)):
                    digest.update(piece)
                    file.write(piece)
            if digest.hexdigest() != about.sha256:
                raise UnexpectedAnswer(f"the download of snapshot {name} is damaged: try again", 200, "")
            part.rename(target)
        finally:
            part.unlink(missing_ok=True)
        return target
