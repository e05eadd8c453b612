"""`urquhart-client`: use the service from a shell, on any machine that can reach it."""

import argparse
import os
import sys
from collections.abc import Collection, Sequence
from math import degrees
from pathlib import Path
from typing import Any, Final, NoReturn

import httpx

from urquhart_client._protocol.landmark_files import FileError, read_body
from urquhart_client._protocol.retry import Retry
from urquhart_client.cli_files import add_file_commands, add_read_options, read_options
from urquhart_client.cli_output import ensure_collection, show, tell, tell_job
from urquhart_client.client import Client
from urquhart_client.errors import UrquhartError
from urquhart_client.poses import SurveyPose

_OBSERVED: Final = frozenset({"xy", "ids", "landmarks", "frame_id", "stamp"})
_SUBMAP: Final = _OBSERVED | {"session", "map_pose", "properties", "query"}
_QUERY: Final = _OBSERVED | {"submap_id", "method", "seed", "store", "explain", "per_session", "near", "exclude"}


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Refuse in one line, like all other errors."""
        self.exit(2, f"urquhart-client: {message} (see {self.prog} --help)\n")


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command. Returns its exit code: 0, 1 if a job failed, 2 if the command failed."""
    options = _parser().parse_args(arguments)
    url = options.url or os.environ.get("URQUHART_URL", "http://127.0.0.1:8420")
    try:
        # Few attempts, because a person waits who may have mistyped the address.
        client = Client(url, api_key=os.environ.get("URQUHART_API_KEY") or None, retry=Retry(attempts=3))
    except httpx.InvalidURL as error:
        return _refuse(f"{url}: {error}")
    except ValueError as error:
        return _refuse(str(error))
    try:
        with client:
            return int(options.command(client, options))
    except (UrquhartError, FileError) as error:
        return _refuse(str(error))
    except ValueError as error:  # what a file holds
        return _refuse(f"{options.file}: {error}" if "file" in options else str(error))
    except OSError as error:
        return _refuse(f"{error.filename or url}: {error.strerror or error}")
    except KeyboardInterrupt:
        return 130


def main() -> None:
    """Entry point of the console script."""
    sys.exit(run())


def _collections(client: Client, options: argparse.Namespace) -> int:
    for one in client.collections():
        tell(options, one, f"{one.id}: {one.counts.get('submaps', 0)} submaps, revision {one.revision}")
    return 0


def _put(client: Client, options: argparse.Namespace) -> int:
    body = _read(client, options, _SUBMAP)
    if options.session is not None and "session" in body:
        raise FileError(f"{options.file}: it has a session, but --session is given, too: drop one")
    if options.session is not None:
        body["session"] = options.session
    ensure_collection(client, options.collection)
    receipt = client.put_submap(options.collection, options.submap, **body)
    cleared = f", cleared {', '.join(receipt.cleared)}" if receipt.cleared else ""
    why = f" ({receipt.detail})" if receipt.detail else ""
    tell(options, receipt, f"{options.submap}: {receipt.outcome}{why}, revision {receipt.revision}{cleared}")
    return 0


def _query(client: Client, options: argparse.Namespace) -> int:
    result = client.query(options.collection, limit=options.limit, **_read(client, options, _QUERY))
    lines = [f"{result.verdict} ({result.reason})"]
    for one in result.candidates:
        at, there = one.transform, one.map_pose
        in_map = "" if there is None else f"; in the map {there.frame_id!r} {_pose(there.x, there.y, there.yaw)}"
        lines.append(
            f"  {one.submap_id}: in its frame {_pose(at.x, at.y, at.yaw)}{in_map}; "
            f"{one.inlier_count} inliers, confidence {one.confidence:.4f}"
        )
        lines += _surveyed(one.survey)
    tell(options, result, "\n".join(lines))
    return 0


def _pose(x: float, y: float, yaw: float) -> str:
    return f"x {x:.3f} m, y {y:.3f} m, yaw {degrees(yaw):.2f} deg"


def _surveyed(survey: SurveyPose | None) -> list[str]:
    """Where the middle of the trees is, in full coordinates of its system."""
    if survey is None or survey.crs_position is None:
        return []
    (first, second), (x, y) = survey.axes, survey.crs_position
    unit = "m" if survey.crs_unit in (None, "metre") else survey.crs_unit
    return [f"    the middle of its trees is at {first} {x:.3f}, {second} {y:.3f} {unit} ({survey.crs})"]


