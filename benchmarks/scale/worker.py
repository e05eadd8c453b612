"""A process for one measurement, so that what it needs and how it starts is its own: `run_alone` starts it."""

import importlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks import record
from benchmarks.scale.measurement import Figures, Measurement
from benchmarks.scale.measurement_plan import PARTS

ROOT = Path(__file__).parents[2]


def run_here(measurement: Measurement) -> Figures:
    """Measure in this process. Only the part's own module is loaded, because memory and start are measured, too."""
    module = importlib.import_module(f"benchmarks.scale.{PARTS[measurement.part].module}")
    figures: Figures = module.run(measurement)
    return figures


def run_alone(measurement: Measurement) -> Figures:
    """Measure in a fresh process. Raises subprocess.CalledProcessError when that fails."""
    target = measurement.room / f"{measurement.part}.new"
    command = [sys.executable, "-m", "benchmarks.scale.worker", measurement.to_json(), str(target.absolute())]
    # No setting of the caller's environment may change what is measured.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("URQUHART_")}
    with tempfile.TemporaryDirectory() as nothing:
        if measurement.part == "compile":
            environment["NUMBA_CACHE_DIR"] = nothing
        subprocess.run(command, cwd=ROOT, env=environment, check=True)
    figures = record.read(target)
    target.unlink()
    return figures


if __name__ == "__main__":
    record.write(Path(sys.argv[2]), run_here(Measurement.from_json(sys.argv[1])))
