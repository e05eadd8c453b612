"""Three drives through a forest, each submap in a frame of its own, become one map of its trees.

    make serve                                            # or any service: its address is the first argument
    .venv/bin/python examples/drives_to_map.py [URL] [FILE]

The robot sees the trees of data/stem_maps/longleaf.csv within 30 m, to 10 cm, nine of ten, and knows neither where it
is nor which way it looks. The service finds where the submaps of the three drives overlap, leaves out what contradicts
the rest, and merges the trees. FILE is trees.gpkg unless you name another: .csv, .geojson, .gpkg or .parquet.
"""

import sys
from pathlib import Path

import numpy as np

from urquhart_client import Client

url = sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8420"
file = Path(sys.argv[2] if len(sys.argv) > 2 else "trees.gpkg")
stem_map = Path(__file__).parents[1] / "data/stem_maps/longleaf.csv"
trees, rng = np.loadtxt(stem_map, delimiter=",", skiprows=1, usecols=(1, 2)), np.random.default_rng(1)
drives = {"north": (0.3, 0.7), "middle": (0.3, 0.5), "across": (0.5, None)}  # where each begins, as shares of the stand

with Client(url) as robot:
    robot.put_collection("drives")
    for name, (start, row) in drives.items():
        for stop, along in enumerate(np.linspace(0.25, 0.75, 8)):
            here = trees.min(0) + np.ptp(trees, 0) * ([along, row] if row else [start, along])
            heading = rng.uniform(-np.pi, np.pi)
            turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
            near = trees[(np.hypot(*(trees - here).T) < 30) & (rng.random(len(trees)) < 0.9)]
            seen = (near - here) @ turn + rng.normal(0, 0.1, near.shape)
            robot.put_submap("drives", f"{name}-{stop}", xy=seen, session=name)

    job = robot.wait_for_job(robot.build_map("drives", {"apply": True}).id)
    found = robot.get_map("drives", job.id)["summary"]
    file.write_bytes(robot.map_trees("drives", job.id, file.suffix[1:]))
    print(f"{found['submaps']} submaps in {len(found['parts'])} part(s): {found['trees']} trees in {file}")