def _import(client: Client, options: argparse.Namespace) -> int:
    ensure_collection(client, options.collection)
    job = client.import_file(
        options.collection,
        options.file,
        on_conflict=options.on_conflict,
        mode=options.mode,
        progress=show if sys.stderr.isatty() else None,
    )
    if sys.stderr.isatty():
        sys.stderr.write("\r\033[K")
    refused = job.counts.get("refused", 0)
    for line in client.job_errors(job.id) if refused else ():
        sys.stderr.write(f"line {line.line}: {(line.problem or {}).get('detail', 'refused')}\n")
    tell_job(options, job)
    return 0 if job.is_successful and not refused else 1


def _jobs(client: Client, options: argparse.Namespace) -> int:
    for job in client.jobs(state=options.state):
        tell_job(options, job)
    return 0


def _snapshot(client: Client, options: argparse.Namespace) -> int:
    made = client.create_snapshot(options.name)
    tell(options, made, f"{made.name}: {made.bytes} bytes, sha256 {made.sha256}")
    if options.download is not None:
        client.download_snapshot(made.name, options.download)
    return 0


def _read(client: Client, options: argparse.Namespace, members: Collection[str]) -> dict[str, Any]:
    """The arguments in a file: a JSON body with some of these members, or trees that the service reads.

    Raises FileError and UrquhartError.
    """
    path = options.file
    if path.suffix == ".json":
        return read_body(path, members)
    read = client.read_stem_map(path, **read_options(options))
    if len(read.plots) > 1:
        raise FileError(f"{path}: has {len(read.plots)} plots: choose one with --only, such as {read.plots[0].name!r}")
    sys.stderr.write(f"{path.name}: {read.understood}\n")
    return {"landmarks": read.plots[0].landmarks if read.plots else []}


def _refuse(message: str) -> int:
    sys.stderr.write(f"urquhart-client: {' '.join(message.split())}\n")
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="urquhart-client",
        description="Use an Urquhart service from a shell. Set URQUHART_URL to its address and, if it needs one, "
        "URQUHART_API_KEY to your key.",
    )
    parser.add_argument("--url", help="address of the service (default: URQUHART_URL or http://127.0.0.1:8420)")
    parser.add_argument("--json", action="store_true", help="print each answer as a line of JSON")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, does: Any, about: str) -> argparse.ArgumentParser:
        made = commands.add_parser(name, help=about, description=about)
        made.set_defaults(command=does)
        return made

    command("collections", _collections, "List the collections.")
    put = command("put", _put, "Store a submap from a file of trees, or from JSON.")
    put.add_argument("collection", help="id of the collection; it is created if it does not exist")
    put.add_argument("submap", help="id of the submap; a submap with this id is replaced")
    put.add_argument("file", type=Path, help="trees, in any format that the service reads, or the JSON body of a PUT")
    put.add_argument("--session", help="the drive, flight or survey that the submap belongs to")
    add_read_options(put)
    add_file_commands(command)
    query = command("query", _query, "Find where the trees in a file were observed.")
    query.add_argument("collection", help="id of the collection to search")
    query.add_argument("file", type=Path, help="trees, in any format the service reads, or the JSON body of a query")
    query.add_argument("--limit", type=int, default=5, help="most candidates to print (default: 5)")
    add_read_options(query)
    upload = command(
        "import",
        _import,
        "Store the submaps of an NDJSON file, compressed with gzip or not. The exit code is 1 if a line was refused.",
    )
    upload.add_argument("collection", help="id of the collection; it is created if it does not exist")
    upload.add_argument("file", type=Path, help="NDJSON with one submap on each line, or the same as .gz")
    upload.add_argument(
        "--on-conflict",
        choices=["replace", "skip", "fail"],
        default="replace",
        help="what to do with a line whose id is stored with other content (default: replace)",
    )
    upload.add_argument(
        "--mode",
        choices=["continue", "all"],
        default="continue",
        help="continue past refused lines, or store all lines or none (default: continue)",
    )
    jobs = command("jobs", _jobs, "List the jobs, newest first.")
    jobs.add_argument(
        "--state",
        choices=["accepted", "running", "successful", "failed", "dismissed"],
        help="only jobs in this state",
    )
    snapshot = command("snapshot", _snapshot, "Create a snapshot of the whole database.")
    snapshot.add_argument("name", nargs="?", help="name of the snapshot (default: the time)")
    snapshot.add_argument("--download", type=Path, metavar="FILE", help="also download the snapshot to this file")
    return parser
