"""A robot drives twice around a loop in a mapped forest, and notices where it has been before.

    make serve                                       # or any service: its address is the first argument
    .venv/bin/python examples/robot_loop.py [URL]    # in another terminal, with URQUHART_API_KEY set if it needs a key

A key with the scopes read and write is enough where an administrator has made the collection `robots` before.

It sees the trees of data/stem_maps/longleaf.csv within 25 m, to 10 cm, nine of ten; it knows neither where it is nor
which way it looks. At every stop it stores what it sees, and asks in the same call whether it was there before. The
second run beside one service prints nothing: it is recognised among the submaps of the first, which it does not know.
"""

import os
import sys
from pathlib import Path

import numpy as np

from urquhart_client import Client

stem_map = Path(__file__).parents[1] / "data/stem_maps/longleaf.csv"
url = sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8420"
trees = np.loadtxt(stem_map, delimiter=",", skiprows=1, usecols=(1, 2))
centre, rng, stops = trees.mean(axis=0), np.random.default_rng(1), {}

with Client(url, api_key=os.environ.get("URQUHART_API_KEY")) as robot:
    if all(known.id != "robots" for known in robot.collections()):
        robot.put_collection("robots")
    for stop in range(50):  # 25 on each round
        angle, heading = 2 * np.pi * stop / 25, rng.uniform(-np.pi, np.pi)
        here = centre + 40 * np.array([np.cos(angle), np.sin(angle)])
        cos, sin = np.cos(heading), np.sin(heading)
        turn = np.array([[cos, -sin], [sin, cos]])  # from the robot's frame to the map's
        near = trees[(np.hypot(*(trees - here).T) < 25) & (rng.random(len(trees)) < 0.9)]
        seen = (near - here) @ turn + rng.normal(0, 0.1, near.shape)

        recent = [name for name, (when, *_) in stops.items() if stop - when < 10]
        stored = robot.post_submap("robots", xy=seen, query={"exclude": {"submap_ids": recent}})

        best = stored.query.best if stored.query.verdict == "matched" else None
        if best is not None and best.submap_id in stops:
            when, there, old_turn = stops[best.submap_id]
            found = there + old_turn @ [best.transform.x, best.transform.y]
            error = np.hypot(*(found - here))
            print(
                f"stop {stop}: was here at stop {when} ({best.inlier_count} trees agree), {error:.2f} m from the truth"
            )
        stops[stored.id] = stop, here, turn
