"""Paths of the resources, for links in answers."""

from urllib.parse import quote

ROOT = "/v1"


def collection(collection_id: str) -> str:
    """Path of a collection."""
    return f"{ROOT}/collections/{quote(collection_id, safe='')}"


def submaps(collection_id: str) -> str:
    """Path of a collection's submaps."""
    return f"{collection(collection_id)}/submaps"


def submap(collection_id: str, submap_id: str) -> str:
    """Path of a submap."""
    return f"{submaps(collection_id)}/{segment(submap_id)}"


def segment(name: str) -> str:
    """An id as the last part of a path."""
    return quote(name, safe="")


def sessions(collection_id: str) -> str:
    """Path of a collection's sessions."""
    return f"{collection(collection_id)}/sessions"


def stands(collection_id: str) -> str:
    """Path of a collection's stands."""
    return f"{collection(collection_id)}/stands"


def constraints(collection_id: str) -> str:
    """Path of a collection's constraints."""
    return f"{collection(collection_id)}/constraints"


def stand(collection_id: str, name: str) -> str:
    """Path of a stand."""
    return f"{stands(collection_id)}/{quote(name, safe='')}"


def job(job_id: str) -> str:
    """Path of a job."""
    return f"{ROOT}/jobs/{quote(job_id, safe='')}"


def job_files(job_id: str) -> str:
    """Path of the list of the files that a job wrote."""
    return f"{job(job_id)}/files"


def job_file(job_id: str, name: str) -> str:
    """Path of a file that a job wrote; `name` may have a folder."""
    return f"{job_files(job_id)}/{quote(name, safe='/')}"


def queries(collection_id: str) -> str:
    """Path of a collection's queries."""
    return f"{collection(collection_id)}/queries"


def query(collection_id: str, number: int | str) -> str:
    """Path of a stored query."""
    return f"{queries(collection_id)}/{number}"


def explanation(collection_id: str, number: int | str) -> str:
    """Path of the explanation of a stored query."""
    return f"{query(collection_id, number)}/explanation"


def match(collection_id: str, number: int, rank: int) -> str:
    """Path of the drawing of a stored query's candidate."""
    return f"{query(collection_id, number)}/candidates/{rank}/match"


def snapshots() -> str:
    """Path of the snapshots."""
    return f"{ROOT}/snapshots"


def snapshot(name: str) -> str:
    """Path of a snapshot."""
    return f"{snapshots()}/{quote(name, safe='')}"
