"""Makes the files of docs/tutorial.md: a map of trees, a season of plots in it, and where those ought to be.

    python examples/forest_season.py tutorial                          # forest.csv, plots.csv, gnss.csv in this folder
    python examples/forest_season.py --pictures SEASON docs/images     # the tutorial's pictures, from its results

The forest is real (data/stem_maps/longleaf.csv, put at a place in EPSG:32616), and so are its diameters. The season is
simulated ten years later: trees have grown, a few are gone, and a few are new.
"""

import csv
import shutil
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer

STEM_MAP = Path(__file__).parents[1] / "data" / "stem_maps" / "longleaf.csv"
CORNER = np.array([786_000.0, 3_410_000.0])
"""Where the south-west corner of the forest is, in EPSG:32616."""
CENTRES = {"P1": (50.0, 55.0), "P2": (105.0, 50.0), "P3": (155.0, 60.0), "P4": (60.0, 150.0), "P5": (150.0, 150.0)}
"""Centres of the plots in the forest, metres."""
RADIUS = 20.0
GNSS_OFF = {"P5": (70.0, -45.0)}
"""How far positions are off, metres, if not by a few metres: P5 was written down wrongly."""
PICTURES = {"P2.svg": "tutorial-plot.svg", "P5.svg": "tutorial-moved.svg"}


def main(arguments: list[str]) -> None:
    """Write the files into a folder; or with --pictures, copy drawings from the results."""
    match arguments:
        case ["--pictures", season, images]:
            for drawn, name in PICTURES.items():
                shutil.copyfile(Path(season) / "pictures" / drawn, Path(images) / name)
        case [folder]:
            write(Path(folder))
        case _:
            sys.exit(__doc__)


def write(folder: Path) -> None:
    """Write forest.csv, plots.csv and gnss.csv."""
    folder.mkdir(exist_ok=True)
    with STEM_MAP.open(newline="") as file:
        trees = list(csv.DictReader(file))
    names, diameters = [tree["tree_id"] for tree in trees], [float(tree["dbh_cm"]) for tree in trees]
    xy = np.array([(float(tree["x_m"]), float(tree["y_m"])) for tree in trees])
    rng = np.random.default_rng(7)
    seen = xy + rng.normal(0.0, 0.15, xy.shape) + CORNER  # as an airborne scan finds stems
    table(
        folder / "forest.csv",
        "tree,easting,northing,dbh_cm",
        [
            f"{name},{x:.2f},{y:.2f},{dbh:.1f}"
            for name, dbh, (x, y) in zip(names, diameters, seen.tolist(), strict=True)
        ],
    )
    rows: list[str] = []
    for plot, centre in CENTRES.items():
        rows += plot_rows(plot, xy - centre, diameters, rng)
    elsewhere = rng.uniform(-RADIUS, RADIUS, (30, 2))
    rows += plot_rows("P6", elsewhere, rng.uniform(10.0, 50.0, 30).tolist(), rng)
    rows += ["P7,1,12.5,4.20,31.0", "P7,2,90.0,,28.5", "P7,3,211.0,9.75,40.1"]
    table(folder / "plots.csv", "plot,tag,azimuth_deg,distance_m,dbh_cm", rows)
    to_degrees = Transformer.from_crs("EPSG:32616", "EPSG:4326", always_xy=True)
    positions = []
    for plot, centre in {**CENTRES, "P6": (120.0, 120.0)}.items():
        off = np.array(GNSS_OFF.get(plot, rng.normal(0.0, 1.8, 2)))
        longitude, latitude = to_degrees.transform(*(CORNER + centre + off))
        positions.append(f"{plot},{longitude:.7f},{latitude:.7f},EPSG:4326")
    table(folder / "gnss.csv", "plot,x,y,crs", positions)


def plot_rows(plot: str, offsets: NDArray[np.float64], dbh_cm: list[float], rng: np.random.Generator) -> list[str]:
    """What a crew writes down at the centre of a plot: azimuth from north, distance and diameter of each tree."""
    distances = np.hypot(*offsets.T)
    inside = [tree for tree in np.flatnonzero(distances < RADIUS).tolist() if rng.uniform() > 0.06]  # a few are gone
    measured = [(*offsets[tree].tolist(), dbh_cm[tree] + 2.5) for tree in inside]
    measured += [(*rng.uniform(-0.6 * RADIUS, 0.6 * RADIUS, 2).tolist(), 7.5)]  # and one is new
    rows = []
    for tag, (east, north, dbh) in enumerate(measured, start=1):
        azimuth = np.degrees(np.arctan2(east, north)) + 1.5 + rng.normal(0.0, 0.3)  # the compass is off by 1.5 degrees
        distance = np.hypot(east, north) + rng.normal(0.0, 0.05)
        rows.append(f"{plot},{tag},{azimuth % 360.0:.1f},{max(distance, 0.05):.2f},{dbh:.1f}")
    return rows


def table(path: Path, header: str, rows: list[str]) -> None:
    """Write a table."""
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
