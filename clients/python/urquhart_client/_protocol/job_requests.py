"""Requests about jobs and snapshots; see `requests`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import httpx

from urquhart_client._protocol.exchange import Request, Upload, model, nothing, page, text
from urquhart_client._protocol.requests import JSON, collection_path, once, parameters, segment, with_body
from urquhart_client.job_models import Constraint, Job, Snapshot
from urquhart_client.models import Page

_NDJSON = "application/x-ndjson"

ConstraintFormat = Literal["json", "g2o", "g2o_middle", "matrices"]
"""Formats of a job's constraints. `g2o_middle` has each vertex among the trees of its submap."""

KeptFormat = Literal["json", "ndjson", "g2o", "g2o_middle", "matrices", "tum", "kitti"]
"""Formats of the constraints that a collection keeps."""

TreeFormat = Literal["csv", "geojson", "gpkg", "parquet"]
"""Formats of the trees of a map."""


def post_import(
    collection: str, source: Path, on_conflict: str, mode: str, key: str | None, sent: Callable[[int], None]
) -> Request[Job]:
    """Upload a file."""
    headers = {"Content-Type": _NDJSON, "Content-Encoding": "gzip", "Accept": JSON} | once(key)
    upload = Upload(source, packed=source.name.endswith(".gz"), sent=sent)
    return Request(
        "POST",
        f"{collection_path(collection)}/imports",
        model(Job),
        params={"on_conflict": on_conflict, "mode": mode},
        headers=headers,
        content=upload,
    )


def post_reindex(collection: str) -> Request[Job]:
    """Have an index rewritten."""
    return Request("POST", f"{collection_path(collection)}/reindex", model(Job), headers=once())


def post_constraints(collection: str, body: Mapping[str, Any]) -> Request[Job]:
    """Find constraints."""
    return with_body("POST", f"{collection_path(collection)}/constraints", body, model(Job), once())


def get_kept_constraints(
    collection: str, chosen: Mapping[str, str | None], limit: int | None, cursor: str | None
) -> Request[Page[Constraint]]:
    """A page of the constraints that a collection keeps."""
    asked = parameters(**chosen, limit=limit, cursor=cursor)
    where = f"{collection_path(collection)}/constraints"
    return Request("GET", where, page("constraints", Constraint), params=asked)


def get_constraints_as(collection: str, wanted: KeptFormat, chosen: Mapping[str, str | None]) -> Request[str]:
    """The constraints that a collection keeps, in a format."""
    asked = parameters(**chosen, format=wanted)
    return Request("GET", f"{collection_path(collection)}/constraints", text, params=asked)


def post_odometry(collection: str, body: Mapping[str, Any]) -> Request[int]:
    """Store relative poses."""

    def parse(response: httpx.Response) -> int:
        return int(response.json()["stored"])

    return with_body("POST", f"{collection_path(collection)}/odometry", body, parse, once())


def delete_constraint(collection: str, constraint: str) -> Request[None]:
    """Delete a constraint."""
    where = f"{collection_path(collection)}/constraints/{segment(constraint, 'constraint')}"
    return Request("DELETE", where, nothing, headers=once())


def post_map(collection: str, body: Mapping[str, Any]) -> Request[Job]:
    """Build a map."""
    return with_body("POST", f"{collection_path(collection)}/maps", body, model(Job), once())


def post_poses(collection: str, body: Mapping[str, Any]) -> Request[int]:
    """Write the poses of many submaps."""

    def parse(response: httpx.Response) -> int:
        return int(response.json()["map_version"])

    return with_body("POST", f"{collection_path(collection)}/poses", body, parse, once())


def post_merge(collection: str, body: Mapping[str, Any]) -> Request[Job]:
    """Lay a map frame onto another."""
    return with_body("POST", f"{collection_path(collection)}/merges", body, model(Job), once())


