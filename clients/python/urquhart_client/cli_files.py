"""Commands of `urquhart-client` that send and fetch files."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from urquhart_client.cli_output import ensure_collection, show, tell, tell_job
from urquhart_client.client import Client
from urquhart_client.coregistrations import SeasonOptions
from urquhart_client.stem_maps import FileCutting, FileOptions

_SEARCH = {
    "at_sigma": ("M", float, "search plots where they ought to be first: standard deviation of that, in metres"),
    "positions_crs": ("CODE", str, "coordinate reference system of --positions, such as EPSG:4326"),
    "heading": ("DEG", float, "bearing of the plots' y axes"),
    "heading_sigma": ("DEG", float, "standard deviation of --heading"),
    "frame_id": ("NAME", str, "map frame that plots ought to be in"),
    "noise": ("M", float, "roughly how far trees are off in the map"),
    "min_confidence": ("P", float, "least confidence of a plot that is matched"),
    "effort": ("fast|full", str, "how far to search if a plot is not found (default: full)"),
}
"""Options of a season's search, by the members of `SeasonOptions`."""


def add_file_commands(command: Callable[[str, Any, str], argparse.ArgumentParser]) -> None:
    """Add the commands; `command` makes one."""
    stand = command("put-stand", _put_stand, "Store a file of trees as a stand, in the place of what that had.")
    stand.add_argument("collection", help="id of the collection; it is created if it does not exist")
    stand.add_argument("name", help="name of the stand")
    stand.add_argument("file", type=Path, help="trees, in any format that the service reads")
    stand.add_argument("--radius", type=float, help="radius of a submap, in metres")
    stand.add_argument("--spacing", type=float, help="distance between neighbouring submaps, in metres")
    stand.add_argument("--one-submap", action="store_true", help="make each file, or each of its plots, one submap")
    add_read_options(stand)
    season = command(
        "coregister", _coregister, "Place all plots of files in a map, and fetch tables, layers, pictures and a report."
    )
    season.add_argument("collection", help="id of the collection with the map")
    season.add_argument("plots", type=Path, nargs="+", help="files of one plot or many, or folders")
    season.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the results; it is created")
    season.add_argument("--positions", type=Path, metavar="FILE", help="where plots ought to be: plot, x, y")
    for name, (metavar, kind, about) in _SEARCH.items():
        season.add_argument(f"--{name.replace('_', '-')}", type=kind, metavar=metavar, help=about)
    add_read_options(season)
    export = command("export", _export, "Download a collection as CSV, GeoJSON, GeoPackage or GeoParquet, by suffix.")
    export.add_argument("table", choices=["landmarks", "submaps", "matches", "pairs"], help="what to export")
    export.add_argument("collection", help="id of the collection")
    export.add_argument("file", type=Path, help="ends in .csv, .geojson, .gpkg or .parquet")
    export.add_argument("--frame-id", metavar="NAME", help="only what is in this map frame")
    export.add_argument("--session", metavar="NAME", help="only landmarks or submaps of this session")


def _put_stand(client: Client, options: argparse.Namespace) -> int:
    ensure_collection(client, options.collection)
    stand = client.put_stand(
        options.collection,
        options.name,
        options.file,
        cut=_cutting(options),
        **read_options(options),
    )
    sys.stderr.write(f"{options.file.name}: {stand.understood}\n")
    tell(options, stand, f"{stand.name}: {stand.trees} trees, {stand.submaps} submaps")
    return 0


def _coregister(client: Client, options: argparse.Namespace) -> int:
    """Exit code 1 if the job failed or a plot could not be read."""
    search: Any = {name: value for name in _SEARCH if (value := getattr(options, name)) is not None}
    wanted: SeasonOptions = search
    job = client.coregister(
        options.collection,
        *options.plots,
        positions=options.positions,
        search=wanted,
        progress=show if sys.stderr.isatty() else None,
        **read_options(options),
    )
    if sys.stderr.isatty():
        sys.stderr.write("\r\033[K")
    tell_job(options, job)
    if not job.is_successful:
        return 1
    for row in client.plot_rows(job.id):
        if row.look_at:
            sys.stderr.write(f"look at {row.plot}: {row.look_at}\n")
    client.download_job_files(job.id, options.out)
    sys.stderr.write(f"report: {options.out / 'report.html'}\n")
    return 0 if not job.counts.get("not_read", 0) else 1


def _export(client: Client, options: argparse.Namespace) -> int:
    written = client.export(
        options.collection, options.table, options.file, frame_id=options.frame_id, session=options.session
    )
    sys.stderr.write(f"{written}: {written.stat().st_size} bytes\n")
    return 0


def _cutting(options: argparse.Namespace) -> FileCutting:
    """How a file is cut; the service says what is missing."""
    if options.one_submap:
        return {"one_submap": True}
    cut: FileCutting = {}
    if options.radius is not None:
        cut["radius"] = options.radius
    if options.spacing is not None:
        cut["spacing"] = options.spacing
    return cut


def read_options(options: argparse.Namespace) -> Any:
    """What the caller says about a file."""
    known = {name: getattr(options, f"read_{name}") for name in FileOptions.__annotations__}
    return {name: value for name, value in known.items() if value}


def add_read_options(parser: argparse.ArgumentParser) -> None:
    """The options that say what is in a file of trees; `urquhart index --help` and docs/files.md explain each."""
    group = parser.add_argument_group("what is in the file, as for urquhart index")
    for name in FileOptions.__annotations__:
        flag, to = f"--{name.replace('_', '-')}", f"read_{name}"
        if name == "skip_bad":
            group.add_argument(flag, dest=to, action="store_true", help="leave out rows that cannot be used")
        else:
            group.add_argument(flag, dest=to, metavar="VALUE")
