"""What a million trees cost: `urquhart index` from CSV, GeoPackage and LAZ, and `urquhart export` to each format.

    python -m benchmarks.survey_files [--trees 1000000] [--record docs/results/survey_files.json]

Each command runs in processes of its own. Seconds are on the clock; memory is the largest resident set of any of them.
Trees stand at random, 400 on a hectare, with diameters, in EPSG:25832; a LAZ has four points for each. Submaps are
circles of 60 m, 100 m apart.
"""

import argparse
import json
import struct
import subprocess
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from benchmarks.machine import machine

_DENSITY: Final = 400.0
_SYSTEM: Final = "EPSG:25832"
_CORNER: Final = np.array([440_000.0, 5_400_000.0])
_OUT: Final = (".csv", ".geojson", ".gpkg", ".parquet")


def forest(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions (N, 2), metres, and diameters (N,), centimetres."""
    rng = np.random.default_rng(0)
    side = 100.0 * (count / _DENSITY) ** 0.5
    return rng.uniform(0.0, side, (count, 2)).round(2) + _CORNER, rng.uniform(8.0, 70.0, count).round(1)


def write_csv(path: Path, xy: NDArray[np.float64], dbh_cm: NDArray[np.float64]) -> None:
    """Write a table."""
    with path.open("w") as file:
        file.write("tag,x,y,dbh_cm\n")
        file.writelines(
            f"{tag},{x:.2f},{y:.2f},{dbh}\n"
            for tag, ((x, y), dbh) in enumerate(zip(xy.tolist(), dbh_cm.tolist(), strict=True))
        )


def write_gpkg(path: Path, xy: NDArray[np.float64], dbh_cm: NDArray[np.float64]) -> None:
    """Write a GeoPackage."""
    points = np.array([struct.pack("<BIdd", 1, 1, x, y) for x, y in xy.tolist()], dtype=object)
    columns = [np.arange(len(xy)).astype(str).astype(object), dbh_cm]
    names = np.array(["tag", "dbh_cm"])
    raw: Any = import_module("pyogrio.raw")
    raw.write(str(path), points, columns, names, layer="trees", driver="GPKG", geometry_type="Point", crs=_SYSTEM)


def write_laz(path: Path, xy: NDArray[np.float64], dbh_cm: NDArray[np.float64]) -> None:
    """Write a point cloud with four points for each tree."""
    laspy: Any = import_module("laspy")
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.add_extra_dim(laspy.ExtraBytesParams("treeID", np.int32))
    header.scales, header.offsets = [0.001] * 3, [*_CORNER.tolist(), 0.0]
    header.add_crs(CRS.from_user_input(_SYSTEM))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y = np.repeat(xy, 4, axis=0).T
    cloud.z = np.tile([0.2, 1.2, 1.4, 6.0], len(xy))
    cloud["treeID"] = np.repeat(np.arange(1, len(xy) + 1), 4)
    cloud.write(str(path))


WRITERS: Final = {".csv": write_csv, ".gpkg": write_gpkg, ".laz": write_laz}


def measured(arguments: list[str]) -> dict[str, float]:
    """Seconds and megabytes of one command."""
    before = time.perf_counter()
    wrapped = (
        "import resource, subprocess, sys; code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode; "
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); sys.exit(code)"
    )
    command = [sys.executable, "-c", wrapped, sys.executable, "-m", "server", *arguments]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return {"seconds": round(time.perf_counter() - before, 1), "megabytes": round(int(told) / 1024.0)}


def main() -> None:
    """Measure, print, and record if that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trees", type=int, default=1_000_000)
    parser.add_argument("--record", type=Path)
    options = parser.parse_args()
    xy, dbh_cm = forest(options.trees)
    found: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory(prefix="urquhart-files-") as folder:
        for suffix, write in WRITERS.items():
            path = Path(folder) / f"forest{suffix}"
            write(path, xy, dbh_cm)
            database = ["--database", str(Path(folder) / f"{suffix[1:]}.db")]
            system = ["--crs", _SYSTEM] if suffix == ".csv" else []
            cut = ["--collection", "c", "--radius", "60", "--spacing", "100"]
            found[f"index {suffix}"] = measured(["index", str(path), *cut, *system, *database])
            print(f"index {suffix}: {found[f'index {suffix}']}", flush=True)
        for suffix in _OUT:
            target = Path(folder) / f"out{suffix}"
            found[f"export {suffix}"] = measured(
                ["export", "landmarks", str(target), "--collection", "c", "--database", str(Path(folder) / "gpkg.db")]
            )
            print(f"export {suffix}: {found[f'export {suffix}']}", flush=True)
    if options.record is not None:
        told = {"machine": machine(), "command": "python -m benchmarks.survey_files", "trees": options.trees}
        options.record.write_text(json.dumps(told | {"found": found}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