def get_merge(collection: str, merge: str) -> Request[dict[str, Any]]:
    """A merge: how two frames lie to each other, and what became of each match."""

    def parse(response: httpx.Response) -> dict[str, Any]:
        return dict(response.json())

    return Request("GET", f"{collection_path(collection)}/merges/{segment(merge, 'merge')}", parse)


def get_session_poses(collection: str, session: str) -> Request[dict[str, Any]]:
    """Where each submap of a session is now."""

    def parse(response: httpx.Response) -> dict[str, Any]:
        return dict(response.json())

    where = f"{collection_path(collection)}/sessions/{segment(session, 'session')}/poses"
    return Request("GET", where, parse)


def delete_session(collection: str, session: str) -> Request[None]:
    """Delete all submaps of a session."""
    where = f"{collection_path(collection)}/sessions/{segment(session, 'session')}"
    return Request("DELETE", where, nothing, headers=once())


def get_map(collection: str, map_id: str) -> Request[dict[str, Any]]:
    """A map: numbers, poses and constraints."""

    def parse(response: httpx.Response) -> dict[str, Any]:
        return dict(response.json())

    return Request("GET", f"{collection_path(collection)}/maps/{segment(map_id, 'map')}", parse)


def get_map_trees(collection: str, map_id: str, wanted: TreeFormat, part: int) -> Request[bytes]:
    """The trees of a part of a map as a file."""

    def parse(response: httpx.Response) -> bytes:
        return response.content

    where = f"{collection_path(collection)}/maps/{segment(map_id, 'map')}/landmarks"
    return Request("GET", where, parse, params={"format": wanted, "part": part})


def get_jobs(state: str | None, collection: str | None, limit: int | None, cursor: str | None) -> Request[Page[Job]]:
    """A page of jobs."""
    asked = parameters(state=state, collection=collection, limit=limit, cursor=cursor)
    return Request("GET", "/v1/jobs", page("jobs", Job), params=asked)


def get_job(job_id: str, wait: float) -> Request[Job]:
    """A job."""
    return Request("GET", _job(job_id), model(Job), params={"wait": wait})


def delete_job(job_id: str) -> Request[Job | None]:
    """Cancel a job, or delete a finished one."""

    def parse(response: httpx.Response) -> Job | None:
        return model(Job)(response) if response.status_code == 202 else None

    return Request("DELETE", _job(job_id), parse, headers=once())


def get_results(job_id: str, what: str) -> Request[str]:
    """Lines of results or errors."""
    return Request("GET", f"{_job(job_id)}/{what}", text)


def get_constraints(job_id: str, wanted: ConstraintFormat) -> Request[str]:
    """Constraints in a format."""
    return Request("GET", f"{_job(job_id)}/results", text, params={"format": wanted})


def post_snapshot(name: str | None) -> Request[Snapshot]:
    """Create a snapshot."""
    return with_body("POST", "/v1/snapshots", {} if name is None else {"name": name}, model(Snapshot), once())


def get_snapshots(limit: int | None, cursor: str | None) -> Request[Page[Snapshot]]:
    """A page of snapshots."""
    return Request("GET", "/v1/snapshots", page("snapshots", Snapshot), params=parameters(limit=limit, cursor=cursor))


def get_snapshot(name: str) -> Request[Snapshot]:
    """One snapshot."""
    return Request("GET", _snapshot(name), model(Snapshot), headers={"Accept": JSON})


def get_snapshot_file(name: str) -> Request[str]:
    """The database in a snapshot."""
    return Request("GET", _snapshot(name), text, headers={"Accept": "application/vnd.sqlite3"})


def delete_snapshot(name: str) -> Request[None]:
    """Delete a snapshot."""
    return Request("DELETE", _snapshot(name), nothing, headers=once())


def _job(job_id: str) -> str:
    return f"/v1/jobs/{segment(job_id, 'job')}"


def _snapshot(name: str) -> str:
    return f"/v1/snapshots/{segment(name, 'snapshot')}"
