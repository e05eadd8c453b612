"""The files that a job has written: listed, and opened by the names in the list."""

from dataclasses import dataclass
from typing import BinaryIO, Final

from server.errors import Gone, NotFound
from server.jobs import queue
from server.jobs.folder import JobFolder
from server.resources import links
from server.schemas.files.coregistrations import JobFile, JobFileList
from server.security.principal import Principal
from server.store.storage import Storage

_MEDIA_TYPES: Final = {
    ".csv": "text/csv; charset=utf-8",
    ".gpkg": "application/geopackage+sqlite3",
    ".html": "text/html; charset=utf-8",
    ".json": "application/json",
    ".jsonl": "application/x-ndjson",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
}


@dataclass(frozen=True, slots=True)
class OpenFile:
    """A file that can be read to its end even if the job is deleted meanwhile. `size` is in bytes."""

    file: BinaryIO
    size: int
    media_type: str


def listed(database: Storage, folder: JobFolder, caller: Principal, job_id: str) -> JobFileList:
    """The files of a job that has ended. Raises NotFound, Conflict (unfinished) and Gone (it has none)."""
    row = queue.finished_row(database, caller, job_id)
    inside = folder.files(row.id)
    if "written" not in row.progress or not inside.is_dir():
        raise Gone(f"The job {row.id} has no files, or they were deleted because they are only kept for some time.")
    found = []
    for path in sorted(one for one in inside.rglob("*") if one.is_file()):
        name = path.relative_to(inside).as_posix()
        found.append(
            JobFile(name=name, bytes=path.stat().st_size, media_type=_type(name), href=links.job_file(row.id, name))
        )
    return JobFileList(files=found)


def opened(database: Storage, folder: JobFolder, caller: Principal, job_id: str, name: str) -> OpenFile:
    """One of these files. Raises as `listed`, and NotFound if the list does not name it."""
    known = listed(database, folder, caller, job_id)
    if not any(one.name == name for one in known.files):
        raise NotFound("file", name[:100])
    try:
        file = (folder.files(job_id) / name).open("rb")
    except FileNotFoundError as error:
        raise Gone(f"The files of the job {job_id} were just deleted.") from error
    return OpenFile(file, file.seek(0, 2) - file.seek(0), _type(name))


def _type(name: str) -> str:
    return _MEDIA_TYPES.get(f".{name.rpartition('.')[2]}", "application/octet-stream")
