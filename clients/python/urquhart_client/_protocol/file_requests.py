"""Requests about files: exports, coregistrations, and what jobs write; see `requests`."""

from collections.abc import Callable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any, Literal
from urllib.parse import quote

from urquhart_client._protocol.exchange import Request, Upload, document, model, text
from urquhart_client._protocol.requests import JSON, collection_path, once, parameters, segment
from urquhart_client.coregistrations import JobFile
from urquhart_client.errors import UnexpectedAnswer
from urquhart_client.job_models import Job

ExportTable = Literal["landmarks", "submaps", "matches", "pairs"]
"""What of a collection is exported."""
_FORMATS = {".csv": "csv", ".geojson": "geojson", ".gpkg": "gpkg", ".parquet": "parquet"}


def post_coregistration(
    collection: str, source: Path, asked: Mapping[str, Any], key: str | None, sent: Callable[[int], None]
) -> Request[Job]:
    """Upload files of plots. `asked`: what is known of the files, and how plots are searched."""
    given = {name: value for name, value in asked.items() if value not in (None, False, "")}
    known = {name: "true" if value is True else value for name, value in given.items()}
    is_packed = source.suffix == ".zip"
    coding = {} if is_packed else {"Content-Encoding": "gzip"}
    return Request(
        "POST",
        f"{collection_path(collection)}/coregistrations",
        model(Job),
        params=parameters(file=source.name, **known),
        headers={"Content-Type": "application/octet-stream", "Accept": JSON} | coding | once(key),
        content=Upload(source, packed=is_packed, sent=sent),
    )


def get_job_files(job_id: str) -> Request[list[JobFile]]:
    """The files that a job wrote."""

    def parse(response: Any) -> list[JobFile]:
        return [JobFile.model_validate(one) for one in document(response)["files"]]

    return Request("GET", f"{_job(job_id)}/files", parse)


def get_job_file(job_id: str, name: str) -> Request[str]:
    """One of these files."""
    return Request("GET", f"{_job(job_id)}/files/{quote(name, safe='/')}", text)


def inside(folder: Path, name: str) -> Path:
    """Where a file of a job is written. Raises UnexpectedAnswer for a name that leads out of the folder."""
    parts = PurePosixPath(name).parts
    if not parts or name.startswith("/") or any(part in ("..", ".") or "\\" in part for part in parts):
        raise UnexpectedAnswer(f"a file of the job has the name {name!r}, which no file may have", 200, "")
    return folder.joinpath(*parts)


def get_export(collection: str, table: ExportTable, path: Path, chosen: Mapping[str, Any]) -> Request[str]:
    """A collection's landmarks, submaps, matches or pairs, in the format of the suffix of `path`. Raises ValueError."""
    written = _FORMATS.get(path.suffix.lower())
    if written is None:
        raise ValueError(f"{path}: the suffix says the format, and is none of {', '.join(_FORMATS)}")
    known = {name: "true" if value is True else value for name, value in chosen.items() if value not in (None, False)}
    return Request(
        "GET",
        f"{collection_path(collection)}/exports/{segment(table, 'table')}",
        text,
        params=parameters(format=written, **known),
    )


def _job(job_id: str) -> str:
    return f"/v1/jobs/{segment(job_id, 'job')}"
